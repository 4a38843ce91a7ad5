"""Trusses: cleaning and choosing curves, by hand on small networks and for any map."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapes import box_mesh

from michell_cad.curves import Curve, CurveKind, Curves, NodeKind
from michell_cad.errors import InvalidInputError
from michell_cad.isocurves import CurveNetwork, trace_isocurves
from michell_cad.truss import (
    Truss,
    TrussOptions,
    build_truss,
    clean_network,
    interior_degree_6,
    keep_curves,
    valences,
)

INTERIOR, BOUNDARY, FEATURE, CORNER = NodeKind


def network_of(
    nodes: list, kinds: list, curves: list[tuple[CurveKind, list[int], bool]], paths: dict | None = None
) -> CurveNetwork:
    """A network of curves given by kind, nodes and closedness; `paths` has points inside the m-th member."""
    members, made = [], []
    for number, (kind, path, closed) in enumerate(curves):
        steps = list(pairwise(path)) + ([(path[-1], path[0])] if closed else [])
        axis = -1 if kind is CurveKind.FEATURE else 0
        values = {"interior": (None, number, 0), "boundary": (None, number, None), "feature": (None, None, None)}[kind]
        family = "feature" if axis < 0 else "tension"
        numbers = range(len(members), len(members) + len(steps))
        made.append(
            Curve(kind, family, axis, values, number if axis < 0 else 0, np.array(path), np.array(numbers), closed)
        )
        members += steps
    points = [np.reshape((paths or {}).get(m, []), (-1, 3)) for m in range(len(members))]
    offsets = np.concatenate([[0], np.cumsum([len(p) for p in points])])
    nodes = np.array(nodes, float)
    return CurveNetwork(
        nodes, np.array(kinds), nodes, np.array(members), np.concatenate(points), offsets, Curves.of(made)
    )


def box_network(shift: float = 0.5, cells: int = 3) -> CurveNetwork:
    mesh = box_mesh((2, 2, 2), (float(cells),) * 3)
    return trace_isocurves(mesh, mesh.vertices + shift)


# --- cleaning ---------------------------------------------------------------------------------------------------


def test_nothing_to_clean_is_left_alone() -> None:
    """Layers half a cell from every face: the shortest members are half a cell long."""
    network = box_network()
    truss, report = clean_network(network, 1.0)
    assert (report.nodes, report.members) == ((125, 125), (300, 300))
    assert report.merged_nodes == report.merged_ends == report.rerouted_members == report.acute_pairs == 0
    assert report.shared_members == 0
    np.testing.assert_array_equal(truss.nodes, network.nodes)
    assert [c.name for c in truss.curves] == [c.name for c in network.curves]
    assert valences(truss.node_kinds, truss.members) == {"interior": {6: 27}, "boundary": {3: 8, 4: 36, 5: 54}}
    assert interior_degree_6(network) == 1


def test_layers_under_three_faces_merge_with_them() -> None:
    """The box [0, 3]^3 lowered by 0.7: layers at 0.3, 1.3, 2.3, of which the first merges with the face at 0.

    What is left are the points {0, 1.3, 2.3, 3}^3 without the corners' neighbours: the lattice of 4 x 4 x 4 points.
    """
    truss, report = clean_network(box_network(0.7), 1.0)
    grid = np.array([0, 1.3, 2.3, 3.0])
    np.testing.assert_allclose(np.unique(np.round(truss.nodes, 4)), grid, atol=1e-4)
    assert len(truss.nodes) == 4**3
    assert len(truss.members) == 3 * 3 * 4**2
    assert report.curves[0] - report.curves[1] == 0
    assert report.short_members == report.acute_pairs == 0
    assert truss.lengths.min() > 0.4
    # The first layer of interior curves shares members with surface curves, and these with features.
    kinds = [truss.node_kinds[i] for i in np.flatnonzero((truss.nodes == 0).sum(1) == 3)]
    assert kinds == [CORNER]


def test_short_members_collapse_towards_the_more_constrained_node() -> None:
    nodes = [[0, 0, 0], [0.2, 0, 0], [1, 0, 0], [1.2, 0, 0], [2, 0, 0], [2.1, 0, 0], [2.4, 0, 0], [5, 0, 0]]
    kinds = [CORNER, FEATURE, BOUNDARY, INTERIOR, INTERIOR, INTERIOR, INTERIOR, BOUNDARY]
    truss, report = clean_network(network_of(nodes, kinds, [(CurveKind.INTERIOR, list(range(8)), False)]), 1.0)
    # 0.2 goes to the corner, 1.2 to the boundary; 2 and 2.1 meet at 2.05, and then 2.4 at their centre of mass.
    np.testing.assert_allclose(truss.nodes[:, 0], [0, 1, (2 + 2.1 + 2.4) / 3, 5])
    np.testing.assert_array_equal(truss.node_kinds, [CORNER, BOUNDARY, INTERIOR, BOUNDARY])
    assert (report.merged_nodes, report.merged_corners) == (4, 0)
    assert (
        clean_network(network_of(nodes, kinds, [(CurveKind.INTERIOR, list(range(8)), False)]), 0.4)[1].merged_nodes == 1
    )


def loose_network(size: int) -> CurveNetwork:
    """The box network, and a feature of so many members of 1 mm, 10 mm beside it."""
    box = box_network()
    edge = network_of(
        [[10 + i, 0, 0] for i in range(size + 1)],
        [FEATURE] * (size + 1),
        [(CurveKind.FEATURE, list(range(size + 1)), False)],
    )
    n, m = len(box.nodes), len(box.members)
    curve = replace(edge.curves[0], component=99, nodes=edge.curves[0].nodes + n, members=edge.curves[0].members + m)
    return CurveNetwork(
        np.concatenate([box.nodes, edge.nodes]),
        np.concatenate([box.node_kinds, edge.node_kinds]),
        np.concatenate([box.node_levels, edge.node_levels]),
        np.concatenate([box.members, edge.members + n]),
        box.path_points,
        np.concatenate([box.path_offsets, np.full(size, box.path_offsets[-1])]),
        Curves.of([*box.curves, curve]),
    )


@pytest.mark.parametrize(("size", "dropped"), [(1, 1), (2, 2), (12, 12), (13, 0)])
def test_small_pieces_that_nothing_touches_are_left_out(size, dropped) -> None:
    network = loose_network(size)
    truss, report = clean_network(network, 1.0)
    assert (report.loose_pieces, report.loose_members) == (min(dropped, 1), dropped)
    assert len(truss.members) == 300 + size - dropped
    assert len(truss.curves) == len(network.curves) - (dropped > 0)
    np.testing.assert_array_equal(truss.nodes[:125], box_network().nodes)


def test_small_pieces_stay_where_the_part_is_held_or_loaded_and_where_there_is_nothing_else() -> None:
    for anchor, kept in (([10.0, 0.5, 0.0], True), ([10.0, 1.5, 0.0], False), ([1.0, 1.0, 1.0], False)):
        truss, report = clean_network(loose_network(1), 1.0, anchors=np.array([anchor]))
        assert len(truss.members) == 300 + kept
        assert report.loose_members == (not kept)
    alone = network_of([[0, 0, 0], [1, 0, 0]], [FEATURE] * 2, [(CurveKind.FEATURE, [0, 1], False)])
    assert len(clean_network(alone, 1.0)[0].members) == 1


def test_curves_that_shrink_to_a_point_vanish_and_labels_stay() -> None:
    nodes = [[0, 0, 0], [0.1, 0, 0], [1, 0, 0], [2, 0, 0]]
    network = network_of(
        nodes,
        [BOUNDARY] * 4,
        [
            (CurveKind.BOUNDARY, [0, 1], False),
            (CurveKind.BOUNDARY, [1, 2, 3], False),
            (CurveKind.INTERIOR, [0, 2], False),
        ],
    )
    truss, report = clean_network(network, 1.0)
    assert report.curves == (3, 2)
    assert [c.name for c in truss.curves] == [network.curves[1].name, network.curves[2].name]
    # 0-2 and 1-2 became one member, which both curves take.
    np.testing.assert_array_equal(truss.members, [[0, 1], [1, 2]])
    assert [c.members.tolist() for c in truss.curves] == [[0, 1], [0]]
    assert report.shared_members == 1


def test_a_boundary_and_an_interior_curve_between_two_nodes_share_a_member() -> None:
    path = {0: [[0.5, 0.9, 0]], 1: [[0.5, 0, 0]]}
    curves = [(CurveKind.BOUNDARY, [0, 1], False), (CurveKind.INTERIOR, [0, 1], False)]
    truss = build_truss(network_of([[0, 0, 0], [1, 0, 0]], [BOUNDARY] * 2, curves, path), 1.0)
    assert len(truss.members) == 1
    assert [c.members.tolist() for c in truss.curves] == [[0], [0]]
    assert truss.curve_of_member[0] == 1
    assert truss.shape_of_member[0] == 0


def test_two_surface_curves_around_a_hole_stay_apart() -> None:
    """Two half circles of radius 1 between the same nodes: one of them gets a node in the middle."""
    half = [[-np.cos(t), np.sin(t), 0] for t in np.linspace(0, np.pi, 21)[1:-1]]
    path = {0: half, 1: [[x, -y, 0] for x, y, _ in half]}
    curves = [(CurveKind.FEATURE, [0, 1], False), (CurveKind.FEATURE, [0, 1], False)]
    nodes = [[-1, 0, 0], [1, 0, 0]]
    truss, report = clean_network(network_of(nodes, [CORNER] * 2, curves, path), 1.0)
    assert (len(truss.nodes), len(truss.members), report.added_nodes) == (3, 3, 1)
    assert truss.node_kinds.tolist() == [CORNER, CORNER, FEATURE]
    np.testing.assert_allclose(np.abs(truss.nodes[2]), [0, 1, 0], atol=1e-12)
    # Waypoints keep the other half, and both halves of this one, on the circle (the trace has 20 chords).
    np.testing.assert_allclose(np.linalg.norm(truss.waypoints, axis=1), 1, atol=0.004)
    np.testing.assert_allclose(np.linalg.norm(truss.waypoints + truss.nodes[2], axis=1).min(), 0, atol=1e-12)
    # In cells of 4 the two halves would be too short to be built: the hole is too small for this truss.
    truss, report = clean_network(network_of(nodes, [CORNER] * 2, curves, path), 4.0)
    assert (len(truss.nodes), len(truss.members), report.shared_members) == (2, 1, 1)


def test_a_rim_with_one_node_gets_three() -> None:
    ring = [[np.cos(t), np.sin(t), 0] for t in np.linspace(0, 2 * np.pi, 61)[1:-1]]
    network = network_of([[1, 0, 0]], [FEATURE], [(CurveKind.FEATURE, [0], True)], {0: ring})
    truss, report = clean_network(network, 1.0)
    assert report.added_nodes == 2
    third = 2 * np.pi / 3
    expected = [[np.cos(k * third), np.sin(k * third), 0] for k in range(3)]
    np.testing.assert_allclose(truss.nodes[truss.curves[0].nodes], expected, atol=1e-9)
    assert truss.curves[0].closed
    with pytest.raises(InvalidInputError, match="no member is left"):
        clean_network(network, 10.0)


def test_a_curve_there_and_back_keeps_no_spur() -> None:
    """Nodes 1 and 3 merge: 0, 1, 2, 3, 4 becomes 0, 1, 4, and node 2 stays on the other curve only."""
    nodes = [[0, 0, 0], [1, 0, 0], [1.1, 1, 0], [1.2, 0, 0], [2.2, 0, 0], [0, 1, 0], [2, 1, 0]]
    kinds = [BOUNDARY, INTERIOR, INTERIOR, INTERIOR, BOUNDARY, BOUNDARY, BOUNDARY]
    curves = [(CurveKind.INTERIOR, [0, 1, 2, 3, 4], False), (CurveKind.INTERIOR, [5, 2, 6], False)]
    truss = build_truss(network_of(nodes, kinds, curves), 1.0)
    assert [len(c.nodes) for c in truss.curves] == [3, 3]
    assert len(truss.members) == 4


def test_near_parallel_members_are_joined() -> None:
    """0-1 and 0-2 enclose 5.7 degrees and 2 lies far beyond 1: the longer member goes through 1."""
    nodes = [[0, 0, 0], [1, 0.1, 0], [2, 0, 0], [1, 1, 0]]
    curves = [(CurveKind.INTERIOR, [0, 1, 3], False), (CurveKind.INTERIOR, [0, 2], False)]
    truss, report = clean_network(network_of(nodes, [BOUNDARY, INTERIOR, BOUNDARY, BOUNDARY], curves), 1.0)
    assert (report.rerouted_members, report.merged_ends, report.acute_pairs) == (1, 0, 0)
    assert truss.curves[1].nodes.tolist() == [0, 1, 2]
    assert report.shared_members == 1
    # With 2 close to 1 their ends are merged instead; the node on the boundary stays.
    nodes[2] = [1.3, 0, 0]
    truss, report = clean_network(
        network_of(nodes, [BOUNDARY, INTERIOR, BOUNDARY, BOUNDARY], curves), 1.0, TrussOptions(shortest_member=0.35)
    )
    assert (report.rerouted_members, report.merged_ends, report.acute_pairs) == (0, 1, 0)
    np.testing.assert_allclose(truss.nodes[truss.curves[1].nodes], [[0, 0, 0], [1.3, 0, 0]])


def test_an_inner_node_that_joins_a_surface_curve_is_moved_onto_it() -> None:
    nodes = [[0, 0, 0], [1, 0.1, 0], [2, 0, 0], [1, 1, 0]]
    curves = [(CurveKind.INTERIOR, [0, 1, 3], False), (CurveKind.BOUNDARY, [0, 2], False)]
    truss = build_truss(network_of(nodes, [BOUNDARY, INTERIOR, BOUNDARY, BOUNDARY], curves), 1.0)
    assert truss.curves[1].nodes.tolist() == [0, 1, 2]
    np.testing.assert_allclose(truss.nodes[1], [1, 0, 0])
    assert truss.node_kinds[1] == BOUNDARY


def test_two_features_at_an_acute_angle_are_left() -> None:
    nodes = [[0, 0, 0], [2, 0.2, 0], [3, 0, 0]]
    curves = [(CurveKind.FEATURE, [0, 1], False), (CurveKind.FEATURE, [0, 2], False)]
    truss, report = clean_network(network_of(nodes, [CORNER] * 3, curves), 1.0)
    assert (len(truss.members), report.acute_pairs, report.rerouted_members) == (2, 1, 0)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.3, 1.0]))
def test_any_map_gives_a_valid_truss_and_any_choice_of_it_too(seed: int, noise: float) -> None:
    """`Truss` checks itself: members repeat nowhere, curves follow members, labels are unique."""
    rng = np.random.default_rng(seed)
    mesh = box_mesh((3, 2, 2), (3.0, 2.0, 2.0))
    levels = mesh.vertices + rng.normal(size=mesh.vertices.shape) * noise
    network = trace_isocurves(mesh, levels)
    truss, report = clean_network(network, 1.0)
    assert report.short_members == 0
    assert truss.lengths.min() >= 0.4
    assert truss.degrees.min() >= 1
    assert truss.degrees[truss.node_kinds == INTERIOR].min(initial=2) >= 2
    # Nodes on the surface stay in the faces of the box.
    x = truss.nodes[truss.node_kinds > INTERIOR]
    assert (np.minimum(x, mesh.vertices.max(0) - x).min(1) < 1e-9).all()
    known = {c.name for c in network.curves}
    assert all(c.name in known for c in truss.curves)
    mask = rng.random(len(truss.curves)) < rng.choice([0.2, 0.5, 0.8])
    mask[0] = True
    kept = keep_curves(truss, mask)
    assert [c.name for c in kept.curves] == [c.name for c, keep in zip(truss.curves, mask, strict=True) if keep]
    assert kept.degrees.min() >= 1
    # Waypoints and nodes of each curve are the nodes it had.
    for before, after in zip([c for c, keep in zip(truss.curves, mask, strict=True) if keep], kept.curves, strict=True):
        waypoints = [kept.waypoints[slice(*kept.waypoint_offsets[m : m + 2])] for m in set(after.members.tolist())]
        there = {tuple(p) for p in np.concatenate([kept.nodes[after.nodes], *waypoints])}
        assert {tuple(p) for p in truss.nodes[before.nodes]} <= there


# --- choosing curves ------------------------------------------------------------------------------------------------


def regular_truss() -> Truss:
    """The box [0, 3]^3 with layers half a cell from the faces: 3 x 3 interior curves each way."""
    return build_truss(box_network(), 1.0)


def test_keeping_all_curves_changes_nothing() -> None:
    truss = regular_truss()
    kept = keep_curves(truss, np.ones(len(truss.curves), bool))
    np.testing.assert_array_equal(kept.nodes, truss.nodes)
    np.testing.assert_array_equal(kept.members, truss.members)
    assert len(kept.waypoints) == 0


def test_every_second_curve_by_hand() -> None:
    """Only the layers with value 2 stay: three curves through the centre, twelve on the surface, twelve edges."""
    truss = regular_truss()
    kept = keep_curves(truss, np.array([all(v is None or v % 2 == 0 for v in c.isovalues) for c in truss.curves]))
    assert len(kept.curves) == 3 + 12 + 12
    # Nodes: the centre, the six face centres, the twelve edge centres, the eight corners.
    assert valences(kept.node_kinds, kept.members) == {"interior": {6: 1}, "boundary": {3: 8, 4: 12, 5: 6}}
    assert len(kept.members) == 6 + 24 + 24
    np.testing.assert_allclose(kept.lengths, 1.5, atol=1e-5)
    # Every member runs through the one crossing (at 0.5 or 2.5) that was dissolved.
    assert len(kept.waypoints) == len(kept.members)
    np.testing.assert_array_equal(np.diff(kept.waypoint_offsets), 1)
    a, b = kept.nodes[kept.members].transpose(1, 0, 2)
    s = np.linalg.norm(kept.waypoints - a, axis=1) / 1.5
    np.testing.assert_allclose(kept.waypoints, a + s[:, None] * (b - a), atol=1e-5)
    # Nodes are numbered from inside to corners, so that every waypoint lies nearer to the second node.
    np.testing.assert_allclose(s, 2 / 3, atol=1e-5)
    # Dissolving twice is dissolving once.
    again = keep_curves(kept, np.ones(len(kept.curves), bool))
    np.testing.assert_array_equal(again.waypoints, kept.waypoints)


def test_one_curve_alone_is_one_member_with_its_crossings_as_waypoints() -> None:
    truss = regular_truss()
    number = next(i for i, c in enumerate(truss.curves) if c.isovalues == (2, 1, None))
    kept = keep_curves(truss, np.arange(len(truss.curves)) == number)
    assert (len(kept.nodes), len(kept.members)) == (2, 1)
    np.testing.assert_allclose(kept.waypoints, [[1.5, 0.5, z] for z in (0.5, 1.5, 2.5)], atol=1e-5)
    np.testing.assert_allclose(kept.nodes, [[1.5, 0.5, 0], [1.5, 0.5, 3]], atol=1e-5)


def test_closed_curves_keep_three_nodes() -> None:
    ring = [[np.cos(t), np.sin(t), 0] for t in np.arange(9) * 2 * np.pi / 9]
    curves = [(CurveKind.BOUNDARY, list(range(9)), True), (CurveKind.INTERIOR, [0, 9, 4], False)]
    truss = build_truss(network_of([*ring, [0, 0, 0.5]], [BOUNDARY] * 9 + [INTERIOR], curves), 0.5)
    alone = keep_curves(truss, np.array([True, False]))
    assert (len(alone.nodes), len(alone.members), alone.curves[0].closed) == (3, 3, True)
    assert len(alone.waypoints) == 6
    both = keep_curves(truss, np.array([True, True]))
    # Two ways around between nodes 0 and 4, and one through the middle: one of them has no node, two have one.
    assert len(both.members) == 5
    assert sorted(both.degrees.tolist()) == [2, 2, 3, 3]


def test_an_open_curve_that_ends_where_it_begins_stays_open() -> None:
    ring = [[np.cos(t), np.sin(t), 0] for t in np.arange(7) * 2 * np.pi / 7]
    network = network_of(ring, [FEATURE] * 7, [(CurveKind.FEATURE, [1, 2, 3, 4, 5, 6, 0, 1], False)])
    kept = keep_curves(build_truss(network, 0.5), np.array([True]))
    (curve,) = kept.curves
    assert (len(kept.nodes), len(curve.members), curve.closed) == (3, 3, False)
    np.testing.assert_allclose(kept.nodes[curve.nodes[[0, -1]]], [ring[1], ring[1]])


def test_corners_and_ends_are_not_dissolved() -> None:
    nodes = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0]]
    curves = [(CurveKind.FEATURE, [0, 1, 2], False), (CurveKind.FEATURE, [2, 3], False)]
    truss = build_truss(network_of(nodes, [CORNER, CORNER, CORNER, CORNER], curves), 1.0)
    assert len(keep_curves(truss, np.array([True, True])).nodes) == 4
    truss = build_truss(network_of(nodes, [CORNER, FEATURE, FEATURE, CORNER], curves), 1.0)
    kept = keep_curves(truss, np.array([True, True]))
    np.testing.assert_allclose(kept.nodes, [nodes[0], nodes[2], nodes[3]])
    np.testing.assert_allclose(kept.waypoints, [nodes[1]])


# --- values and refusals ----------------------------------------------------------------------------------------------


def test_valences_count_a_loop_twice() -> None:
    kinds, members = np.array([0, 0, 1, 3]), np.array([[0, 1], [0, 2], [3, 3]])
    assert valences(kinds, members) == {"interior": {1: 1, 2: 1}, "boundary": {1: 1, 2: 1}}


def test_interior_degree_6_sees_a_missing_member() -> None:
    network = box_network()
    interior = np.flatnonzero(network.node_kinds == INTERIOR)
    touched = np.flatnonzero(np.isin(network.members, interior[:1]).any(1))[:1]
    broken = replace(network, members=np.delete(network.members, touched, axis=0))
    assert interior_degree_6(broken) < 1


def test_bad_input_is_refused() -> None:
    network = box_network()
    with pytest.raises(InvalidInputError, match="spacing must be a positive length"):
        build_truss(network, 0.0)
    with pytest.raises(InvalidInputError, match="no member is left"):
        build_truss(network, 100.0)
    with pytest.raises(InvalidInputError, match="shortest_member"):
        TrussOptions(shortest_member=1.0)
    with pytest.raises(InvalidInputError, match="smallest_angle"):
        TrussOptions(smallest_angle=-0.1)
    truss = regular_truss()
    with pytest.raises(InvalidInputError, match="mask must have"):
        keep_curves(truss, np.array([True]))
    with pytest.raises(InvalidInputError, match="at least one curve"):
        keep_curves(truss, np.zeros(len(truss.curves), bool))
    with pytest.raises(InvalidInputError, match="same two nodes"):
        replace(truss, members=np.concatenate([truss.members[:1], truss.members[:-1]]))
