"""How far solids run from the design, against distances in closed form."""

import dataclasses

import numpy as np
import pytest

from michell_cad.cad.fidelity import curve_deviation, design_gaps
from michell_cad.cad.prepare import prepare_truss
from michell_cad.cad.solid import build_solid
from michell_cad.knobs import Knobs
from michell_cad.truss import SizedTruss
from tests.cad.layouts import grid_truss, sized, star

AXES = np.concatenate([np.eye(3), -np.eye(3)])


def test_straight_members_lie_on_their_curves() -> None:
    prepared = prepare_truss(star(AXES), Knobs())
    assert curve_deviation(prepared).max() < 1e-9
    assert design_gaps(star(AXES), prepared).max() < 1e-9


def test_curves_are_followed() -> None:
    solid = build_solid(sized(grid_truss((4, 3, 3), warp=0.12), 0.8), Knobs())
    report = solid.report
    assert report.curve_deviation_mm == curve_deviation(solid.prepared).max() < 0.15 * 0.8
    assert (report.members_off_curve, report.straightened_members) == (0, 0)
    assert report.design_gap_mm < 0.2 * 0.8


def test_a_displaced_curve_is_as_far_as_it_was_displaced() -> None:
    prepared = prepare_truss(star(AXES), Knobs())
    points = prepared.design.points + [0.3, 0, 0]
    moved = dataclasses.replace(prepared, design=dataclasses.replace(prepared.design, points=points))
    along_x = np.abs(prepared.directions[::2, 0]) > 0.5
    assert curve_deviation(moved) == pytest.approx(0.3, abs=1e-9)
    truss = dataclasses.replace(star(AXES).truss, nodes=star(AXES).truss.nodes + [0.3, 0, 0])
    gaps = design_gaps(SizedTruss(truss, star(AXES).radii), prepared)
    assert gaps[~along_x] == pytest.approx(0.3, abs=1e-9)


def test_merged_members_are_told_with_their_distance() -> None:
    """Two members at 3 degrees become one: their ends, 2 mm apart, are one node."""
    half = np.radians(1.5)
    pair = [[np.cos(half), np.sin(half), 0], [np.cos(half), -np.sin(half), 0], [-1, 0, 0]]
    report = build_solid(star(pair, length=np.array([10.0, 8.0, 8.0]), radius=0.5), Knobs()).report
    assert report.merged_members == 1
    assert report.design_gap_mm == pytest.approx(1.0, abs=0.1)
    assert any("1.0" in text and "tension" in text for text in report.messages if "nodes were merged or" in text)
