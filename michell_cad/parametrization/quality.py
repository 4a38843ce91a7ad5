"""Whether a parametrization is injective, locally: positive determinants, and edges that wind once."""

import numpy as np
from jaxtyping import Float

from michell_cad.tet_mesh import _LOCAL_EDGES, TetMesh

_OPPOSITE = np.array([[2, 3], [1, 3], [1, 2], [0, 3], [0, 2], [0, 1]])
"""The two other vertices of a tet, for each of its edges."""

WINDING_TOLERANCE = 1e-3
"""Radians by which the angles around an edge may miss 2 pi; a doubly wound edge misses it by 2 pi."""


def count_double_wound_edges(mesh: TetMesh, phi: Float[np.ndarray, "n_v 3"]) -> int:
    """Count interior edges around which the dihedral angles, measured in phi-space, do not sum to 2 pi.

    With all determinants positive the sum is a multiple of 2 pi: 4 pi where the map winds around the edge twice, which
    no determinant shows.
    """
    y = phi[mesh.tets]
    axis = y[:, _LOCAL_EDGES[:, 1]] - y[:, _LOCAL_EDGES[:, 0]]
    axis = axis / np.maximum(np.linalg.norm(axis, axis=2, keepdims=True), np.finfo(float).tiny)
    sides = y[:, _OPPOSITE] - y[:, _LOCAL_EDGES[:, 0]][:, :, None]
    sides = sides - np.einsum("tesd,ted->tes", sides, axis)[..., None] * axis[:, :, None]
    cross = np.linalg.norm(np.cross(sides[:, :, 0], sides[:, :, 1]), axis=2)
    angles = np.arctan2(cross, np.einsum("ted,ted->te", sides[:, :, 0], sides[:, :, 1]))
    total = np.bincount(mesh.tet_edges.ravel(), angles.ravel(), len(mesh.edges))
    n_v = len(mesh.vertices)
    boundary = np.isin(mesh.edges @ [n_v, 1], mesh.boundary_edges @ [n_v, 1])
    return int((np.abs(total[~boundary] - 2 * np.pi) > WINDING_TOLERANCE).sum())
