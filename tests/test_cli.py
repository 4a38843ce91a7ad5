"""The command line as a user meets it: in a process of its own, by its files, messages and exit codes."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import trimesh
from shapes import box_mesh

FILES = {"truss.step", "truss.stl", "truss.glb", "truss.json", "design.npz", "preview.png", "report.json"}

JOB = """
[part]
file = "bar.npz"
[options]
resolution = 6
[output]
formats = ["step", "stl", "glb"]
[knobs]
entasis = 0.2
"""


def run(*arguments: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "michell_cad.cli", *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A folder with a small problem in metres: a bar clamped at one end, pulled down at the other."""
    folder = tmp_path_factory.mktemp("job")
    mesh = box_mesh((8, 4, 4), (0.08, 0.04, 0.04))
    fixed = mesh.vertices[:, 0] == 0
    force = np.where(mesh.vertices[:, :1] == 0.08, [[0.0, 0.0, -2.0]], 0.0)
    np.savez(folder / "bar.npz", vertices=mesh.vertices, tets=mesh.tets, fixed=fixed, force=force)
    (folder / "job.toml").write_text(JOB)
    return folder


@pytest.fixture(scope="module")
def results(folder) -> Path:
    done = run("design", "job.toml", "--out", "results", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "valid solid" in done.stdout
    return folder / "results"


def test_design_writes_every_file_and_nothing_else(folder, results):
    assert {file.name for file in results.iterdir()} == FILES
    assert {file.name for file in folder.iterdir()} == {"bar.npz", "job.toml", "results"}
    assert (results / "preview.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_report_has_the_stated_blocks(results):
    report = json.loads((results / "report.json").read_text())
    stages = {"mesh", "elasticity", "frames", "parametrization", "isocurves", "truss", "solid", "export"}
    assert set(report["wall_s"]) == set(report["cpu_s"]) == stages | {"sizing", "strength"}
    assert report["mesh"]["tets"] == 8 * 4 * 4 * 6
    assert report["parametrization"]["inverted_tets"] == 0
    assert report["truss"]["interior_degree_6"] == 1.0
    assert set(report["truss"]["valence"]) == {"before", "after"}
    assert set(report["alignment"]) == {
        "frame_shear_residual",
        "curve_shear_residual",
        "uncarried_stress",
        "spacing_p99",
        "misalignment_deg",
        "misalignment_distinct_deg",
        "angle_deg",
    }
    solid, summary, strength = report["solid"], report["summary"], report["strength"]
    assert strength["mass_g"] == pytest.approx(summary["mass_g"])
    assert strength["mass_share"] == pytest.approx(summary["volume_fraction"])
    assert strength["compliance_over_solid"] > 1
    assert 0 < strength["pin_joint_residual"] < 1
    assert strength["peak_stress"]["case"] == "main"
    assert solid["valid"] is True
    assert solid["solids"] == report["truss"]["components"] == 1
    assert solid["genus"] == solid["expected_genus"]
    assert solid["volume_mm3"] == pytest.approx(solid["mesh_volume_mm3"], rel=0.005)
    assert set(report["files"]) == {"truss.step", "truss.stl", "truss.glb"}
    for name, entry in report["files"].items():
        assert entry["bytes"] == (results / name).stat().st_size
    step = report["files"]["truss.step"]
    assert step["forecast_bytes"] == pytest.approx(step["bytes"], rel=0.15)
    assert summary["volume_fraction"] == pytest.approx(solid["volume_mm3"] / 128000, rel=1e-6)
    assert summary["mass_g"] == pytest.approx(solid["volume_mm3"] * 1.04e-3, rel=0.02)
    assert report["solver_unit_s"] > 0


def test_step_read_again_is_one_valid_solid_of_the_volume_of_the_stl(results):
    code = (
        "import sys, cadquery as cq, trimesh\n"
        "shape = cq.importers.importStep(sys.argv[1]).val()\n"
        "mesh = trimesh.load(sys.argv[2])\n"
        "print(len(shape.Solids()), shape.isValid(), shape.Volume() / mesh.volume, mesh.is_watertight)\n"
    )
    paths = [str(results / "truss.step"), str(results / "truss.stl")]
    command = [sys.executable, "-W", "ignore", "-c", code, *paths]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    solids, valid, ratio, watertight = done.stdout.split()
    assert (solids, valid, watertight) == ("1", "True", "True")
    assert float(ratio) == pytest.approx(1, abs=0.005)


def test_export_writes_what_the_names_say(folder, results):
    names = ["parts.stp", "lattice.beams.3mf", "print.3mf"]
    done = run("export", "results/design.npz", *names, "--step-form", "assembly", "--step-schema", "AP242", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "parts.stp will take about" in done.stdout
    assert "AP242" in (folder / "parts.stp").read_text()[:1000]
    assert all((folder / name).read_bytes()[:2] == b"PK" for name in names[1:])
    done = run("export", "results/design.npz", *names, cwd=folder)
    assert done.returncode == 2
    assert "parts.stp exists" in done.stderr
    for name in names:
        (folder / name).unlink()


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["a.stl", "a.iges"], "a.iges: no format has the extension .iges"),
        (["a.stl", "no/a.glb"], "no/a.glb cannot be written"),
        (["a.stl", "a.stl"], "named twice"),
        (["a.step", "--step-form", "parts"], "solid, assembly"),
        (["a.step", "--step-schema", "AP203"], "AP214, AP242"),
    ],
)
def test_a_bad_export_gets_one_message_and_leaves_nothing(folder, results, names, message):
    before = set(folder.iterdir())
    done = run("export", "results/design.npz", *names, cwd=folder)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert set(folder.iterdir()) == before


