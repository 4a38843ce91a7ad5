"""The examples run through the engine of the CadQuery editor and give what the direct mesh predicts."""

from pathlib import Path

import pytest
from cadquery import Workplane, cqgi
from designs import small_bar

from michell_cad.cad import mesh_truss, prepare_truss
from michell_cad.design_file import save_design
from michell_cad.knobs import Knobs, apply_knobs

ROOT = Path(__file__).parents[1]
EDIT_TRUSS = (ROOT / "examples/edit_truss.py").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def design_file(tmp_path_factory) -> str:
    path = tmp_path_factory.mktemp("example") / "design.npz"
    save_design(path, small_bar(), Knobs())
    return str(path)


def build(**constants) -> Workplane:
    """Build the script anew with some of its constants changed; it shows one Workplane."""
    result = cqgi.parse(EDIT_TRUSS).build(constants)
    if not result.success:
        raise result.exception
    (shown,) = result.results
    assert isinstance(shown.shape, Workplane)
    return shown.shape


def test_the_constants_are_the_knobs():
    parameters = cqgi.parse(EDIT_TRUSS).metadata.parameters
    assert set(parameters) == {"radius", "entasis", "family", "every", "design_file"}


@pytest.mark.parametrize(
    "constants",
    [
        {},
        {"radius": 0.16 * small_bar().truss.spacing, "entasis": 0.0},
        {"radius": 0.8, "family": "compression"},
        {"radius": 0.8, "every": 2, "entasis": 0.5},
    ],
)
def test_each_constant_changes_volume_and_solids_as_the_direct_mesh_predicts(design_file, constants):
    values = {"radius": 1.0, "entasis": 0.3, "family": "all", "every": 1} | constants
    knobs = Knobs(**values)
    mesh = mesh_truss(prepare_truss(apply_knobs(small_bar().truss, knobs), knobs))
    solids = build(design_file=design_file, **values).solids()
    assert solids.size() == mesh.bodies
    assert sum(solid.Volume() for solid in solids.vals()) == pytest.approx(mesh.volume, rel=5e-3)


def test_wrong_names_and_types_are_refused_by_the_engine():
    with pytest.raises(cqgi.InvalidParameterError):
        build(radios=1.0)
    with pytest.raises(cqgi.InvalidParameterError):
        build(radius="thick")


def test_it_runs_from_the_project_root_with_nothing_given(monkeypatch):
    monkeypatch.chdir(ROOT)
    assert build().solids().size() == 1
