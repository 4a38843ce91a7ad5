"""Layouts: what is done at a node is what was asked for, and keeping it after a change equals doing it anew."""

import dataclasses

import numpy as np
import pytest

from michell_cad.cad.carry import carry_over
from michell_cad.cad.layout import Layout, place, settle, start_layout
from michell_cad.cad.prepare import prepare_truss
from michell_cad.cad.simplify import simplify_truss
from michell_cad.knobs import Knobs
from michell_cad.truss import SizedTruss
from tests.cad.layouts import grid_truss, sized, star


def fork(bow: float) -> SizedTruss:
    """Two members whose chords enclose 40 degrees; their middles are moved towards each other."""
    half = np.radians(20.0)
    tight = star([[np.cos(half), np.sin(half), 0], [np.cos(half), -np.sin(half), 0]], length=12.0, radius=0.6)
    middle = tight.truss.nodes[[1, 2]] / 2 - [[0, bow, 0], [0, -bow, 0]]
    truss = dataclasses.replace(tight.truss, waypoints=middle, waypoint_offsets=np.array([0, 1, 2]))
    return SizedTruss(truss, tight.radii)


def test_curves_that_leave_side_by_side_leave_along_their_secants() -> None:
    bent = prepare_truss(fork(1.2), Knobs())
    assert bent.turned_ends == 2
    assert bent.directions[0] @ bent.directions[2] == pytest.approx(np.cos(np.radians(40.0)))
    assert bent.sizes.reach[0] < 0.6 * 12
    # The spine comes back towards the curve, which is 1.2 mm off the chord.
    away = bent.tubes.spine_points(np.linspace(0, 1, 101)) - bent.sized.truss.waypoints[:, None]
    assert np.linalg.norm(away, axis=2).min(1).max() < 0.5
    assert prepare_truss(fork(0.0), Knobs()).turned_ends == 0


def test_a_member_too_short_for_its_nodes_takes_smaller_ones() -> None:
    roomy, tight = (start_layout(star(np.eye(3), length=length), Knobs()) for length in (8.0, 3.0))
    assert not settle(roomy)
    assert not settle(tight)
    assert (roomy.level == 0).all()
    assert (tight.level > 0).all()
    assert (tight.sizes["reach"].reshape(-1, 2).sum(1) < 3.0).all()


def test_a_member_that_no_size_helps_is_in_trouble() -> None:
    assert settle(start_layout(star(np.eye(3), length=np.array([8.0, 8.0, 1.5])), Knobs())) == {2}


def placed(layout: Layout) -> Layout:
    assert place(layout) == (set(), set())
    return layout


@pytest.mark.parametrize("seed", range(3))
def test_carried_over_equals_laid_out_anew(seed) -> None:
    before = sized(grid_truss((5, 4, 3), warp=0.12, missing=0.15, seed=seed), 1.1, 0.3)
    old = placed(start_layout(before, Knobs()))
    a, b = before.truss.members[len(before.truss.members) // 2].tolist()
    simpler, number = simplify_truss(before, [(a, b)], [])
    carried = carry_over(old, simpler, number)
    some = int(carried.unfit.sum())
    assert 0 < some < 0.5 * len(carried.unfit)
    carried, fresh = placed(carried), placed(start_layout(simpler, Knobs()))
    for name in ("radius", "end_radius", "fillet", "reach", "creased", "rival"):
        assert carried.sizes[name] == pytest.approx(fresh.sizes[name]), name
    assert carried.seams["found"].tolist() == fresh.seams["found"].tolist()
    for one, other in zip(carried.tubes["poles"], fresh.tubes["poles"], strict=True):
        assert one == pytest.approx(other)
    assert carried.mitres.keys() == fresh.mitres.keys()