def test_layout_and_design_belong_together(results):
    from michell_cad.design_file import load_design
    from michell_cad.knobs import apply_knobs

    layout = json.loads((results / "truss.json").read_text())
    design, knobs = load_design(results / "design.npz")
    sized = apply_knobs(design.truss, knobs)
    assert knobs.entasis == 0.2
    assert {c["name"] for c in layout["curves"]} <= {c.name for c in sized.truss.curves}
    assert layout["spacing"] == pytest.approx(design.truss.spacing, abs=1e-5)


def test_an_existing_folder_is_refused_and_force_keeps_what_else_is_there(folder, results):
    before = (results / "report.json").read_bytes()
    done = run("design", "job.toml", "--out", "results", cwd=folder)
    assert done.returncode == 2
    assert "--force" in done.stderr
    assert (results / "report.json").read_bytes() == before


@pytest.mark.parametrize(
    ("job", "message"),
    [
        (JOB.replace("bar.npz", "car.npz"), "car.npz"),
        (JOB.replace("resolution", "resolutoin"), "resolution"),
        (JOB.replace("= 6", "= 90"), "mesh.size"),
        (JOB + "radius = 9.0\n", "radius"),
        (JOB + "every = 50\noffset = 25\n", "no curve is left"),
        (JOB.replace("[part]", "[part"), "line"),
        (JOB.replace('"glb"', '"iges"'), "'glb' or 'brep', found 'iges'"),
    ],
)
def test_bad_jobs_get_one_message_and_leave_nothing(folder, job, message):
    (folder / "bad.toml").write_text(job)
    done = run("design", "bad.toml", "--out", "bad", cwd=folder)
    (folder / "bad.toml").unlink()
    assert done.returncode in (1, 2)
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert not (folder / "bad").exists()
    assert not [file for file in folder.iterdir() if file.name.startswith(".")]


def test_an_interruption_leaves_nothing(folder):
    process = subprocess.Popen(
        [sys.executable, "-m", "michell_cad.cli", "design", "job.toml", "--out", "stopped"],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    time.sleep(1.5)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 1
    assert "interrupted" in errors
    assert "Traceback" not in errors
    assert not (folder / "stopped").exists()


def test_a_folder_that_cannot_be_written_is_refused(folder):
    if os.geteuid() == 0:
        place = Path("/proc/no-such-folder/out")
    else:
        place = Path("/truss-out")
    done = run("design", "job.toml", "--out", place, cwd=folder)
    assert done.returncode == 2
    assert "cannot be written" in done.stderr


def test_help_schema_and_wrong_words(folder):
    start = time.perf_counter()
    assert run("--help", cwd=folder).returncode == 0
    assert time.perf_counter() - start < 10  # a hang would be longer; the speed itself is a benchmark's matter
    schema = json.loads(run("schema", cwd=folder).stdout)
    assert "part" in schema["required"]
    assert run("draw", cwd=folder).returncode == 2
    assert run("design", "job.toml", cwd=folder).returncode == 2


def test_compare_puts_rivals_side_by_side(folder):
    done = run("compare", "job.toml", "--cells", "2", "--voxels", "200", "--out", "rivals", cwd=folder)
    assert done.returncode == 0, done.stderr
    names = ("this truss", "grid 2x1x1 braced", "hexes", "ground s. 2x1x1", "voxels, bound", "voxels, p = 3")
    for name in (*names, "rms frame shear"):
        assert name in done.stdout
    assert "best" not in done.stdout
    rows = json.loads((folder / "rivals" / "comparison.json").read_text())["rows"]
    assert {row["name"] for row in rows} >= set(names)
    assert rows[-1]["yield_factor"] is None
    densities = np.load(folder / "rivals" / "voxels.npz")
    full = trimesh.load(folder / "rivals" / "voxels.stl")
    assert full.volume == pytest.approx((densities["density"] > 0.5).sum() * densities["edges"].prod(), rel=1e-5)
    again = run("compare", "job.toml", "--out", "rivals", cwd=folder)
    assert again.returncode == 2
    assert "--out rivals exists" in again.stderr
    bad = run("compare", "job.toml", "--cells", "2,many", cwd=folder)
    assert bad.returncode == 2
    assert "expected whole numbers from 1 to 40" in bad.stderr
