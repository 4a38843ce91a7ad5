"""Quadratic tets: ten nodes, the last six on the edges, which may be curved.

Nodes are ordered as CalculiX's C3D10 and Abaqus have them: the four corners, then the middles of the edges 01, 12, 20,
03, 13, 23 (Zienkiewicz and Taylor, The Finite Element Method, vol. 1, Section 8.13 for the shape functions).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from michell_cad.arrays import freeze, frozen, require
from michell_cad.tet_mesh import TetMesh

EDGES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])
"""Corners at the ends of the edges on which nodes 4 to 9 lie."""

FACES = np.array([[1, 2, 3, 5, 9, 8], [0, 3, 2, 7, 9, 6], [0, 1, 3, 4, 8, 7], [0, 2, 1, 6, 5, 4]])
"""Face opposite to each corner: its corners, counter-clockwise from outside, and the nodes on its edges 01, 12, 20."""

_A, _B = 0.58541019662496845446, 0.13819660112501051518
GAUSS_POINTS = np.array([[_B, _B, _B], [_A, _B, _B], [_B, _A, _B], [_B, _B, _A]])
"""Local coordinates (the last three barycentric ones) of the rule of degree 2 with four equal weights (Keast 1986)."""

LEAST_JACOBIAN = 0.1
"""Least determinant at a corner or Gauss point, over that of the straight tet: below, its edges stay straight."""


def shape_gradients(local: Float[np.ndarray, "k 3"]) -> Float[np.ndarray, "k 10 3"]:
    """Derivatives of the ten shape functions by the local coordinates: corners l (2 l - 1), edges 4 l_a l_b."""
    barycentric = np.concatenate([1 - local.sum(1, keepdims=True), local], axis=1)
    D = np.concatenate([-np.ones((1, 3)), np.eye(3)])
    corners = (4 * barycentric - 1)[:, :, None] * D
    a, b = EDGES.T
    edges = 4 * (barycentric[:, a, None] * D[b] + barycentric[:, b, None] * D[a])
    return np.concatenate([corners, edges], axis=1)


@dataclass(frozen=True, eq=False)
class QuadraticMesh:
    """A mesh of quadratic tets.

    Parameters
    ----------
    nodes : (n_p, 3) float, mm.
    tets : (n_t, 10) int.

    Raises
    ------
    InvalidInputError
        If a tet turns inside out at a Gauss point.
    """

    nodes: Float[np.ndarray, "n_p 3"]
    tets: Int[np.ndarray, "n_t 10"]

    def __post_init__(self) -> None:
        freeze(self, nodes=np.float64, tets=np.int64)
        require(len(self.tets), "a mesh needs at least one tet")
        require(
            self.tets.min() >= 0 and self.tets.max() < len(self.nodes),
            f"tets must index the {len(self.nodes)} nodes, found {self.tets.min()} to {self.tets.max()}",
        )
        bad = np.flatnonzero(self.determinants(GAUSS_POINTS).min(1) <= 0)
        require(not len(bad), f"{len(bad)} of {len(self.tets)} quadratic tets turn inside out, first {bad[:1]}")

    def determinants(self, local: Float[np.ndarray, "k 3"]) -> Float[np.ndarray, "n_t k"]:
        """det dx/dl at local coordinates of every tet: six volumes of a straight one."""
        J = np.einsum("kai,tad->tkdi", shape_gradients(local), self.nodes[self.tets], optimize=True)
        return np.linalg.det(J)

    @cached_property
    def volumes(self) -> Float[np.ndarray, " n_t"]:
        """By the four-point rule, mm^3."""
        return frozen(self.determinants(GAUSS_POINTS).sum(1) / 24)

    @cached_property
    def boundary(self) -> Int[np.ndarray, "n_b 6"]:
        """Faces of one tet only: three corners, counter-clockwise from outside, and the nodes on their edges."""
        faces = self.tets[:, FACES].reshape(-1, 6)
        corners = np.sort(faces[:, :3], axis=1)
        n = len(self.nodes)
        _, first, count = np.unique(
            (corners[:, 0] * n + corners[:, 1]) * n + corners[:, 2], return_index=True, return_counts=True
        )
        return frozen(faces[np.sort(first[count == 1])])


def quadratic_mesh(mesh: TetMesh, onto: Callable[[np.ndarray], np.ndarray] | None = None) -> QuadraticMesh:
    """Quadratic tets of a mesh of straight ones.

    Parameters
    ----------
    mesh : TetMesh
    onto : moves points (k, 3) to the surface that the boundary stands for; the nodes on the boundary's edges go there,
        but for edges of tets that would nearly turn inside out.
    """
    n_v = len(mesh.vertices)
    keys = mesh.edges @ [n_v, 1]
    ends = np.sort(mesh.tets[:, EDGES], axis=2) @ [n_v, 1]
    tets = np.concatenate([mesh.tets, n_v + np.searchsorted(keys, ends)], axis=1)
    nodes = np.concatenate([mesh.vertices, mesh.vertices[mesh.edges].mean(1)])
    if onto is None:
        return QuadraticMesh(nodes, tets)
    curved = n_v + np.searchsorted(keys, mesh.boundary_edges @ [n_v, 1])
    target = nodes.copy()
    target[curved] = onto(nodes[curved])
    return QuadraticMesh(_curve_where_sound(nodes, target, tets, 6 * mesh.volumes), tets)


def _curve_where_sound(nodes: np.ndarray, target: np.ndarray, tets: np.ndarray, six_volumes: np.ndarray) -> np.ndarray:
    """Nodes moved to their targets; those of tets that would nearly turn inside out stay."""
    local = np.concatenate([np.zeros((1, 3)), np.eye(3), GAUSS_POINTS])
    gradients = shape_gradients(local)
    free = (target != nodes).any(1)
    touched = np.flatnonzero(free[tets].any(1))
    while True:
        new = np.where(free[:, None], target, nodes)
        J = np.einsum("kai,tad->tkdi", gradients, new[tets[touched]], optimize=True)
        bad = np.linalg.det(J).min(1) < LEAST_JACOBIAN * six_volumes[touched]
        stay = np.unique(tets[touched[bad]])
        if not free[stay].any():
            return new
        free[stay] = False
