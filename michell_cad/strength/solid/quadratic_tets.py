"""Linear elasticity on quadratic tets, compiled: the stiffness matrix and the stresses.

    K_ab = sum over Gauss points of w (lambda g_a g_b' + mu g_b g_a' + mu (g_a . g_b) I)

with the gradients g of the shape functions in space and the weights w = det J / 24 of the four-point rule, which has as
many strains (24) as the element has ways to deform: no spurious modes. CalculiX's C3D10 has the same rule.
"""

from typing import Any

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float

from michell_cad.compiled import compiled
from michell_cad.elasticity import lame_parameters
from michell_cad.problem import Material
from michell_cad.strength.solid.quadratic_mesh import EDGES, GAUSS_POINTS, QuadraticMesh, shape_gradients


def stiffness_matrix(
    mesh: QuadraticMesh, material: Material, fixed: Bool[np.ndarray, "n_p 3"] | None = None
) -> sp.csr_matrix:
    """K, (3 n_p, 3 n_p), N/mm; component 3 p + d belongs to axis d of node p.

    Rows and columns of fixed components are those of a diagonal matrix: right-hand sides of 0 give displacements of 0,
    and nothing has to be renumbered.
    """
    n_p, n_t = len(mesh.nodes), len(mesh.tets)
    fixed = np.zeros((n_p, 3), bool) if fixed is None else fixed
    owner = sp.csr_matrix((np.ones(10 * n_t, np.int8), mesh.tets.ravel(), np.arange(0, 10 * n_t + 1, 10)), (n_t, n_p))
    pattern = sp.csr_matrix(owner.T @ owner)
    pattern.sort_indices()
    blocks = np.zeros((len(pattern.indices), 3, 3))
    lmbda, mu = lame_parameters(material)
    D, E = shape_gradients(GAUSS_POINTS), material.youngs_modulus
    add_stiffness(mesh.nodes, mesh.tets, D, lmbda, mu, E, fixed, pattern.indptr, pattern.indices, blocks)
    return sp.csr_matrix(sp.bsr_matrix((blocks, pattern.indices, pattern.indptr), shape=(3 * n_p, 3 * n_p)))


def gauss_stress(
    mesh: QuadraticMesh, material: Material, displacement: Float[np.ndarray, "n_p 3"]
) -> Float[np.ndarray, "n_t 4 3 3"]:
    """sigma = lambda tr(eps) I + 2 mu eps at the Gauss points of every tet, MPa."""
    lmbda, mu = lame_parameters(material)
    stress = np.empty((len(mesh.tets), 4, 3, 3))
    D = shape_gradients(GAUSS_POINTS)
    find_stress(mesh.nodes, mesh.tets, D, lmbda, mu, np.ascontiguousarray(displacement), stress)
    return stress


def nodal_stress(mesh: QuadraticMesh, stress: Float[np.ndarray, "n_t 4 3 3"]) -> Float[np.ndarray, "n_p 3 3"]:
    """Stress at the nodes: linear through the Gauss points of each tet, then the mean over the tets at a node."""
    barycentric = np.concatenate([1 - GAUSS_POINTS.sum(1, keepdims=True), GAUSS_POINTS], axis=1)
    corners = np.einsum("ag,tgij->taij", np.linalg.inv(barycentric), stress)
    every = np.concatenate([corners, corners[:, EDGES].mean(2)], axis=1)
    count = np.bincount(mesh.tets.ravel(), minlength=len(mesh.nodes))
    summed = [np.bincount(mesh.tets.ravel(), column, len(mesh.nodes)) for column in every.reshape(-1, 9).T]
    return (np.stack(summed, axis=1) / count[:, None]).reshape(-1, 3, 3)


def von_mises(stress: Float[np.ndarray, "*n 3 3"]) -> Float[np.ndarray, "*n"]:
    """(3/2 s : s)^(1/2) of the deviator s, MPa."""
    s = stress - np.trace(stress, axis1=-2, axis2=-1)[..., None, None] / 3 * np.eye(3)
    return np.sqrt(1.5 * (s**2).sum((-2, -1)))


