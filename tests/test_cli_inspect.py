"""What `faces` and `check` say before anything is computed: resultants by hand, and the same as the nodal forces."""

import io
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from rich.console import Console
from shapes import box_mesh

from michell_cad.cli_inspect import check_job, load_resultant, show_faces, show_schema
from michell_cad.domain import part_from_tets
from michell_cad.errors import InvalidInputError
from michell_cad.job import Load, Setup, build_problem, choose_material

WEIGHT = 16 * 1.04e-6 * 9.80665
"""16 mm^3 of ABS, N."""

END = {"plane": {"point": [4, 0, 0], "normal": [1, 0, 0]}}


def console() -> tuple[Console, io.StringIO]:
    text = io.StringIO()
    return Console(file=text, width=160), text


@pytest.fixture
def box_job(tmp_path) -> Path:
    trimesh.creation.box((40, 20, 20)).export(tmp_path / "box.stl")
    job = tmp_path / "job.toml"
    job.write_text(
        '[part]\nfile = "box.stl"\n[[support]]\nnearest = [-20, 0, 0]\n'
        "[[load]]\nbox = [[20, -10, -3], [20, 10, 3]]\nforce = [0, 0, -50]\n"
        '[[load]]\nnearest = [0, 0, 10]\npressure = 0.1\ncase = "snow"\n'
    )
    return job


@pytest.mark.parametrize(
    ("load", "force", "moment"),
    [
        ({**END, "force": [1, 2, -10]}, [1, 2, -10], np.cross([4, 1, 1], [1, 2, -10])),
        ({**END, "pressure": 3.0}, [-12, 0, 0], np.cross([4, 1, 1], [-12, 0, 0])),
        ({**END, "torque": {"moment": -7.0, "axis": [2, 0, 0]}}, [0, 0, 0], [-7, 0, 0]),
        ({"self_weight": [0, -3, 0]}, [0, -WEIGHT, 0], np.cross([2, 1, 1], [0, -WEIGHT, 0])),
    ],
)
def test_resultants_by_hand_and_as_applied(load, force, moment):
    part = part_from_tets(box_mesh((8, 4, 4), (4.0, 2.0, 2.0)))
    density = choose_material(Setup().material).density
    result = load_resultant(part.outline, Load.model_validate(load), density)
    assert result.force == pytest.approx(force, abs=1e-9)
    assert result.moment == pytest.approx(moment, abs=1e-9)
    support = {"plane": {"point": [0, 0, 0], "normal": [1, 0, 0]}}
    nodal = build_problem(Setup.model_validate({"support": [support], "load": [load]}), part).load_cases[0].force
    assert result.force == pytest.approx(nodal.sum(0), abs=1e-9)
    assert result.moment == pytest.approx(np.cross(part.mesh.vertices, nodal).sum(0), abs=1e-9)


def test_check_says_what_would_be_done(box_job, tmp_path):
    terminal, text = console()
    check_job(box_job, tmp_path / "check.png", terminal)
    said = text.getvalue()
    for words in ("box.stl", "ABS", "about", "held along xyz", "400 mm2", "force (0, 0, -50) N", "load case snow"):
        assert words in said, said
    assert "force (0, 0, -80) N" in said  # 0.1 MPa on 40 x 20 mm
    with Image.open(tmp_path / "check.png") as picture:
        assert picture.size == (1400, 1000)


def test_check_names_what_is_wrong(box_job, tmp_path):
    terminal, _ = console()
    box_job.write_text(box_job.read_text().replace("[[20, -10, -3], [20, 10, 3]]", "[[30, 0, 0], [31, 1, 1]]"))
    with pytest.raises(InvalidInputError, match=r"\[\[load\]\] 1: box.stl: box = "):
        check_job(box_job, tmp_path / "check.png", terminal)
    box_job.write_text('[part]\nfile = "box.stl"\n')
    with pytest.raises(InvalidInputError, match="no support"):
        check_job(box_job, tmp_path / "check.png", terminal)
    assert not (tmp_path / "check.png").exists()


def test_faces_of_a_cad_part(tmp_path, monkeypatch):
    import cadquery as cq

    monkeypatch.chdir(tmp_path)
    cq.exporters.export(cq.Workplane().circle(5).extrude(8), "pin.step")
    terminal, text = console()
    assert show_faces(Path("pin.step"), None, None, terminal) == Path("pin_faces.png")
    for words in ("3 faces", "CYLINDER", '"%CYLINDER"', '">Z"', '"<Z"', "251.33"):
        assert words in text.getvalue()
    assert (tmp_path / "pin_faces.png").is_file()


def test_schema_is_printed():
    terminal, text = console()
    show_schema("job", terminal)
    assert '"spacing_weight"' in text.getvalue()
    assert '"AddStrut"' not in text.getvalue()
    show_schema("edits", terminal)
    assert '"AddStrut"' in text.getvalue()
