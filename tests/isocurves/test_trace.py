"""Isocurves against counts by hand and against what holds for every map."""

from collections import Counter
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from networks import ball_mesh, check_network, check_on_isosurfaces, hinged_mesh, tube_mesh
from scipy.spatial.transform import Rotation
from shapes import box_mesh

from michell_cad.curves import CurveKind, NodeKind
from michell_cad.errors import InvalidInputError
from michell_cad.isocurves import CurveNetwork, IsocurveOptions, trace_isocurves
from michell_cad.tet_mesh import TetMesh


def count_nodes(network: CurveNetwork) -> dict[NodeKind, int]:
    return {kind: int((network.node_kinds == kind).sum()) for kind in NodeKind}


def count_curves(network: CurveNetwork) -> Counter:
    return Counter((curve.kind, curve.family) for curve in network.curves)


# --- counts by hand ----------------------------------------------------------------------------------------------


def test_identity_on_a_box() -> None:
    """The box [0, 4] x [0, 3] x [0, 3], lowered by (0.4, 0.3, 0.2): 4, 3 and 3 integers of the three coordinates."""
    mesh = box_mesh((5, 2, 3), (4.0, 3.0, 3.0))
    levels = mesh.vertices + np.array([0.4, 0.3, 0.2])
    network = trace_isocurves(mesh, levels, ("compression", "tension", "third"))
    check_network(network)
    check_on_isosurfaces(mesh, levels, network)
    # Each of the 9 + 12 + 12 interior curves ends on two faces; each of the 4 + 3 + 3 planes cuts four edges.
    assert count_nodes(network) == {
        NodeKind.INTERIOR: 4 * 3 * 3,
        NodeKind.BOUNDARY: 2 * (3 * 3 + 4 * 3 + 4 * 3),
        NodeKind.FEATURE: 4 * (4 + 3 + 3),
        NodeKind.CORNER: 8,
    }
    # Boundary curves: a plane x = a cuts four faces, twice along y and twice along z.
    assert count_curves(network) == {
        (CurveKind.INTERIOR, "compression"): 3 * 3,
        (CurveKind.INTERIOR, "tension"): 4 * 3,
        (CurveKind.INTERIOR, "third"): 4 * 3,
        (CurveKind.BOUNDARY, "compression"): 2 * 3 + 2 * 3,
        (CurveKind.BOUNDARY, "tension"): 2 * 4 + 2 * 3,
        (CurveKind.BOUNDARY, "third"): 2 * 4 + 2 * 3,
        (CurveKind.FEATURE, "feature"): 12,
    }
    degrees = np.bincount(network.members.ravel())
    assert (degrees[network.node_kinds == NodeKind.FEATURE] == 4).all()
    assert (degrees[network.node_kinds == NodeKind.CORNER] == 3).all()
    np.testing.assert_allclose(network.nodes, network.node_levels - [0.4, 0.3, 0.2], atol=5e-6)
    curve = next(c for c in network.curves if c.isovalues == (1, 2, None))
    np.testing.assert_allclose(network.nodes[curve.nodes, 2], [0, 0.8, 1.8, 2.8, 3], atol=5e-6)
    # The two curves {x = 3} along y, on z = 0 and on z = 3, in this order.
    pair = [
        c for c in network.curves if c.kind is CurveKind.BOUNDARY and c.isovalues == (3, None, None) and c.axis == 1
    ]
    assert [network.nodes[c.nodes[0], 2] for c in pair] == [0, 3]
    assert all(np.diff(network.nodes[c.nodes, 1]).min() > 0 for c in pair)


def test_rotated_map_has_a_node_at_every_integer_point_of_the_image() -> None:
    mesh = box_mesh((3, 4, 2), (4.0, 3.0, 2.0))
    A = 1.7 * Rotation.from_rotvec([0.4, 0.8, -0.3]).as_matrix()
    levels = mesh.vertices @ A.T + np.array([0.21, 0.33, 0.15])
    network = trace_isocurves(mesh, levels)
    check_network(network)
    check_on_isosurfaces(mesh, levels, network)
    points = np.array(list(product(range(-12, 13), repeat=3)))
    x = (points - np.array([0.21, 0.33, 0.15])) @ np.linalg.inv(A).T
    inside = ((x > 0) & (x < mesh.vertices.max(0))).all(1)
    mine = network.node_kinds == NodeKind.INTERIOR
    np.testing.assert_array_equal(network.node_levels[mine], points[inside])
    np.testing.assert_allclose(network.nodes[mine], x[inside], atol=5e-6)


