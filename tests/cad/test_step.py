"""STEP files: read again by another process, with names and colours, whole or not at all."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from michell_cad.cad import kernel, kernel_files, step_forecast
from michell_cad.cad.solid import TrussSolid, build_solid
from michell_cad.cad.step import export_step, forecast_step, read_step_summary
from michell_cad.cad.step_text import StepText
from michell_cad.errors import GeometryKernelError, InvalidInputError
from michell_cad.knobs import Knobs
from michell_cad.palette import COLOURS
from tests.cad.layouts import grid_truss, sized, sparse_reference_truss, star

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


def read_as_another_program(path) -> dict:
    reader = Path(__file__).with_name("read_step.py")
    done = subprocess.run([sys.executable, str(reader), str(path)], capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def in_bytes(colour) -> list[int]:
    return [round(255 * value) for value in colour]


@pytest.mark.parametrize("schema", ["AP214", "AP242"])
def test_names_and_colours_of_faces_survive(solid, tmp_path, schema) -> None:
    export_step(solid, tmp_path / "truss.step", schema=schema)
    found = read_as_another_program(tmp_path / "truss.step")
    assert [(part["name"], part["solids"], part["valid"]) for part in found["parts"]] == [("truss", 1, True)]
    curves = solid.prepared.sized.truss.curves
    expected = sorted(
        [curves[c].name, in_bytes(COLOURS[curves[c].family])]
        if c >= 0
        else [f"node {owner}", in_bytes(COLOURS["node"])]
        for c, owner in zip(solid.face_curve.tolist(), solid.face_owner.tolist(), strict=True)
    )
    assert sorted([name, colour] for name, colour, _ in found["faces"]) == expected
    assert len(set(COLOURS.values())) == len(COLOURS)


@pytest.fixture(scope="module")
def assembly(solid, tmp_path_factory) -> dict:
    path = tmp_path_factory.mktemp("assembly") / "truss.step"
    export_step(solid, path, form="assembly")
    return read_as_another_program(path) | {"text": path.read_text()}


def test_an_assembly_has_a_valid_solid_for_each_curve_and_node(solid, assembly) -> None:
    parts, curves = assembly["parts"], solid.prepared.sized.truss.curves
    expected = [(["truss", c.family], c.name, in_bytes(COLOURS[c.family])) for c in curves]
    nodes = np.unique(solid.prepared.sized.truss.members).tolist()
    expected += [(["truss", "nodes"], f"node {i}", in_bytes(COLOURS["node"])) for i in nodes]
    assert sorted((p["path"], p["name"], p["colour"]) for p in parts) == sorted(expected)
    assert all(part["valid"] and part["solids"] == 1 for part in parts)
    volume = {part.name: kernel.volume(part.solid) for part in solid.assembly}
    for part in parts:
        assert part["volume"] == pytest.approx(volume[part["name"]], rel=1e-4)


def test_every_family_has_a_layer(solid, step, assembly) -> None:
    families = {curve.family for curve in solid.prepared.sized.truss.curves} | {"nodes"}
    for text in (step.read_text(), assembly["text"]):
        layers = re.findall(r"PRESENTATION_LAYER_ASSIGNMENT\('(\w+)','visible',\(([^)]*)\)", text)
        assert {name for name, _ in layers} == families
        assert all(items.count("#") for _, items in layers)
    faces = [
        items.count("#") for name, items in re.findall(r"ASSIGNMENT\('(\w+)','visible',\(([^)]*)\)", step.read_text())
    ]
    assert sum(faces) == solid.report.faces


TRUSSES = {
    "grid": lambda: build_solid(sized(grid_truss((3, 3, 3), warp=0.08), 1.0, 0.3), Knobs()),
    "star": lambda: build_solid(star([[1, 0.1, 0.3], [0.2, 1, 0.1], [-0.3, 0.2, 1]]), Knobs(fillet_ratio=0.0)),
    "beam": lambda: build_solid(sized(sparse_reference_truss("cantilever_beam_beta0.1_rho16", 3), 0.8, 0.2), Knobs()),
}


@pytest.mark.parametrize("name", TRUSSES)
def test_the_forecast_is_right(name, tmp_path) -> None:
    truss = TRUSSES[name]()
    forms = [("solid", False), ("solid", True), ("assembly", False)] if name != "beam" else [("solid", False)]
    for form, pcurves in forms:
        export_step(truss, tmp_path / "truss.step", form, pcurves=pcurves)
        size = (tmp_path / "truss.step").stat().st_size
        assert forecast_step(truss, form, pcurves) == pytest.approx(size, rel=0.15 if name == "star" else 0.05), form


def test_mean_digits_by_counting() -> None:
    for n in (1, 9, 10, 123, 1000):
        assert step_forecast._mean_digits(n) == pytest.approx(np.mean([len(str(k + 1)) for k in range(n)]))


def test_a_file_larger_than_the_disk_is_refused(solid, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("shutil.disk_usage", lambda _: type("Usage", (), {"free": 1000}))
    with pytest.raises(InvalidInputError, match=r"would take about .* MB"):
        export_step(solid, tmp_path / "truss.step")
    assert not list(tmp_path.iterdir())


def test_pcurves_are_an_option(solid, step, tmp_path) -> None:
    export_step(solid, tmp_path / "truss.step", pcurves=True)
    assert "PCURVE(" in (tmp_path / "truss.step").read_text()
    found = read_step_summary(tmp_path / "truss.step")
    assert (found.solids, found.valid, found.faces) == (1, True, solid.report.faces)
    assert found.volume_mm3 == pytest.approx(read_step_summary(step).volume_mm3, rel=2e-5)


def test_the_header_says_what_it_is(step) -> None:
    header = step.read_text()[:600]
    assert "FILE_NAME('truss.step'" in header
    assert "'michell_cad'" in header


def test_no_pcurves_and_small(solid, step) -> None:
    assert "PCURVE" not in step.read_text()
    assert step.stat().st_size < 13_000 * solid.report.members


def test_nothing_is_printed(solid, tmp_path, capfd) -> None:
    export_step(solid, tmp_path / "quiet.step", schema="AP242")
    read_step_summary(tmp_path / "quiet.step")
    assert capfd.readouterr() == ("", "")
    assert "AP242" in (tmp_path / "quiet.step").read_text()[:2000]


@pytest.mark.parametrize(("writer", "form"), [(kernel_files.StepDocument, "assembly"), (StepText, "solid")])
def test_a_failed_file_is_not_left_behind(solid, tmp_path, monkeypatch, writer, form) -> None:
    path = tmp_path / "truss.step"
    path.write_text("old")

    def fail(*_args) -> None:
        raise GeometryKernelError("the writer fails")

    monkeypatch.setattr(writer, "write" if form == "assembly" else "lines", fail)
    with pytest.raises(GeometryKernelError):
        export_step(solid, path, form)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["truss.step"]


def test_bad_input(solid, tmp_path) -> None:
    with pytest.raises(InvalidInputError, match="AP214"):
        export_step(solid, tmp_path / "truss.step", schema="AP999")
    with pytest.raises(InvalidInputError, match="solid, assembly"):
        export_step(solid, tmp_path / "truss.step", form="parts")
    with pytest.raises(InvalidInputError, match=r"\.step or \.stp, found \.stl"):
        export_step(solid, tmp_path / "truss.stl")
    assert not list(tmp_path.iterdir())
    (tmp_path / "no.step").write_text("this is no STEP file")
    with pytest.raises(InvalidInputError, match=r"no\.step"):
        read_step_summary(tmp_path / "no.step")


def test_settings_of_the_process_are_restored(solid, tmp_path) -> None:
    name = "write.surfacecurve.mode"
    before = kernel_files.Interface_Static.IVal_s(name)
    export_step(solid, tmp_path / "truss.step", pcurves=not before)
    assert kernel_files.Interface_Static.IVal_s(name) == before


def test_straight_members_are_cylinders_in_the_file(tmp_path) -> None:
    export_step(build_solid(star(np.eye(3)), Knobs()), tmp_path / "star.step")
    text = (tmp_path / "star.step").read_text()
    assert text.count("CYLINDRICAL_SURFACE(") == 3
    assert text.count("TOROIDAL_SURFACE(") == 6
    assert text.count("SPHERICAL_SURFACE(") == 4
    assert "B_SPLINE_SURFACE" not in text
