import json

import numpy as np
import pytest
from comparing import assert_same
from shapes import cantilever

import michell_cad.design_file as design_file
from michell_cad.design_file import load_design, save_design
from michell_cad.errors import InvalidInputError
from michell_cad.files import writing
from michell_cad.knobs import Knobs, apply_knobs
from michell_cad.parametrization import ParametrizationOptions
from michell_cad.pipeline import Design, DesignOptions, design
from michell_cad.splines import fit_splines
from michell_cad.truss_json import truss_to_dict, write_truss_json


@pytest.fixture(scope="module")
def bar() -> Design:
    bounded = ParametrizationOptions(spacing_bounds=(0.3, 3.0))
    return design(cantilever((8, 4, 4)), DesignOptions(7, layers="hug", parametrization=bounded))


def test_a_design_comes_back_as_it_was(bar, tmp_path):
    knobs = Knobs(radius=1.5, every=(2, 1, 1))
    save_design(tmp_path / "d.npz", bar, knobs)
    loaded, loaded_knobs = load_design(tmp_path / "d.npz")
    assert loaded_knobs == knobs
    assert_same(loaded, bar)
    assert [file.name for file in tmp_path.iterdir()] == ["d.npz"]


def test_a_file_cut_short_or_foreign_is_refused(bar, tmp_path):
    path = tmp_path / "d.npz"
    with pytest.raises(InvalidInputError, match="no design file"):
        load_design(path)
    save_design(path, bar, Knobs())
    whole = path.read_bytes()
    for cut in (0, 10, len(whole) // 2, len(whole) - 10):
        path.write_bytes(whole[:cut])
        with pytest.raises(InvalidInputError, match="not a complete design file"):
            load_design(path)
    np.savez(path, vertices=np.zeros(3))
    with pytest.raises(InvalidInputError, match="not a complete design file"):
        load_design(path)


def test_a_newer_version_is_refused(bar, tmp_path, monkeypatch):
    monkeypatch.setattr(design_file, "VERSION", 99)
    save_design(tmp_path / "d.npz", bar, Knobs())
    monkeypatch.undo()
    with pytest.raises(InvalidInputError, match="version 99"):
        load_design(tmp_path / "d.npz")


def test_a_write_that_fails_leaves_the_old_file(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")

    def fail() -> None:
        with writing(path) as partial:
            partial.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert path.read_text() == "old"
    assert [file.name for file in tmp_path.iterdir()] == ["a.txt"]


def test_layout_file_holds_every_curve_with_its_spline(bar, tmp_path):
    sized = apply_knobs(bar.truss, Knobs(entasis=0.2))
    splines = fit_splines(sized.truss)
    write_truss_json(tmp_path / "truss.json", sized, splines, Knobs(entasis=0.2))
    layout = json.loads((tmp_path / "truss.json").read_text())
    assert layout == truss_to_dict(sized, splines, Knobs(entasis=0.2))
    assert (layout["format"], layout["version"], layout["units"]) == ("michell_cad.truss", 1, {"length": "mm"})
    assert len(layout["nodes"]) == len(sized.truss.nodes)
    assert sum(len(curves) for curves in layout["families"].values()) == len(layout["curves"])
    for curve in layout["curves"]:
        spline = curve["spline"]
        assert len(spline["knots"]) == len(spline["control_points"]) + spline["degree"] + 1
        first = layout["nodes"][curve["nodes"][0]]["position"]
        np.testing.assert_allclose(spline["control_points"][0], first, atol=1e-5)
        for member in curve["members"]:
            assert set(layout["members"][member]["nodes"]) <= set(curve["nodes"])
            assert min(layout["members"][member]["radii"]) > 0
