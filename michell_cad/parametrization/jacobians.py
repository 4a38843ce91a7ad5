"""Jacobians of piecewise-linear maps, components first: J[i, d] is the row of all d phi_i / d x_d, one entry per tet.

NumPy then works on long contiguous rows, which for products of many 3 x 3 matrices is several times faster than a stack
of small matrices.
"""

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float

from michell_cad.tet_mesh import TetMesh

Components = Float[np.ndarray, "3 3 n"]


class MapDerivative:
    """The linear operator from vertex values phi (n_v, 3) to Jacobians (3, 3, n_t), and its transpose."""

    def __init__(self, mesh: TetMesh) -> None:
        self.n_t = len(mesh.tets)
        rows = np.arange(3 * self.n_t).reshape(self.n_t, 3).T.ravel()  # all d/dx, then all d/dy, then all d/dz
        self._operator = sp.csr_matrix(mesh.gradient_operator[rows])
        self._transpose = sp.csr_matrix(self._operator.T)

    def jacobians(self, phi: Float[np.ndarray, "n_v 3"]) -> Components:
        """J[i, d] = d phi_i / d x_d in each tet."""
        return np.ascontiguousarray((self._operator @ phi).reshape(3, self.n_t, 3).transpose(2, 0, 1))

    def pull_back(self, P: Components) -> Float[np.ndarray, "n_v 3"]:
        """Gradient with respect to phi of an energy whose gradient with respect to J is P."""
        return self._transpose @ np.ascontiguousarray(P.transpose(1, 2, 0)).reshape(3 * self.n_t, 3)


def product(A: np.ndarray, B: np.ndarray) -> Components:
    """Matrix products A B, one per tet."""
    C = np.empty((3, 3, A.shape[2]))
    for i in range(3):
        for j in range(3):
            np.multiply(A[i, 0], B[0, j], out=C[i, j])
            C[i, j] += A[i, 1] * B[1, j]
            C[i, j] += A[i, 2] * B[2, j]
    return C


def transposed(A: np.ndarray) -> np.ndarray:
    """Transposes, as a view."""
    return A.transpose(1, 0, 2)


def cofactors(J: Components) -> Components:
    """Cofactor matrices: the derivative of the determinant; their transpose over the determinant is the inverse."""
    C = np.empty_like(J)
    for i in range(3):
        a, b = J[(i + 1) % 3], J[(i + 2) % 3]
        for d in range(3):
            e, f = (d + 1) % 3, (d + 2) % 3
            np.multiply(a[e], b[f], out=C[i, d])
            C[i, d] -= a[f] * b[e]
    return C


def determinants(J: Components, C: Components) -> Float[np.ndarray, " n"]:
    """Determinants from the matrices and their cofactors."""
    return J[0, 0] * C[0, 0] + J[0, 1] * C[0, 1] + J[0, 2] * C[0, 2]
