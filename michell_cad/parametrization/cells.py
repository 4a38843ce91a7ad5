"""The cells of a map: their determinants, edges and directions, in one compiled pass over the tets."""

from typing import Any

import numpy as np
from jaxtyping import Float

from michell_cad.compiled import compiled


def measure_cells(
    jacobians: Float[np.ndarray, "n 3 3"],
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3 3"]]:
    """Determinants, edges and directions of the cells of unit isovalues in tets with the given Jacobians (rows g_i).

    The columns b_i of J^-1 follow from the cross products g_j x g_k = det J b_i. The edges are |b_i|, inf where
    det J = 0; the directions are columns, b_i / |b_i|, zero where g_j x g_k vanishes.
    """
    n = len(jacobians)
    determinants, edges, directions = np.empty(n), np.empty((n, 3)), np.empty((n, 3, 3))
    fill_cells(jacobians, determinants, edges, directions)
    return determinants, edges, directions


def _fill_cells(J: Any, determinants: Any, edges: Any, directions: Any) -> None:
    C = np.empty((3, 3))
    for t in range(len(J)):
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            for d in range(3):
                e, f = (d + 1) % 3, (d + 2) % 3
                C[i, d] = J[t, j, e] * J[t, k, f] - J[t, j, f] * J[t, k, e]
        determinant = J[t, 0, 0] * C[0, 0] + J[t, 0, 1] * C[0, 1] + J[t, 0, 2] * C[0, 2]
        determinants[t] = determinant
        for i in range(3):
            size = np.sqrt(C[i, 0] ** 2 + C[i, 1] ** 2 + C[i, 2] ** 2)
            edges[t, i] = size / abs(determinant) if determinant != 0 else np.inf
            factor = (-1.0 if determinant < 0 else 1.0) / size if size > 0 else 0.0
            for d in range(3):
                directions[t, d, i] = factor * C[i, d]


fill_cells = compiled(_fill_cells)
