"""A truss sized for its loads and braced is one valid solid like any other: checked, written, and read by FreeCAD."""

import json
import shutil
import subprocess

import numpy as np
import pytest
from shapes import cantilever

from michell_cad.building import buildable
from michell_cad.cad import kernel
from michell_cad.cad.prepare import prepare_truss
from michell_cad.cad.solid import TrussSolid, build_solid
from michell_cad.cad.step import export_step
from michell_cad.elasticity import solve_elasticity
from michell_cad.knobs import Knobs, entasis_weights
from michell_cad.parametrization import Parametrization
from michell_cad.strength import StrengthenOptions, strengthen
from michell_cad.strength.comparison import regular_grid
from michell_cad.truss import SizedTruss

KNOBS = Knobs(node_ratio=1.3)

SCRIPT = """
import json, os, traceback
try:
    import FreeCAD, Import, Part
    shape = Part.Shape()
    shape.read(os.path.join(FOLDER, "solid.step"))
    document = FreeCAD.newDocument("truss")
    Import.insert(os.path.join(FOLDER, "assembly.step"), "truss", useLinkGroup=False)
    labels = [thing.Label for thing in document.Objects if thing.TypeId == "Part::Feature"]
    with open(os.path.join(FOLDER, "found.json"), "w") as file:
        json.dump([len(shape.Solids), shape.isValid(), shape.Volume, labels], file)
except BaseException:
    traceback.print_exc()
    os._exit(1)
os._exit(0)
"""


@pytest.fixture(scope="module")
def braced() -> tuple[SizedTruss, int, float, TrussSolid]:
    """A grid along the axes of a bar in bending, which needs its braces, sized, thicker in the middle of its curves."""
    problem = cantilever((8, 4, 4))
    mesh = problem.mesh
    truss = regular_grid(mesh, (4, 2, 2))
    sized = SizedTruss(truss, np.ones((len(truss.members), 3)))
    options = StrengthenOptions(straight=True, size_by="member", braces=True, volume_fraction=0.06)
    part = (problem, solve_elasticity(problem), Parametrization(mesh, mesh.vertices))
    sized, report, _ = strengthen(*part, sized, options, buildable(KNOBS))
    assert report is not None
    swollen = SizedTruss(sized.truss, sized.radii * (1 + 0.3 * entasis_weights(sized.truss)))
    solid = build_solid(swollen, KNOBS)
    assert isinstance(solid, TrussSolid)
    return sized, report.braces, report.failure_gain, solid


def test_what_was_sized_is_what_is_built(braced):
    sized, braces, gain, _ = braced
    assert braces > 4
    assert gain > 2
    prepared = prepare_truss(sized, KNOBS)
    assert len(prepared.sized.truss.members) == len(sized.truss.members)
    assert prepared.changes.merged_nodes == 0
    assert prepared.changes.rerouted_members == 0


def test_one_valid_solid_with_all_its_labels(braced):
    sized, braces, _, solid = braced
    assert solid.report.solids == 1
    assert solid.report.valid
    assert solid.report.genus == solid.report.expected_genus
    assert solid.report.volume_mm3 == pytest.approx(solid.report.mesh_volume_mm3, rel=1e-3)
    names = {curve.name for curve in solid.sized.truss.curves}
    assert names == {curve.name for curve in sized.truss.curves}
    assert sum(name.startswith("brace") for name in names) == braces


def test_freecad_opens_it(braced, tmp_path, monkeypatch):
    program = shutil.which("freecadcmd") or shutil.which("FreeCADCmd")
    if program is None:
        pytest.skip("FreeCAD is not installed (freecadcmd)")
    _, braces, _, solid = braced
    for form in ("solid", "assembly"):
        export_step(solid, tmp_path / f"{form}.step", form=form)
    (tmp_path / "read.py").write_text(f"FOLDER = {str(tmp_path)!r}\n" + SCRIPT)
    monkeypatch.setenv("HOME", str(tmp_path))
    command = [program, str(tmp_path / "read.py")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    solids, valid, volume, labels = json.loads((tmp_path / "found.json").read_text())
    assert (solids, valid) == (1, True)
    # FreeCAD's own rule for volumes is plain.
    assert volume == pytest.approx(kernel.volume(solid.solids[0]), rel=2e-3)
    assert len(labels) == len(solid.assembly)
    assert sum("brace" in label for label in labels) >= braces
