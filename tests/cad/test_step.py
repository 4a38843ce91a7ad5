"""STEP files: read again by another process, with names and colours, whole or not at all."""

import json
import re
import subprocess
import sys

import numpy as np
import pytest

from michell_cad.cad import kernel
from michell_cad.cad.solid import TrussSolid, build_solid
from michell_cad.cad.step import COLOURS, export_step, read_step_summary
from michell_cad.errors import GeometryKernelError, InvalidInputError
from michell_cad.knobs import Knobs
from tests.cad.layouts import grid_truss, sized, star

READ = """
import json, sys
from michell_cad.cad.step import read_step_summary
found = read_step_summary(sys.argv[1])
print(json.dumps([found.solids, found.valid, found.volume_mm3, found.faces]))
"""


@pytest.fixture(scope="module")
def solid() -> TrussSolid:
    return build_solid(sized(grid_truss((3, 3, 2), warp=0.2, missing=0.1), 1.2, 0.3), Knobs())


@pytest.fixture(scope="module")
def step(solid, tmp_path_factory):
    path = tmp_path_factory.mktemp("step") / "truss.step"
    export_step(solid, path)
    return path


def test_read_by_another_process(solid, step) -> None:
    done = subprocess.run([sys.executable, "-c", READ, str(step)], capture_output=True, text=True, check=True)
    solids, valid, volume, faces = json.loads(done.stdout)
    assert (solids, valid, faces) == (1, True, solid.report.faces)
    assert volume == pytest.approx(solid.report.volume_mm3, rel=2e-5)


def test_names_and_colours(solid, step) -> None:
    text = step.read_text()
    names = re.findall(r"ADVANCED_FACE\('([^']*)'", text)
    curves = [curve.name for curve in solid.prepared.sized.truss.curves]
    assert set(curves) < set(names)
    assert sum(name.startswith("node ") for name in names) == solid.report.nodes
    families = {curve.family for curve in solid.prepared.sized.truss.curves}
    assert text.count("COLOUR_RGB(") >= len(families)
    assert len(set(COLOURS.values())) == len(COLOURS)


def test_no_pcurves_and_small(solid, step) -> None:
    assert "PCURVE" not in step.read_text()
    assert step.stat().st_size < 20_000 * solid.report.members


def test_nothing_is_printed(solid, tmp_path, capfd) -> None:
    export_step(solid, tmp_path / "quiet.step", schema="AP242")
    read_step_summary(tmp_path / "quiet.step")
    assert capfd.readouterr() == ("", "")
    assert "AP242" in (tmp_path / "quiet.step").read_text()[:2000]


def test_a_failed_file_is_not_left_behind(solid, tmp_path, monkeypatch) -> None:
    path = tmp_path / "truss.step"
    path.write_text("old")

    def fail(partial, *_args) -> None:
        partial.write_text("half")
        raise GeometryKernelError("the disk is full")

    monkeypatch.setattr(kernel, "write_step_file", fail)
    with pytest.raises(GeometryKernelError):
        export_step(solid, path)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["truss.step"]


def test_bad_input(solid, tmp_path) -> None:
    with pytest.raises(InvalidInputError, match="AP214"):
        export_step(solid, tmp_path / "truss.step", schema="AP999")
    (tmp_path / "no.step").write_text("this is no STEP file")
    with pytest.raises(InvalidInputError, match=r"no\.step"):
        read_step_summary(tmp_path / "no.step")


def test_settings_of_the_process_are_restored(solid, tmp_path) -> None:
    name = "write.surfacecurve.mode"
    before = kernel.Interface_Static.IVal_s(name)
    export_step(solid, tmp_path / "truss.step")
    assert kernel.Interface_Static.IVal_s(name) == before


def test_straight_members_are_cylinders_in_the_file(tmp_path) -> None:
    export_step(build_solid(star(np.eye(3)), Knobs()), tmp_path / "star.step")
    text = (tmp_path / "star.step").read_text()
    assert text.count("CYLINDRICAL_SURFACE(") == 3
    assert text.count("TOROIDAL_SURFACE(") == 6
    assert text.count("SPHERICAL_SURFACE(") == 4
    assert "B_SPLINE_SURFACE" not in text
