"""The strength command as a user meets it: its files, messages and exit codes."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from shapes import cantilever

import michell_cad as mc
from michell_cad.delivery_strength import deliver_strength
from michell_cad.errors import InvalidInputError

FILES = {"strength.json", "stress.png", "beams.inp", "beams_abaqus.inp"}


def run(*arguments: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "michell_cad.cli", *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A folder with a coarse design of a cantilever, whose solid takes a few thousand tets."""
    folder = tmp_path_factory.mktemp("strength")
    design = mc.design(cantilever((8, 4, 4)), mc.DesignOptions(resolution=3.0))
    mc.save_design(folder / "design.npz", design, mc.Knobs(radius=3.0))
    return folder


def test_beams_of_a_design(folder):
    done = run("strength", "design.npz", "--out", "beams", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "beams: peak" in done.stdout
    assert {file.name for file in (folder / "beams").iterdir()} == FILES
    report = json.loads((folder / "beams" / "strength.json").read_text())
    assert report["solid_check"] is None
    assert report["strength"]["peak_stress_mpa"] * report["strength"]["yield_factor"] == pytest.approx(48)
    with Image.open(folder / "beams" / "stress.png") as picture:
        assert len(np.unique(np.asarray(picture).reshape(-1, 3), axis=0)) > 1000
    again = run("strength", "design.npz", "--out", "beams", cwd=folder)
    assert again.returncode == 2
    assert "--force" in again.stderr


@pytest.fixture(scope="module")
def checked(folder) -> Path:
    deliver_strength(folder, folder / "solid", solid=True, size=3.5)
    return folder / "solid"


def test_the_solid_of_a_design(folder, checked):
    assert {file.name for file in checked.iterdir()} == FILES | {"solid.inp"}
    solid = json.loads((checked / "strength.json").read_text())["solid_check"]
    assert solid["beam_over_solid_compliance"] == pytest.approx(1, abs=0.1)
    assert 0.9 < solid["solid_over_beam_peak"] < 1.8
    assert solid["peak_stress_mpa"] * solid["yield_factor"] == pytest.approx(48)
    lines = (checked / "solid.inp").read_text().split("\n")
    assert len(lines) > solid["nodes"] + solid["tets"]


@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed")
def test_calculix_solves_the_decks(checked):
    """The solid's compliance to the digits that CalculiX prints; without the balls of their nodes, beams are softer."""
    report = json.loads((checked / "strength.json").read_text())
    assert work_by_calculix(checked / "solid.inp") == pytest.approx(report["solid_check"]["compliance_nmm"], rel=1e-6)
    assert 1 < work_by_calculix(checked / "beams.inp") / report["strength"]["compliance_nmm"] < 1.8


def work_by_calculix(deck: Path) -> float:
    """f . u of the loads in a deck and the displacements that CalculiX finds."""
    subprocess.run(["ccx", deck.stem], cwd=deck.parent, check=True, capture_output=True, timeout=120)
    table = re.search(r"displacements.*\n\s*\n((?:\s+\d+.*\n)+)", deck.with_suffix(".dat").read_text()).group(1)
    rows = [[float(x) for x in row.split()] for row in table.strip().split("\n")]
    u = {int(row[0]): row[1:] for row in rows}
    loads = re.search(r"\*CLOAD.*\n((?:\d.*\n)+)", deck.read_text()).group(1).strip().split("\n")
    return sum(float(f) * u[int(node)][int(way) - 1] for node, way, f in (line.split(",") for line in loads))


@pytest.mark.parametrize(
    ("wishes", "message"),
    [
        ({"size": 2.0}, "--size is that of the tets of the solid: give --solid as well"),
        ({"solid": True, "size": 9.0}, r"the size of the tets must be above 0 and at most 1.2 of the smallest radius"),
    ],
)
def test_bad_wishes_leave_nothing(folder, wishes, message):
    before = set(folder.iterdir())
    with pytest.raises(InvalidInputError, match=message):
        deliver_strength(folder / "design.npz", folder / "bad", **wishes)
    assert set(folder.iterdir()) == before
