"""Folded and degenerate maps on parts of every topology, against counts by brute force.

The counts use floating-point barycentric coordinates of integer points in the image of each tet and boundary triangle;
points too near to the rim of an image to be sure are neither demanded nor refused.
"""

from collections import Counter
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from networks import ball_mesh, check_network, check_on_isosurfaces, hinged_mesh, tube_mesh
from shapes import box_mesh, joined_boxes

from michell_cad.curves import NodeKind
from michell_cad.isocurves import CurveNetwork, trace_isocurves
from michell_cad.tet_mesh import TetMesh
from michell_cad.truss import clean_network

MESHES = {
    "box": box_mesh((2, 2, 1), (2.0, 2.0, 1.0)),
    "tube": tube_mesh(8, 1, 1),
    "ball": ball_mesh(2),
    "two parts": joined_boxes((0.0, 9.0, 0.0), (1, 1, 1), (1.0, 1.0, 1.0)),
    "touching in a point": hinged_mesh(1),
    "touching in an edge": hinged_mesh(2),
    "one tet": TetMesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), np.array([[0, 1, 2, 3]])),
}
UNSURE = 1e-4
"""Barycentric coordinates this near to zero are not decided here."""


def integer_points_inside(simplex: np.ndarray) -> tuple[set, set]:
    """Integer points inside the simplex with the given corners (k + 1, k): certainly, and perhaps."""
    low, high = np.floor(simplex.min(0)).astype(int) - 1, np.ceil(simplex.max(0)).astype(int) + 1
    points = np.array(list(product(*(range(a, b + 1) for a, b in zip(low, high, strict=True)))))
    edges = (simplex[1:] - simplex[0]).T
    if abs(np.linalg.det(edges)) < 1e-9:
        return set(), set(map(tuple, points.tolist()))
    rest = np.linalg.solve(edges, (points - simplex[0]).T).T
    least = np.minimum(rest.min(1), 1 - rest.sum(1))
    return (set(map(tuple, points[least > bound].tolist())) for bound in (UNSURE, -UNSURE))


def check_counts(mesh: TetMesh, levels: np.ndarray, network: CurveNetwork) -> int:
    """Each integer point in the image of a tet is one interior node, each pair in that of a boundary triangle one
    boundary node, and there is no other; returns the number of those that are certain."""
    found = Counter(
        map(tuple, network.node_levels[network.node_kinds == NodeKind.INTERIOR].round().astype(int).tolist())
    )
    sure, perhaps = Counter(), Counter()
    for tet in mesh.tets:
        certain, possible = integer_points_inside(levels[tet])
        sure.update(certain)
        perhaps.update(possible)
    assert sure <= found <= perhaps
    total = sum(sure.values())
    on_surface = (network.node_kinds == NodeKind.BOUNDARY).sum()
    counts = np.zeros(2, int)
    for triangle in mesh.boundary_triangles:
        for pair in ((0, 1), (0, 2), (1, 2)):
            counts += [len(points) for points in integer_points_inside(levels[triangle][:, pair])]
    assert counts[0] <= on_surface <= counts[1]
    return total + int(counts[0])


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(sorted(MESHES)), st.sampled_from([0.3, 1.0, 2.5]))
def test_random_maps_have_a_node_where_an_image_covers_an_integer_point(seed: int, name: str, size: float) -> None:
    """Half of the tets are inverted: a point that k images cover is k nodes."""
    mesh = MESHES[name]
    levels = size * np.random.default_rng(seed).normal(size=mesh.vertices.shape)
    network = trace_isocurves(mesh, levels)
    check_network(network)
    check_counts(mesh, levels, network)


def test_the_counts_are_not_empty() -> None:
    mesh = MESHES["box"]
    levels = 2.5 * np.random.default_rng(0).normal(size=mesh.vertices.shape)
    assert (np.linalg.det(mesh.gradients(levels)) < 0).mean() > 0.3
    assert check_counts(mesh, levels, trace_isocurves(mesh, levels)) > 200


DEGENERATE = ("constant coordinate", "plane", "line", "point", "integers", "some on integers", "grid", "mirrored")


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from(sorted(MESHES)),
    st.sampled_from(DEGENERATE),
    st.sampled_from([0.0, 1e-12, 1e-7]),
)
def test_degenerate_maps_give_sound_networks(seed: int, name: str, kind: str, noise: float) -> None:
    """Ties of all kinds, exact and within rounding; the curves are where they say, and the truss is one or refused."""
    rng = np.random.default_rng(seed)
    mesh = MESHES[name]
    levels = 2 * rng.normal(size=mesh.vertices.shape)
    if kind == "constant coordinate":
        levels[:, rng.integers(3)] = rng.integers(-1, 2)
    elif kind in ("plane", "line", "point"):
        rank = {"plane": 2, "line": 1, "point": 0}[kind]
        levels = levels[:, :rank] @ rng.integers(-2, 3, (rank, 3)) + rng.integers(-1, 2, 3)
    elif kind == "integers":
        levels = np.round(levels)
    elif kind == "some on integers":
        levels = np.where(rng.random(levels.shape) < 0.5, np.round(levels), levels)
    elif kind == "grid":
        levels = mesh.vertices @ np.diag(rng.integers(1, 4, 3))[rng.permutation(3)]
    elif kind == "mirrored":
        levels = np.abs(mesh.vertices - mesh.vertices.mean(0)) * 2
    levels = levels + noise * rng.normal(size=levels.shape)
    network = trace_isocurves(mesh, levels)
    check_network(network)
    check_on_isosurfaces(mesh, levels, network)
    if len(network.members):
        truss, _ = clean_network(network, 0.2)
        assert np.isfinite(truss.nodes).all()
        pairs = np.sort(truss.members, axis=1)
        assert len(np.unique(pairs, axis=0)) == len(pairs)


@pytest.mark.parametrize("noise", [1e-13, 1e-11])
def test_noise_of_a_solver_moves_no_node(noise: float) -> None:
    """Every vertex of a straight grid lies on integers: the network with noise is the one without."""
    mesh = box_mesh((3, 3, 3), (3.0, 3.0, 3.0))
    exact = trace_isocurves(mesh, mesh.vertices)
    noisy = trace_isocurves(mesh, mesh.vertices + noise * np.random.default_rng(0).normal(size=mesh.vertices.shape))
    for network in (exact, noisy):
        check_network(network)
    # The order of nodes, and of curves with the same isovalues, is that of levels, which noise may exchange in a tie.
    places = [Counter(map(tuple, np.round(n.nodes, 3).tolist())) for n in (exact, noisy)]
    assert places[0] == places[1]
    labels = [Counter((c.kind, c.family, c.isovalues, len(c.nodes)) for c in n.curves) for n in (exact, noisy)]
    assert labels[0] == labels[1]
