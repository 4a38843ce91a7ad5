"""Whether a parametrization is injective, locally: positive determinants, and edges that wind once."""

import numpy as np
from jaxtyping import Float

from michell_cad.tet_mesh import _LOCAL_FACES, TetMesh

_OPPOSITE = np.array([[2, 3], [1, 3], [1, 2], [0, 3], [0, 2], [0, 1]])
"""The two other vertices of a tet, for each of its edges: the edge lies between the faces opposite to them."""

WINDING_TOLERANCE = 1e-3
"""Radians by which the angles around an edge may miss 2 pi; a doubly wound edge misses it by 2 pi."""


def count_double_wound_edges(mesh: TetMesh, phi: Float[np.ndarray, "n_v 3"]) -> int:
    """Count interior edges around which the dihedral angles, measured in phi-space, do not sum to 2 pi.

    With all determinants positive the sum is a multiple of 2 pi: 4 pi where the map winds around the edge twice, which
    no determinant shows.
    """
    normals, volumes = _area_vectors(np.ascontiguousarray(phi[mesh.tets].transpose(1, 2, 0)))
    angles = np.empty((6, len(mesh.tets)))
    ends = phi[mesh.edges]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    for edge, (a, b) in enumerate(_OPPOSITE):
        # |n_a x n_b| = 3/2 volume x length of the edge, without the cancellation of a cross product
        sine = 1.5 * volumes * lengths[mesh.tet_edges[:, edge]]
        angles[edge] = np.arctan2(sine, -np.einsum("dt,dt->t", normals[a], normals[b]))
    total = np.bincount(mesh.tet_edges.T.ravel(), angles.ravel(), len(mesh.edges))
    n_v = len(mesh.vertices)
    boundary = np.isin(mesh.edges @ [n_v, 1], mesh.boundary_edges @ [n_v, 1])
    return int((np.abs(total[~boundary] - 2 * np.pi) > WINDING_TOLERANCE).sum())


def _area_vectors(y: Float[np.ndarray, "4 3 n_t"]) -> tuple[Float[np.ndarray, "4 3 n_t"], Float[np.ndarray, " n_t"]]:
    """Area vectors of the faces opposite to each vertex, outwards for positive tets, and the unsigned volumes."""
    normals = np.stack([0.5 * _cross(y[j] - y[i], y[k] - y[i]) for i, j, k in _LOCAL_FACES])
    return normals, np.abs(np.einsum("dt,dt->t", normals[0], y[1] - y[0])) / 3


def _cross(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return np.stack([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]])
