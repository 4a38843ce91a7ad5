"""The bracket of the examples in real FreeCAD: by picked faces of its STEP file, through every knob, back from disk."""

import json
from pathlib import Path

import cadquery as cq
import pytest
from hosts import ROOT, freecad_home, run_freecad

from michell_cad.building import build_united, size_finished
from michell_cad.cad import kernel
from michell_cad.design_file import load_design
from michell_cad.edits import NO_EDITS, change_knobs
from michell_cad.knobs import Knobs
from michell_cad.stage_cache import FOLDER_VARIABLE

HERE = Path(__file__).parent

SAME = 1e-4
"""Largest relative difference between volumes here and in FreeCAD."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("bracket")


@pytest.fixture(scope="module")
def walk(folder) -> dict:
    values = {"WALK_FOLDER": str(folder), "BRACKET": str(ROOT / "examples" / "bracket.step")}
    values[FOLDER_VARIABLE] = str(folder / "cache")
    done = run_freecad(HERE / "freecad_bracket.py", freecad_home(folder), **values)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
    return json.loads((folder / "bracket.json").read_text())


def test_the_holes_are_picked(walk):
    assert len(walk["picked"]["supports"]) == 4
    assert len(walk["picked"]["loads"]) == 1


def test_cancel_leaves_the_document_as_it_was(walk):
    cancelled = walk["cancelled"]
    assert cancelled["kind"] == "cancelled"
    assert cancelled["before"] == cancelled["after"] == walk["before"]
    assert len(walk["before"]["objects"]) == 1
    assert walk["before"]["undo"] == 0


def test_cancel_leaves_an_earlier_truss_as_it_was(walk):
    cancelled = walk["cancelled_again"]
    assert cancelled["kind"] == "cancelled"
    assert cancelled["before"] == cancelled["after"]
    assert cancelled["state"]["knobs"] == walk["turns"][-1]["knobs"]
    assert cancelled["state"]["volume"] == walk["turns"][-1]["volume"]


@pytest.mark.parametrize("number", range(6))
def test_every_turn_of_knobs_gives_the_packages_own_volume(folder, walk, number):
    """The shape is measured here: FreeCAD's own `Volume` is the plain rule of an older kernel, see `test_freecad`."""
    state = [walk["made"], *walk["turns"], walk["reopened"]["turned"]][number]
    design, knobs = load_design(folder / "design.npz")
    structure = NO_EDITS.replay(design, change_knobs(knobs, state["knobs"]))
    built = build_united(structure, size_finished(structure), lambda stage, fraction: None)
    # A host shows the parts of swept members, which overlap; the report's volume is that of their union.
    ours = kernel.volume(kernel.compound(built.solids)) if structure.knobs.swept else built.report.volume_mm3
    shown = cq.Shape.importBrep(str(folder / state["file"]))
    assert state["valid"]
    assert kernel.volume(shown.wrapped) == pytest.approx(ours, rel=SAME)
    assert state["told_volume"] == pytest.approx(built.report.volume_mm3, rel=SAME)


def test_the_turns_touch_every_knob_and_change_the_truss(walk):
    made, turns = walk["made"], walk["turns"]
    assert set(made["knobs"]) == set(Knobs.model_fields)
    for knob, value in made["knobs"].items():
        assert any(state["knobs"][knob] != value for state in turns), f"{knob} was not turned"
    assert len({round(state["volume"]) for state in (made, *turns)}) == len(turns) + 1


def test_targets_are_met(walk):
    by_fraction, by_mass = walk["turns"][2:4]
    assert (by_fraction["knobs"]["radius"], by_mass["knobs"]["volume_fraction"]) == (None, None)
    assert by_fraction["told_volume"] == pytest.approx(0.08 * 95166.7, rel=0.01)  # of the solid bracket, mm^3
    assert by_mass["told_mass"] == pytest.approx(6.0, rel=0.01)


def test_families_colour_every_face(walk):
    made, two = walk["made"], walk["turns"][1]
    assert made["coloured"] == made["faces"]
    assert {"tension", "compression", "third", "node"} <= set(made["families"])
    assert "third" not in two["families"]


def test_the_document_opens_as_it_was_saved(walk):
    saved, reopened = walk["turns"][-1], walk["reopened"]["as_saved"]
    assert reopened["knobs"] == saved["knobs"]
    assert reopened["volume"] == pytest.approx(saved["volume"], rel=1e-9)
    assert reopened["state"] == ["Up-to-date"]
