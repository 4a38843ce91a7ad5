"""Merging and rerouting by hand: labels stay, members and radii are the expected ones."""

import numpy as np
import pytest

from michell_cad.cad.simplify import Joint, simplify_truss
from michell_cad.curves import Curve, CurveKind, NodeKind
from michell_cad.truss import SizedTruss, Truss
from tests.cad.layouts import grid_truss, sized


def truss_of(nodes, rows, kinds=None, closed=()) -> SizedTruss:
    """One curve per row of nodes; radii (1, 2, 3) along each member from its lower to its higher node."""
    nodes = np.array(nodes, float)
    pairs = []
    for c, row in enumerate(rows):
        pairs += [tuple(sorted(p)) for p in zip(row, row[1:] + (row[:1] if c in closed else []), strict=False)]
    members = sorted(set(pairs))
    curves = []
    for c, row in enumerate(rows):
        steps = [tuple(sorted(p)) for p in zip(row, row[1:] + (row[:1] if c in closed else []), strict=False)]
        mine = np.array([members.index(p) for p in steps])
        curves.append(Curve(CurveKind.INTERIOR, "third", 2, (c, 0, None), 0, np.array(row), mine, c in closed))
    kinds = np.zeros(len(nodes), int) if kinds is None else np.array(kinds)
    truss = Truss(nodes, kinds, np.array(members), tuple(curves), 1.0)
    return SizedTruss(truss, np.tile([1.0, 2.0, 3.0], (len(members), 1)))


LINE = [[0, 0, 0], [1, 0, 0], [1.2, 0, 0], [2, 0, 0]]


def test_merge_two_alike_meet_halfway() -> None:
    sized, number = simplify_truss(truss_of(LINE, [[0, 1, 2, 3]]), [(1, 2)], [])
    assert number.tolist() == [0, 1, 1, 2]
    assert sized.truss.nodes[1] == pytest.approx([1.1, 0, 0])
    assert sized.truss.members.tolist() == [[0, 1], [1, 2]]
    assert sized.truss.curves[0].nodes.tolist() == [0, 1, 2]
    assert sized.truss.curves[0].isovalues == (0, 0, None)


def test_merge_keeps_the_constrained_node() -> None:
    tight = truss_of(LINE, [[0, 1, 2, 3]], kinds=[0, 0, NodeKind.BOUNDARY, 0])
    sized, _ = simplify_truss(tight, [(1, 2)], [])
    assert sized.truss.nodes[1] == pytest.approx([1.2, 0, 0])
    assert sized.truss.node_kinds[1] == NodeKind.BOUNDARY


def test_members_that_become_one_take_the_larger_radius() -> None:
    both = truss_of([[0, 0, 0], [1, 0, 0], [1, 0.1, 0]], [[0, 1], [0, 2]])
    both = SizedTruss(both.truss, np.array([[1.0, 2.0, 3.0], [2.0, 1.0, 1.0]]))
    sized, _ = simplify_truss(both, [(1, 2)], [])
    assert sized.truss.members.tolist() == [[0, 1]]
    assert sized.radii.tolist() == [[2.0, 2.0, 3.0]]
    assert len(sized.truss.curves) == 2


def test_detour_leads_a_member_through_a_node() -> None:
    fork = truss_of([[0, 0, 0], [1, 0.05, 0], [2, 0, 0]], [[0, 1], [0, 2]])
    member = fork.truss.members.tolist().index([0, 2])
    sized, _ = simplify_truss(fork, [], [(member, 1)])
    assert sized.truss.members.tolist() == [[0, 1], [1, 2]]
    assert [curve.nodes.tolist() for curve in sized.truss.curves] == [[0, 1], [0, 1, 2]]
    # The rest of the member takes its radii from the middle on, the shared part keeps its own.
    assert sized.radii.tolist() == [[1, 2, 3], [2, 2.5, 3]]


def test_steps_to_and_fro_vanish() -> None:
    nodes = [[0, 0, 0], [1, 0, 0], [2, 0.1, 0], [1, 0.1, 0], [0, 1, 0]]
    sized, _ = simplify_truss(truss_of(nodes, [[0, 1, 2, 3, 4]]), [(1, 3)], [])
    assert sized.truss.curves[0].nodes.tolist() == [0, 1, 2]
    assert sized.truss.nodes.tolist() == [[0, 0, 0], [1, 0.05, 0], [0, 1, 0]]