def test_rings_of_a_tube_are_closed() -> None:
    """Curves {r = a / 4, z = b / 4} around a tube are closed; they cross the planes {1.3 y + 0.11 = c} twice."""
    mesh = tube_mesh()
    r = np.hypot(*mesh.vertices.T[:2])
    levels = np.stack([4 * r + 0.5, 4 * mesh.vertices[:, 2] + 0.5, 1.3 * mesh.vertices[:, 1] + 0.11], axis=1)
    network = trace_isocurves(mesh, levels)
    check_network(network)
    rings = [c for c in network.curves if c.kind is CurveKind.INTERIOR and c.axis == 2]
    assert {c.isovalues[:2] for c in rings} == set(product(range(5, 9), range(1, 9)))
    assert len(rings) == 4 * 8
    for ring in rings:
        assert ring.closed
        assert ring.isovalues[0] is not None
        radius = (ring.isovalues[0] - 0.5) / 4
        heights = [c for c in range(-3, 4) if abs((c - 0.11) / 1.3) < radius]
        assert len(ring.nodes) == 2 * len(heights)
    # The four rims are closed features without corners.
    rims = [c for c in network.curves if c.kind is CurveKind.FEATURE]
    assert len(rims) == 4
    assert all(rim.closed for rim in rims)
    assert count_nodes(network)[NodeKind.CORNER] == 0
    # Surface curves {r = a} on the two flat ends and {z = b} on the two round walls meet no feature: closed.
    loops = [c for c in network.curves if c.kind is CurveKind.BOUNDARY and c.axis == 2]
    assert len(loops) == 2 * 4 + 2 * 8
    assert all(loop.closed for loop in loops)


def test_rims_that_nothing_crosses_have_one_node_and_other_loops_are_dropped() -> None:
    mesh = tube_mesh()
    network = trace_isocurves(mesh, np.full_like(mesh.vertices, 0.5))
    assert count_nodes(network) == {
        NodeKind.INTERIOR: 0,
        NodeKind.BOUNDARY: 0,
        NodeKind.FEATURE: 4,
        NodeKind.CORNER: 0,
    }
    assert [len(c.nodes) for c in network.curves] == [1] * 4
    assert all(c.closed and (network.members[c.members] == c.nodes).all() for c in network.curves)
    np.testing.assert_array_equal(np.diff(network.path_offsets), 23)
    # {r = a} alone: closed interior nothing, closed surface loops without any node.
    r = np.hypot(*mesh.vertices.T[:2])
    levels = np.stack([4 * r + 0.5, np.full_like(r, 0.5), np.full_like(r, 0.5)], axis=1)
    assert len(trace_isocurves(mesh, levels).curves) == 4


def test_ball_has_no_features_and_all_its_surface_curves_close() -> None:
    mesh = ball_mesh()
    assert len(mesh.feature_edges) == 0
    levels = 3.1 * mesh.vertices @ Rotation.from_rotvec([0.3, -0.5, 0.9]).as_matrix().T + 0.2
    network = trace_isocurves(mesh, levels)
    check_network(network)
    on_surface = [c for c in network.curves if c.kind is CurveKind.BOUNDARY]
    assert on_surface
    assert all(c.closed for c in on_surface)
    assert {c.kind for c in network.curves} == {CurveKind.INTERIOR, CurveKind.BOUNDARY}


def test_curve_without_an_interior_node_has_one_member() -> None:
    mesh = box_mesh((2, 2, 2))
    levels = mesh.vertices * [1, 1, 0.1] + [0.5, 0.5, 0.5]
    network = trace_isocurves(mesh, levels)
    check_network(network)
    (curve,) = (c for c in network.curves if c.kind is CurveKind.INTERIOR)
    assert (curve.isovalues, len(curve.members), curve.closed) == ((1, 1, None), 1, False)
    assert (network.node_kinds[curve.nodes] == NodeKind.BOUNDARY).all()
    np.testing.assert_allclose(network.nodes[curve.nodes], [[0.5, 0.5, 0], [0.5, 0.5, 1]], atol=5e-6)


def test_corner_angle_decides_where_a_bent_feature_ends() -> None:
    """The rims of a tube with 24 chords bend by 15 degrees."""
    mesh = tube_mesh()
    levels = np.full_like(mesh.vertices, 0.5)
    network = trace_isocurves(mesh, levels, options=IsocurveOptions(corner_angle=np.deg2rad(14)))
    assert count_nodes(network)[NodeKind.CORNER] == 4 * 24
    assert count_nodes(trace_isocurves(mesh, levels))[NodeKind.CORNER] == 0


