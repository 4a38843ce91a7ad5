"""Loads and supports of the part, carried over to the nodes of the truss.

Every force on a vertex of the mesh goes to the nearest nodes as the forces of least weighted norm that have the same
resultant force and moment: the rigid spider of finite-element codes ("RBE3"),

    f_i = w_i (f + omega x (x_i - c)) / sum w,   c = sum w x / sum w,   J omega = (x - c) x f,

J the inertia of the weighted nodes about c. So the resultant of every load case is exact to rounding, and its
distribution follows the part's within a cell. Moments that forces on nodes in a line cannot make go to the nodes as
moments, which rigid joints take.

The displacement of a point of the part is interpolated from the vertices of its tet. A node is held where that
interpolation is zero because its vertices are held, and cannot turn where the held vertices around cannot.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float, Int
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from michell_cad.arrays import freeze, require
from michell_cad.problem import DesignProblem
from michell_cad.rigid_motions import RANK_TOLERANCE, rigid_motions
from michell_cad.rotations import rotation_matrix
from michell_cad.tet_mesh import TetMesh
from michell_cad.truss import Truss

NODES_PER_VERTEX = 8
"""Nodes that share the force on a vertex: the corners of a cell."""

REACH = 1.25
"""The weight (1 - d / d0)^2 of a node at distance d falls to zero at d0, this times the distance of the farthest of
`NODES_PER_VERTEX`; so the share of a node changes little as it falls out of the nearest."""

FLAT = 1e-2
"""Moments about an axis about which the nodes have less than this inertia (relative to the largest) become nodal
moments: nodes in a line, with a tenth of its length as the lever, would need forces ten times the load's."""

ON_VERTICES = 1e-3
"""A vertex whose barycentric coordinate at a node is smaller than this does not move the node (relative to 1)."""

NODES_PER_REGION = 3
"""A held region that no node lies on holds so many of the nodes nearest to its vertices."""

OFF_AXIS_DEGREES = 5.0
"""Default tilt of loads: what a hand or a bolt misses by."""

CANDIDATES = 32
"""Tets whose centroids are nearest to a node and are tried first for holding it."""


@dataclass(frozen=True, eq=False)
class TrussLoading:
    """Supports and load cases at the nodes of a truss.

    Parameters
    ----------
    held : (n_n, 6) bool: which displacements and rotations are zero.
    forces : (n_c, n_n, 6) float: force, N, and moment, N mm, on every node.
    names : of the load cases.
    weights : (n_c,) float, the cases' weights in a sum of compliances.
    """

    held: Bool[np.ndarray, "n_n 6"]
    forces: Float[np.ndarray, "n_c n_n 6"]
    names: tuple[str, ...]
    weights: Float[np.ndarray, " n_c"]

    def __post_init__(self) -> None:
        freeze(self, held=bool, forces=np.float64, weights=np.float64)
        n_c = len(self.names)
        require(n_c, "a loading needs at least one load case")
        shape = (n_c, len(self.held), 6)
        require(self.forces.shape == shape, f"forces must have shape {shape}, found {self.forces.shape}")
        require(self.weights.shape == (n_c,), f"weights must have shape ({n_c},), found {self.weights.shape}")
        require(np.isfinite(self.forces).all(), "the forces on a truss must be finite")
        require((self.weights > 0).all(), "the weights of load cases must be positive")
        for name, force in zip(self.names, self.forces, strict=True):
            require(
                (force[~self.held] != 0).any(),
                f"load case {name!r} acts on no node that is free to move: use a larger resolution or a smaller "
                "spacing, or load faces farther from the held ones",
            )


def carry_over_loads(problem: DesignProblem, truss: Truss) -> TrussLoading:
    """Supports and load cases of a part at the nodes of its truss.

    Loads of a problem that combines its cases by "sum" act at once and become one case.

    Raises
    ------
    InvalidInputError
        If a load case acts on held nodes only.
    """
    require(len(truss.members), "the truss has no members to carry a load")
    names, forces, weights = acting_cases(problem)
    used = np.unique(truss.members)
    carried = np.zeros((len(forces), len(truss.nodes), 6))
    carried[:, used] = spread_forces(problem.mesh.vertices, forces, truss.nodes[used])
    return TrussLoading(held_nodes(problem, truss), carried, names, weights)