def test_of_two_members_that_become_one_at_the_end_of_a_curve_one_stays() -> None:
    nodes = [[0, 0, 0], [1, 0, 0], [2, 0.1, 0], [1, 0.1, 0]]
    sized, _ = simplify_truss(truss_of(nodes, [[0, 1, 2, 3]]), [(1, 3)], [])
    assert sized.truss.curves[0].nodes.tolist() == [0, 1, 2]
    sized, _ = simplify_truss(truss_of(nodes, [[3, 2, 1, 0]]), [(1, 3)], [])
    assert sized.truss.curves[0].nodes.tolist() == [2, 1, 0]


def test_closed_curve_of_two_nodes_opens() -> None:
    ring = truss_of([[0, 0, 0], [1, 0, 0], [0.5, 0.1, 0]], [[0, 1, 2]], closed={0})
    sized, _ = simplify_truss(ring, [(0, 2)], [])
    assert not sized.truss.curves[0].closed
    assert len(sized.truss.members) == 1


def test_vanished_curve_and_node() -> None:
    sized, number = simplify_truss(truss_of(LINE, [[0, 1], [1, 2], [2, 3]]), [(1, 2)], [])
    assert [curve.isovalues[0] for curve in sized.truss.curves] == [0, 2]
    assert number.tolist() == [0, 1, 1, 2]


def test_radii_turn_with_their_member() -> None:
    """Node 0 is renamed to 5, so that its members are listed from the other end."""
    nodes = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0], [0.1, 0.1, 0], [0.1, 0, 0]]
    tight = truss_of(nodes, [[0, 1, 2, 3], [4, 5]], kinds=[0, 0, 0, 0, 0, 3])
    sized, number = simplify_truss(tight, [(0, 5)], [])
    member = sized.truss.members.tolist().index([number[1], number[5]])
    assert sized.radii[member].tolist() == [3, 2, 1]


@pytest.mark.parametrize("seed", range(5))
def test_random_changes_leave_a_truss(seed) -> None:
    """The constructor of `Truss` checks itself; labels stay unique and no new ones appear."""
    rng = np.random.default_rng(seed)
    tight = sized(grid_truss((4, 4, 3), missing=0.2, seed=seed), 1.0)
    labels = {curve.name for curve in tight.truss.curves}
    for _ in range(5):
        n = len(tight.truss.nodes)
        pairs = rng.permutation(n)[:6].reshape(3, 2).tolist()
        tight, _ = simplify_truss(tight, [tuple(p) for p in pairs], [])
        m, j = int(rng.integers(len(tight.truss.members))), int(rng.integers(len(tight.truss.nodes)))
        if j not in tight.truss.members[m]:
            tight, _ = simplify_truss(tight, [], [(m, j)])
    names = [curve.name for curve in tight.truss.curves]
    assert len(set(names)) == len(names)
    assert set(names) <= labels


def test_members_joined_in_a_new_node() -> None:
    """Two crossing members share a node afterwards: labels and radii stay, the node is numbered after the others."""
    cross = truss_of([[-1, 0, 0], [1, 0, 0], [0, -1, 0.1], [0, 1, 0.1]], [[0, 1], [2, 3]])
    sized, number = simplify_truss(cross, [], [], [Joint((0.0, 0.0, 0.05), NodeKind.BOUNDARY, (0, 1))])
    assert number.tolist() == [0, 1, 2, 3, 4]
    assert sized.truss.nodes[4] == pytest.approx([0, 0, 0.05])
    assert sized.truss.node_kinds[4] == NodeKind.BOUNDARY
    assert sized.truss.members.tolist() == [[0, 4], [1, 4], [2, 4], [3, 4]]
    assert [curve.nodes.tolist() for curve in sized.truss.curves] == [[0, 4, 1], [2, 4, 3]]
    # From the ends, 1 or 3, to the radius 2 in the middle.
    assert sized.radii[:, 0] == pytest.approx([1, 3, 1, 3])
    assert sized.radii[:, 2] == pytest.approx(2)
