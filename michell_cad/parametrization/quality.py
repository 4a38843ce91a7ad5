"""Whether a parametrization is injective, locally: positive determinants, and edges that wind once."""

from typing import Any

import numpy as np
from jaxtyping import Float

from michell_cad.compiled import compiled
from michell_cad.tet_mesh import TetMesh

WINDING_TOLERANCE = 1e-3
"""Radians by which the angles around an edge may miss 2 pi; a doubly wound edge misses it by 2 pi."""


def count_double_wound_edges(mesh: TetMesh, phi: Float[np.ndarray, "n_v 3"]) -> int:
    """Count interior edges around which the dihedral angles, measured in phi-space, do not sum to 2 pi.

    With all determinants positive the sum is a multiple of 2 pi: 4 pi where the map winds around the edge twice, which
    no determinant shows.
    """
    total = np.zeros(len(mesh.edges))
    _add_angles(mesh.tets, mesh.tet_edges, phi, total)
    wrong = np.abs(total - 2 * np.pi) > WINDING_TOLERANCE
    wrong[mesh.boundary_edge_numbers] = False
    return int(wrong.sum())


def _add_dihedral_angles(tets: Any, tet_edges: Any, phi: Any, total: Any) -> None:
    """Add the dihedral angles of all tets of the map phi to those of their edges (01, 02, 03, 12, 13, 23)."""
    corners = np.array([[0, 1, 2, 3], [0, 2, 1, 3], [0, 3, 1, 2], [1, 2, 0, 3], [1, 3, 0, 2], [2, 3, 0, 1]])
    axis, left, right = np.empty(3), np.empty(3), np.empty(3)
    for t in range(len(tets)):
        for e in range(6):
            a, b, c, d = (
                tets[t, corners[e, 0]],
                tets[t, corners[e, 1]],
                tets[t, corners[e, 2]],
                tets[t, corners[e, 3]],
            )
            for i in range(3):
                axis[i], left[i], right[i] = phi[b, i] - phi[a, i], phi[c, i] - phi[a, i], phi[d, i] - phi[a, i]
            # With u the axis: |u| sin and cos of the angle between u x left and u x right, both times the same factor.
            uu = axis[0] ** 2 + axis[1] ** 2 + axis[2] ** 2
            ul = axis[0] * left[0] + axis[1] * left[1] + axis[2] * left[2]
            ur = axis[0] * right[0] + axis[1] * right[1] + axis[2] * right[2]
            lr = left[0] * right[0] + left[1] * right[1] + left[2] * right[2]
            det = (
                axis[0] * (left[1] * right[2] - left[2] * right[1])
                + axis[1] * (left[2] * right[0] - left[0] * right[2])
                + axis[2] * (left[0] * right[1] - left[1] * right[0])
            )
            total[tet_edges[t, e]] += np.arctan2(np.sqrt(uu) * abs(det), uu * lr - ul * ur)


_add_angles = compiled(_add_dihedral_angles)