def _space_gradients(X: Any, D: Any, g: Any) -> float:
    """Gradients in space of the ten shape functions into g (10, 3), from D by local coordinates; returns det dx/dl."""
    J = np.zeros((3, 3))
    for a in range(10):
        for i in range(3):
            for d in range(3):
                J[d, i] += X[a, d] * D[a, i]
    c00 = J[1, 1] * J[2, 2] - J[1, 2] * J[2, 1]
    c01 = J[1, 2] * J[2, 0] - J[1, 0] * J[2, 2]
    c02 = J[1, 0] * J[2, 1] - J[1, 1] * J[2, 0]
    det = J[0, 0] * c00 + J[0, 1] * c01 + J[0, 2] * c02
    C = np.empty((3, 3))  # cofactors: inv(J)' = C / det
    C[0, 0], C[0, 1], C[0, 2] = c00, c01, c02
    C[1, 0] = J[0, 2] * J[2, 1] - J[0, 1] * J[2, 2]
    C[1, 1] = J[0, 0] * J[2, 2] - J[0, 2] * J[2, 0]
    C[1, 2] = J[0, 1] * J[2, 0] - J[0, 0] * J[2, 1]
    C[2, 0] = J[0, 1] * J[1, 2] - J[0, 2] * J[1, 1]
    C[2, 1] = J[0, 2] * J[1, 0] - J[0, 0] * J[1, 2]
    C[2, 2] = J[0, 0] * J[1, 1] - J[0, 1] * J[1, 0]
    for a in range(10):
        for d in range(3):
            g[a, d] = (C[d, 0] * D[a, 0] + C[d, 1] * D[a, 1] + C[d, 2] * D[a, 2]) / det
    return det


space_gradients = compiled(_space_gradients, inline=True)


def _place(columns: Any, low: int, high: int, column: int) -> int:
    """Where a column stands among the sorted ones of its row, which has it."""
    while high - low > 1:
        middle = (low + high) // 2
        if columns[middle] <= column:
            low = middle
        else:
            high = middle
    return low


place = compiled(_place, inline=True)


def _add_stiffness(
    nodes: Any,
    tets: Any,
    D: Any,
    lmbda: float,
    mu: float,
    E: float,
    fixed: Any,
    starts: Any,
    columns: Any,
    blocks: Any,
) -> None:
    """Add the stiffness of every tet to the blocks (n, 3, 3) of the rows `starts` with the sorted `columns`.

    Rows and columns of fixed components are left out but for E on the diagonal.
    """
    X, g, K = np.empty((10, 3)), np.empty((10, 3)), np.empty((10, 10, 3, 3))
    for t in range(len(tets)):
        for a in range(10):
            for d in range(3):
                X[a, d] = nodes[tets[t, a], d]
        K[:] = 0
        for q in range(len(D)):
            w = space_gradients(X, D[q], g) / 24
            for a in range(10):
                for b in range(10):
                    dot = w * mu * (g[a, 0] * g[b, 0] + g[a, 1] * g[b, 1] + g[a, 2] * g[b, 2])
                    for i in range(3):
                        for j in range(3):
                            K[a, b, i, j] += w * (lmbda * g[a, i] * g[b, j] + mu * g[b, i] * g[a, j])
                        K[a, b, i, i] += dot
        for a in range(10):
            row = tets[t, a]
            for b in range(10):
                column = tets[t, b]
                block = blocks[place(columns, starts[row], starts[row + 1], column)]
                for i in range(3):
                    for j in range(3):
                        if not (fixed[row, i] or fixed[column, j]):
                            block[i, j] += K[a, b, i, j]
                        elif row == column and i == j:
                            block[i, j] = E


def _find_stress(nodes: Any, tets: Any, D: Any, lmbda: float, mu: float, u: Any, stress: Any) -> None:
    """sigma at the Gauss points of every tet into `stress` (n_t, k, 3, 3)."""
    X, g, H = np.empty((10, 3)), np.empty((10, 3)), np.empty((3, 3))
    for t in range(len(tets)):
        for a in range(10):
            for d in range(3):
                X[a, d] = nodes[tets[t, a], d]
        for q in range(len(D)):
            space_gradients(X, D[q], g)
            H[:] = 0
            for a in range(10):
                for i in range(3):
                    for j in range(3):
                        H[i, j] += u[tets[t, a], i] * g[a, j]
            pressure = lmbda * (H[0, 0] + H[1, 1] + H[2, 2])
            for i in range(3):
                for j in range(3):
                    stress[t, q, i, j] = mu * (H[i, j] + H[j, i])
                stress[t, q, i, i] += pressure


add_stiffness = compiled(_add_stiffness, reorder=True)
find_stress = compiled(_find_stress, reorder=True)
