"""FreeCAD, with an older kernel, reads the STEP files: the same solids, volumes and names."""

import json
import shutil
import subprocess

import cadquery as cq
import pytest

from michell_cad.cad import kernel
from michell_cad.cad.solid import build_solid
from michell_cad.cad.step import export_step
from michell_cad.knobs import Knobs
from tests.cad.layouts import grid_truss, sized

# FreeCAD's command line runs a script that raises a second time, and says that all is well.
SCRIPT = """
import json, os, traceback
try:
    import FreeCAD, Import, Part
    found = {}
    for name in ("solid", "assembly", "swept"):
        shape = Part.Shape()
        shape.read(os.path.join(FOLDER, name + ".step"))
        found[name] = [len(shape.Solids), shape.isValid(), shape.Volume]
        shape.exportBrep(os.path.join(FOLDER, name + ".brep"))
    document = FreeCAD.newDocument("truss")
    Import.insert(os.path.join(FOLDER, "assembly.step"), "truss", useLinkGroup=False)
    found["parts"] = [thing.Label for thing in document.Objects if thing.TypeId == "Part::Feature"]
    found["groups"] = [thing.Label for thing in document.Objects if thing.TypeId == "App::Part"]
    with open(os.path.join(FOLDER, "found.json"), "w") as file:
        json.dump(found, file)
except BaseException:
    traceback.print_exc()
    os._exit(1)
os._exit(0)
"""


def test_freecad_reads_both_forms_and_other_profiles(tmp_path, monkeypatch) -> None:
    program = shutil.which("freecadcmd") or shutil.which("FreeCADCmd")
    if program is None:
        pytest.skip("FreeCAD is not installed (freecadcmd)")
    solid = build_solid(sized(grid_truss((3, 3, 2), warp=0.1), 1.0, 0.3), Knobs())
    for form in ("solid", "assembly"):
        export_step(solid, tmp_path / f"{form}.step", form=form)
    hulls = Knobs(profile="hexagon", profile_aspect=1.5, node_form="hull")
    swept = build_solid(sized(grid_truss((3, 3, 2), warp=0.1), 1.0, 0.3), hulls)
    export_step(swept, tmp_path / "swept.step")
    (tmp_path / "read.py").write_text(f"FOLDER = {str(tmp_path)!r}\n" + SCRIPT)
    monkeypatch.setenv("HOME", str(tmp_path))
    command = [program, str(tmp_path / "read.py")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    found = json.loads((tmp_path / "found.json").read_text())
    expected = {
        "solid": (1, solid.report.volume_mm3),
        "assembly": (len(solid.assembly), sum(kernel.volume(part.solid) for part in solid.assembly)),
        "swept": (len(swept.assembly), sum(kernel.volume(part.solid) for part in swept.assembly)),
    }
    for name, (count, volume) in expected.items():
        assert found[name][:2] == [count, True]
        # Its own figure comes from a coarse integration, which misses the volume of curved tubes by 2e-4.
        assert found[name][2] == pytest.approx(volume, rel=3e-4)
        shape = cq.Shape.importBrep(str(tmp_path / f"{name}.brep"))
        assert sum(kernel.volume(one.wrapped) for one in shape.Solids()) == pytest.approx(volume, rel=1e-5)
    assert sorted(found["parts"]) == sorted(part.name for part in solid.assembly)
    assert {part.group for part in solid.assembly} < set(found["groups"])
