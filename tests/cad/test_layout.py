"""Layouts: what is done at a node is what was asked for, and keeping it after a change equals doing it anew."""

import dataclasses

import numpy as np
import pytest

from michell_cad.cad.carry import carry_over
from michell_cad.cad.fidelity import curve_deviation
from michell_cad.cad.layout import SHORTEST_TUBE, Layout, settle, start_layout
from michell_cad.cad.nodes import cap_angle
from michell_cad.cad.placement import place
from michell_cad.cad.prepare import prepare_truss
from michell_cad.cad.prepared import node_room
from michell_cad.cad.simplify import simplify_truss
from michell_cad.knobs import Knobs
from michell_cad.truss import SizedTruss, Truss
from tests.cad.layouts import grid_truss, sized, star


def fork(bow: float, radius: float = 0.6) -> SizedTruss:
    """Two members whose chords enclose 40 degrees; their middles are moved towards each other."""
    half = np.radians(20.0)
    tight = star([[np.cos(half), np.sin(half), 0], [np.cos(half), -np.sin(half), 0]], length=12.0, radius=radius)
    middle = tight.truss.nodes[[1, 2]] / 2 - [[0, bow, 0], [0, -bow, 0]]
    truss = dataclasses.replace(tight.truss, waypoints=middle, waypoint_offsets=np.array([0, 1, 2]))
    return SizedTruss(truss, tight.radii)


def touching_arcs(radius: float) -> SizedTruss:
    """Two quarter circles of 12 mm radius that touch at the origin and part to both sides, as arcs of three points."""
    tight = star([[1, 1, 0], [1, -1, 0]], length=12 * np.sqrt(2), radius=radius)
    t = np.radians([22.5, 45.0, 67.5])
    way = 12 * np.stack([np.sin(t), 1 - np.cos(t), 0 * t], axis=1)
    waypoints = np.concatenate([way, way * [1, -1, 1]])
    truss = dataclasses.replace(tight.truss, waypoints=waypoints, waypoint_offsets=np.array([0, 3, 6]))
    return SizedTruss(truss, tight.radii)


def test_tubes_begin_on_their_curves() -> None:
    """A member that bends with the radius 12 mm aims at the point where its tube begins: at half the turn."""
    bent = prepare_truss(touching_arcs(0.5), Knobs())
    assert bent.turned_ends == 0
    reach, d = bent.sizes.reach[::2], bent.directions[::2]
    circles = reach[:, None] * d
    from_center = np.linalg.norm(np.abs(circles) - [0, 12, 0], axis=1)
    assert from_center == pytest.approx(12.0, abs=0.1)
    assert np.arcsin(np.abs(d[:, 1])) == pytest.approx(reach / 24, rel=0.1)
    # Along the tangents, the two would never part; so they do where the arcs are as far apart as their tips need.
    assert reach == pytest.approx(np.sqrt(24 * 0.5), rel=0.25)
    # The sagitta of the straight piece between the node and its tube.
    assert curve_deviation(bent) == pytest.approx(reach**2 / (8 * 12), rel=0.15)


def test_members_without_room_aim_farther_along_their_curves() -> None:
    assert prepare_truss(fork(0.0), Knobs()).turned_ends == 0
    thin, squeezed = (prepare_truss(fork(1.6, radius), Knobs()) for radius in (1.0, 2.0))
    assert (thin.turned_ends, squeezed.turned_ends) == (0, 2)
    assert squeezed.changes.merged_nodes == 0
    # The curves leave at less than the 40 degrees of their chords, and no farther aim gives more.
    angles = [np.degrees(np.arccos(one.directions[0] @ one.directions[2])) for one in (thin, squeezed)]
    assert angles[0] + 10 < angles[1] < 40
    assert (squeezed.sizes.reach.reshape(-1, 2).sum(1) < 12).all()


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


def in_order(truss: Truss) -> Truss:
    """The same truss with its members in ascending order, as cleaning and every change leave them."""
    order = np.lexsort(truss.members.T[::-1])
    number = np.argsort(order)
    curves = tuple(dataclasses.replace(curve, members=number[curve.members]) for curve in truss.curves)
    return dataclasses.replace(truss, members=truss.members[order], curves=curves)


def seams_begin_on_their_circles(layout: Layout) -> bool:
    seams, sizes = layout.seams, layout.sizes
    node, pole = np.nonzero(seams["cap"] >= 0)
    ends = layout.order[layout.bounds[node] + seams["cap"][node, pole]]
    v = seams["latitudes"][node, pole][:, None]
    q = np.cos(v) * seams["zero"][node] + np.sin(v) * seams["axis"][node]
    a = cap_angle(sizes["radius"][node], sizes["end_radius"][ends], sizes["fillet"][ends])
    return np.allclose((q * layout.directions.reshape(-1, 3)[ends]).sum(1), np.cos(a), atol=1e-9)


@pytest.mark.parametrize("ordered", [True, False])
@pytest.mark.parametrize("seed", range(3))
def test_carried_over_equals_laid_out_anew(seed, ordered) -> None:
    """... also where the change puts members in another order: less is kept then, but nothing wrong."""
    truss = grid_truss((5, 4, 3), warp=0.12, missing=0.15, seed=seed)
    before = sized(in_order(truss) if ordered else truss, 1.1, 0.3)
    old = placed(start_layout(before, Knobs()))
    a, b = before.truss.members[len(before.truss.members) // 2].tolist()
    simpler, number = simplify_truss(before, [(a, b)], [])
    carried = carry_over(old, simpler, number)
    some = int(carried.unfit.sum())
    assert 0 < some
    assert some < 0.5 * len(carried.unfit) or not ordered
    carried, fresh = placed(carried), placed(start_layout(simpler, Knobs()))
    for name in ("radius", "end_radius", "fillet", "reach", "creased", "rival"):
        assert carried.sizes[name] == pytest.approx(fresh.sizes[name]), name
    assert carried.seams["found"].tolist() == fresh.seams["found"].tolist()
    for one, other in zip(carried.tubes["poles"], fresh.tubes["poles"], strict=True):
        assert one == pytest.approx(other)
    assert carried.mitres.keys() == fresh.mitres.keys()
    for layout in (old, carried, fresh):
        assert seams_begin_on_their_circles(layout)


def test_room_is_what_the_shortest_member_leaves() -> None:
    """In a grid of equal members the room is the radius at which two nodes and the shortest tube fill a cell."""
    truss = grid_truss((3, 3, 3), warp=0.0)
    thin, thick = (prepare_truss(sized(truss, r), Knobs()) for r in (0.4, 0.8))
    room = node_room(thin)
    np.testing.assert_allclose(room, node_room(thick), rtol=1e-6)
    reach = thin.sizes.reach.reshape(-1, 2).sum(1) + SHORTEST_TUBE * 0.4
    np.testing.assert_allclose(room.min(), 0.4 / (reach / thin.sized.truss.lengths).max(), rtol=1e-9)
    below, above = (prepare_truss(sized(truss, share * room.min()), Knobs()) for share in (0.99, 1.01))
    assert (below.layout.level == 0).all()
    assert (above.layout.level > 0).any()