def acting_cases(
    problem: DesignProblem,
) -> tuple[tuple[str, ...], Float[np.ndarray, "n_c n_v 3"], Float[np.ndarray, " n_c"]]:
    """Names, forces on the vertices of the part, N, and weights of the load cases; those that act at once as one."""
    cases = problem.load_cases
    names, weights = tuple(case.name for case in cases), np.array([case.weight for case in cases])
    forces = np.array([case.force for case in cases])
    if problem.combination == "sum":
        return (" + ".join(names),), np.einsum("c,cvd->vd", weights, forces)[None], np.ones(1)
    return names, forces, weights


def add_off_axis_cases(loading: TrussLoading, degrees: float = OFF_AXIS_DEGREES) -> TrussLoading:
    """The load cases, and each of them again tilted by an angle to four sides: no load is quite where it should be.

    Forces and moments on the nodes keep their size and turn about two axes normal to each other and to the main
    direction of the forces (the principal axis of sum f f', which a couple has, too), both ways. Each case shares its
    weight with its four tilted ones. An angle of zero returns the loading as it is.

    Raises
    ------
    InvalidInputError
        For an angle outside of [0, 90).
    """
    require(0 <= degrees < 90, f"degrees must lie in [0, 90), found {degrees}")
    if degrees == 0:
        return loading
    angle = np.deg2rad(degrees)
    forces, names = [], []
    for name, force in zip(loading.names, loading.forces, strict=True):
        f, m = force[:, :3], force[:, 3:]
        main = np.linalg.eigh(f.T @ f if f.any() else m.T @ m)[1][:, 2]
        first = np.cross(np.eye(3)[np.abs(main).argmin()], main)
        first /= np.linalg.norm(first)
        forces.append(force)
        names.append(name)
        for axis in (first, np.cross(main, first)):
            for sign, word in ((1, "+"), (-1, "-")):
                turn = rotation_matrix((sign * angle * axis)[None])[0]
                forces.append(np.concatenate([f @ turn.T, m @ turn.T], axis=1))
                names.append(f"{name}, {word}{degrees:g} degrees about ({', '.join(f'{x:.2g}' for x in axis + 0.0)})")
    return TrussLoading(loading.held, np.array(forces), tuple(names), np.repeat(loading.weights / 5, 5))


def spread_forces(
    points: Float[np.ndarray, "n_v 3"], forces: Float[np.ndarray, "n_c n_v 3"], nodes: Float[np.ndarray, "n_n 3"]
) -> Float[np.ndarray, "n_c n_n 6"]:
    """Forces and moments on the nodes with the resultant force and moment of the forces at the points, case by case."""
    loaded = (forces != 0).any((0, 2))
    x, f = points[loaded], forces[:, loaded]
    distance, near = KDTree(nodes).query(x, k=min(NODES_PER_VERTEX, len(nodes)))
    distance, near = distance.reshape(len(x), -1), near.reshape(len(x), -1)
    w = (1 - distance / (REACH * np.maximum(distance[:, -1:], np.finfo(float).tiny))) ** 2
    w /= w.sum(1, keepdims=True)
    centre = np.einsum("vi,vid->vd", w, nodes[near])
    r = nodes[near] - centre[:, None]
    squares = np.einsum("vi,vid,vie->vde", w, r, r)
    J = np.trace(squares, axis1=1, axis2=2)[:, None, None] * np.eye(3) - squares
    values, axes = np.linalg.eigh(J)
    solid = values > FLAT * values[:, -1:]
    inverse = np.where(solid, 1 / np.where(solid, values, 1), 0)
    moment = np.einsum("vda,cvd->cva", axes, np.cross(x - centre, f))
    omega = np.einsum("vda,cva->cvd", axes, inverse * moment)
    left = np.einsum("vda,cva->cvd", axes, np.where(solid, 0, moment))
    on_nodes = np.concatenate(
        [f[:, :, None] + np.cross(omega[:, :, None], r), np.broadcast_to(left[:, :, None], (len(f), *r.shape))], axis=-1
    )
    result = np.zeros((len(nodes), len(forces), 6))
    np.add.at(result, near, np.moveaxis(w[:, :, None] * on_nodes, 0, 2))
    return result.swapaxes(0, 1)