# --- what holds for every map ----------------------------------------------------------------------------------------


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(["normal", "integer", "half", "flat", "line", "constant"]))
def test_any_map_gives_a_sound_network(seed: int, kind: str) -> None:
    rng = np.random.default_rng(seed)
    mesh = box_mesh((2, 2, 1), (2.0, 2.0, 1.0))
    levels = rng.normal(size=mesh.vertices.shape) * rng.choice([0.3, 1.0, 2.0])
    if kind == "integer":
        levels = np.round(levels)
    elif kind == "half":
        levels = np.round(2 * levels) / 2
    elif kind == "flat":
        levels[:, 2] = levels[:, 0] + levels[:, 1]
    elif kind == "line":
        levels = np.repeat(levels[:, :1], 3, axis=1)
    elif kind == "constant":
        levels = np.repeat(np.round(levels[:1]), len(levels), axis=0)
    network = trace_isocurves(mesh, levels)
    check_network(network)
    check_on_isosurfaces(mesh, levels, network)
    if kind in ("flat", "line", "constant"):
        # The image has no volume (that of "flat" may be entered by rounding to the grid).
        assert kind == "flat" or count_nodes(network)[NodeKind.INTERIOR] == 0


def test_identity_with_every_vertex_on_integers() -> None:
    """All predicates are ties: a layer lies on, or just below, each of three faces."""
    mesh = box_mesh((3, 3, 3), (3.0, 3.0, 3.0))
    network = trace_isocurves(mesh, mesh.vertices)
    check_network(network)
    check_on_isosurfaces(mesh, mesh.vertices, network)
    assert count_nodes(network)[NodeKind.INTERIOR] == 27
    np.testing.assert_array_equal(np.unique(network.node_levels[network.node_kinds == 0]), [1, 2, 3])


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_numbering_of_vertices_and_tets_does_not_matter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mesh = box_mesh((2, 3, 2), (2.0, 3.0, 2.0))
    levels = mesh.vertices @ rng.normal(size=(3, 3)) + rng.normal(size=mesh.vertices.shape) * 0.3
    order = rng.permutation(len(levels))
    tets = np.argsort(order)[mesh.tets][rng.permutation(len(mesh.tets))]
    tets = np.take_along_axis(tets, np.argsort(rng.random(tets.shape), axis=1), axis=1)
    a = trace_isocurves(mesh, levels)
    b = trace_isocurves(TetMesh(mesh.vertices[order], tets), levels[order])
    np.testing.assert_array_equal(a.node_kinds, b.node_kinds)
    np.testing.assert_allclose(a.nodes, b.nodes, atol=1e-9)
    np.testing.assert_array_equal(a.members, b.members)
    np.testing.assert_array_equal(a.path_offsets, b.path_offsets)
    np.testing.assert_allclose(a.path_points, b.path_points, atol=1e-9)
    assert [c.name for c in a.curves] == [c.name for c in b.curves]


def test_moving_the_part_moves_the_network() -> None:
    mesh = box_mesh((3, 2, 2), (3.0, 2.0, 2.0))
    levels = mesh.vertices * 1.3 + np.sin(mesh.vertices[:, [1, 2, 0]])
    Q = Rotation.from_rotvec([0.2, 1.1, -0.6]).as_matrix()
    a = trace_isocurves(mesh, levels)
    b = trace_isocurves(TetMesh(10 * mesh.vertices @ Q.T + 3, mesh.tets), levels)
    interior = a.node_kinds == NodeKind.INTERIOR
    np.testing.assert_allclose(10 * a.nodes[interior] @ Q.T + 3, b.nodes[interior], atol=1e-9)
    assert Counter((c.kind, c.isovalues, c.family) for c in a.curves) == Counter(
        (c.kind, c.isovalues, c.family) for c in b.curves
    )


@pytest.mark.parametrize("shared", [1, 2])
def test_parts_that_touch_in_a_point_or_along_an_edge(shared: int) -> None:
    mesh = hinged_mesh(shared)
    levels = 7 * mesh.vertices + 0.3
    network = trace_isocurves(mesh, levels)
    check_network(network)
    check_on_isosurfaces(mesh, levels, network)


# --- refusals --------------------------------------------------------------------------------------------------------


def test_bad_input_is_refused() -> None:
    mesh = box_mesh((1, 1, 1))
    with pytest.raises(InvalidInputError, match="levels must have shape"):
        trace_isocurves(mesh, mesh.vertices[:-1])
    with pytest.raises(InvalidInputError, match="finite"):
        trace_isocurves(mesh, np.full_like(mesh.vertices, np.nan))
    with pytest.raises(InvalidInputError, match="once each"):
        trace_isocurves(mesh, mesh.vertices, ("tension", "tension", "third"))
    with pytest.raises(InvalidInputError, match="corner_angle"):
        IsocurveOptions(corner_angle=0.0)
