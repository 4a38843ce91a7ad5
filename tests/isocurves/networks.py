"""Meshes, maps and checks that the tests of networks and trusses share."""

import numpy as np
from shapes import box_mesh

from michell_cad.curves import CurveKind, NodeKind
from michell_cad.isocurves import CurveNetwork
from michell_cad.isocurves.lattice import round_levels
from michell_cad.tet_mesh import TetMesh


def tube_mesh(around: int = 24, across: int = 3, high: int = 4) -> TetMesh:
    """A tube of inner radius 1, outer radius 2 and height 2, from a box rolled up (axis z)."""
    box = box_mesh((around, across, high), (1.0, 1.0, 2.0))
    t, s, z = box.vertices.T
    x = np.stack([(1 + s) * np.cos(2 * np.pi * t), -(1 + s) * np.sin(2 * np.pi * t), z], axis=1)
    _, first, inverse = np.unique(np.round(x, 9), axis=0, return_index=True, return_inverse=True)
    return TetMesh(x[first], inverse.ravel()[box.tets])


def ball_mesh(n: int = 8) -> TetMesh:
    """A ball of radius 1 without sharp edges: a cube, each shell of which is pushed onto a sphere."""
    box = box_mesh((n, n, n), (2.0, 2.0, 2.0))
    x = np.tan((box.vertices - 1) * np.pi / 4)
    size = np.linalg.norm(x, axis=1)
    scale = np.divide(np.abs(box.vertices - 1).max(1), size, out=np.zeros_like(size), where=size > 0)
    return TetMesh(scale[:, None] * x, box.tets)


def hinged_mesh(shared: int) -> TetMesh:
    """Two tets that share `shared` vertices (1: a point, 2: a hinge)."""
    a = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    b = {1: [[-1, 0, 0], [0, -1, 0], [0, 0, -1]], 2: [[0.2, -1, 0], [0.3, 0, -1]]}[shared]
    second = [0, 1][:shared] + list(range(4, 8 - shared))
    return TetMesh(np.concatenate([a, np.array(b, float)]), np.array([[0, 1, 2, 3], second]))


def deviation(mesh: TetMesh, levels: np.ndarray, points: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Largest difference to the wanted values (nan: any) at each point, in the best tet around it; inf outside."""
    offset = np.einsum("tkd,ntd->ntk", mesh.hat_gradients, points[:, None] - mesh.centroids[None]) + 0.25
    values = np.einsum("ntk,tki->nti", offset, levels[mesh.tets])
    difference = np.nan_to_num(np.abs(values - wanted[:, None])).max(2)
    return np.where(offset.min(2) > -1e-9, difference, np.inf).min(1)


def check_network(network: CurveNetwork) -> None:
    """What holds for every network of a manifold solid, whatever the map."""
    degrees = np.bincount(network.members.ravel(), minlength=len(network.nodes))
    kinds = network.node_kinds
    assert (degrees[kinds == NodeKind.INTERIOR] == 6).all()
    assert (degrees[kinds == NodeKind.BOUNDARY] == 5).all()
    assert (degrees[kinds == NodeKind.CORNER] >= 1).all()
    assert (degrees[kinds == NodeKind.FEATURE] >= 2).all()
    assert np.isfinite(network.nodes).all()
    assert np.isfinite(network.path_points).all()
    assert len(network.path_offsets) == len(network.members) + 1
    members = np.concatenate([np.zeros(0, int), *(curve.members for curve in network.curves)])
    assert (np.sort(members) == np.arange(len(network.members))).all()
    labels = {(curve.kind, curve.isovalues, curve.component) for curve in network.curves}
    assert len(labels) == len(network.curves)
    lowest = {CurveKind.INTERIOR: NodeKind.INTERIOR, CurveKind.BOUNDARY: NodeKind.BOUNDARY}
    ends = {
        CurveKind.INTERIOR: {NodeKind.BOUNDARY},
        CurveKind.BOUNDARY: {NodeKind.FEATURE},
        CurveKind.FEATURE: {NodeKind.CORNER},
    }
    for curve in network.curves:
        following = np.roll(curve.nodes, -1)[: len(curve.members)]
        assert (network.members[curve.members] == np.stack([curve.nodes[: len(following)], following], axis=1)).all()
        assert (kinds[curve.nodes] >= lowest.get(curve.kind, NodeKind.FEATURE)).all()
        assert len(np.unique(curve.nodes[1:])) == len(curve.nodes) - 1
        if curve.closed:
            assert curve.nodes[0] == curve.nodes.min()
            assert len(curve.nodes) < 3 or curve.nodes[1] < curve.nodes[-1]
        else:
            assert {NodeKind(kinds[node]) for node in curve.nodes[[0, -1]]} <= ends[curve.kind]
        for coordinate, value in enumerate(curve.isovalues):
            if value is not None:
                np.testing.assert_array_equal(network.node_levels[curve.nodes, coordinate], value)
        assert (curve.axis == -1) == (curve.kind is CurveKind.FEATURE)
        assert curve.axis == -1 or curve.isovalues[curve.axis] is None


def check_on_isosurfaces(mesh: TetMesh, levels: np.ndarray, network: CurveNetwork) -> None:
    """Nodes and path points have the values that the labels of their curves say, up to rounding to the grid."""
    tolerance = 2.5 / round_levels(levels, mesh.tets).cell
    points, wanted = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for curve in network.curves:
        paths = [slice(*network.path_offsets[member : member + 2]) for member in curve.members]
        points += [network.nodes[curve.nodes], *(network.path_points[path] for path in paths)]
        value = np.array([np.nan if v is None else v for v in curve.isovalues])
        wanted.append(np.tile(value, (sum(len(part) for part in points[-1 - len(paths) :]), 1)))
    assert deviation(mesh, levels, np.concatenate(points), np.concatenate(wanted)).max(initial=0) < tolerance