def held_nodes(problem: DesignProblem, truss: Truss) -> Bool[np.ndarray, "n_n 6"]:
    """Which displacements and rotations of the nodes the held vertices of the part prevent.

    Rotations are held about global axes only: of those held about an oblique line, none of which is such an axis, none.
    """
    mesh, fixed = problem.mesh, problem.fixed
    used = np.unique(truss.members)
    tets, barycentric = locate(mesh, truss.nodes[used])
    moves = barycentric > ON_VERTICES
    held = np.zeros((len(truss.nodes), 6), bool)
    held[used, :3] = (fixed[mesh.tets[tets]] | ~moves[:, :, None]).all(1)
    # The held vertices on which each held node lies.
    below = {node: mesh.tets[t][on] for node, t, on in zip(used.tolist(), tets, moves, strict=True) if held[node].any()}
    some = np.asarray(fixed.any(1))
    neighbours = _held_edges(mesh, some)
    for region in _regions(neighbours, some):
        if not any(np.isin(vertices, region).any() for vertices in below.values()):
            distance, vertex = map(np.asarray, KDTree(mesh.vertices[region]).query(truss.nodes[used]))
            for k in np.argsort(distance, kind="stable")[:NODES_PER_REGION]:
                below[int(used[k])] = region[[vertex[k]]]
                held[used[k], :3] |= fixed[region[vertex[k]]]
    for node, vertices in below.items():
        around = np.unique(np.concatenate([vertices, *(neighbours[[v]].indices for v in vertices)]))
        held[node, 3:] = _held_rotations(mesh.vertices[around] - truss.nodes[node], fixed[around])
    return held


def locate(mesh: TetMesh, points: Float[np.ndarray, "n 3"]) -> tuple[Int[np.ndarray, " n"], Float[np.ndarray, "n 4"]]:
    """The tet that holds each point (the nearest to holding it) and the point's barycentric coordinates there."""

    def barycentric(tets: np.ndarray, x: np.ndarray) -> np.ndarray:
        return 0.25 + np.einsum("...ad,...d->...a", mesh.hat_gradients[tets], x - mesh.centroids[tets])

    near = KDTree(mesh.centroids).query(points, k=min(CANDIDATES, len(mesh.tets)))[1].reshape(len(points), -1)
    best = barycentric(near, points[:, None]).min(2).argmax(1)
    tets = near[np.arange(len(points)), best]
    for missed in np.flatnonzero(barycentric(tets, points).min(1) < -ON_VERTICES):
        every = np.arange(len(mesh.tets))
        tets[missed] = barycentric(every, points[missed]).min(1).argmax()
    return tets, barycentric(tets, points)


def _held_edges(mesh: TetMesh, held: np.ndarray) -> sp.csr_matrix:
    """Edges of the mesh between held vertices, both ways."""
    i, j = mesh.edges[held[mesh.edges].all(1)].T
    ones = np.ones(2 * len(i))
    return sp.csr_matrix((ones, (np.concatenate([i, j]), np.concatenate([j, i]))), shape=(len(held),) * 2)


def _regions(edges: sp.csr_matrix, held: np.ndarray) -> list[np.ndarray]:
    """Vertices of every connected held region."""
    labels = connected_components(edges, directed=False)[1]
    return [np.flatnonzero(held & (labels == label)) for label in np.unique(labels[held])]


def _held_rotations(x: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    """Rotations about the global axes through the origin that points with these held components prevent."""
    rows = rigid_motions(x / max(np.abs(x).max(), np.finfo(float).tiny))[fixed]
    values, vectors = np.linalg.eigh(rows.T @ rows)
    free = vectors[:, values <= RANK_TOLERANCE * values.max()]
    return np.linalg.norm(free[3:], axis=1) <= RANK_TOLERANCE**0.5
