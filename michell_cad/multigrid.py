"""Algebraic multigrid for systems whose factor would not fit in memory: smoothed aggregation, by PyAMG.

Vanek, Mandel and Brezina 1996 (doi:10.1007/BF02238511), as the preconditioner of conjugate gradients. It needs memory
in proportion to the matrix, and at a million unknowns one solve costs less than a factorisation, but the smoothing of
the stress needs ten to twenty solves, where a factor wins as long as it fits.
"""

from typing import Any

import numpy as np
import pyamg
import scipy.sparse as sp

from michell_cad.errors import ConvergenceError

TOLERANCE = 1e-9
"""Relative residual of a solve: the smoothing of the stress stops at 1e-2, boundary forces are compared at 1e-6."""

MOST_ITERATIONS = 500
"""Thirty do on the paper's problems, some hundreds on meshes with slivers."""

_COARSEST = 500
"""Unknowns of the coarsest level, which is solved densely."""

_EVERY_COUPLING: Any = ("symmetric", {"theta": 0.0})
"""Strength of connection: the cells of a sliver mesh are stretched, but no direction is decoupled."""


class MultigridSolver:
    """Solves A x = b by conjugate gradients; has the face of a `linear_solver.Factor`.

    Parameters
    ----------
    A : (n, n) sparse, symmetric positive definite.
    modes : (n, k), the vectors that A nearly maps to zero (the rigid motions for elasticity); default: the constant.
    """

    ordering = None

    def __init__(self, A: sp.csr_matrix, modes: np.ndarray | None = None) -> None:
        modes = np.ones((A.get_shape()[0], 1)) if modes is None else modes
        self._levels = pyamg.smoothed_aggregation_solver(A, B=modes, strength=_EVERY_COUPLING, max_coarse=_COARSEST)

    def solve(self, b: np.ndarray) -> np.ndarray:
        columns = [self._solve(column) for column in b.reshape(len(b), -1).T]
        return np.stack(columns, axis=1).reshape(b.shape)

    def _solve(self, b: np.ndarray) -> np.ndarray:
        residuals: list[float] = []
        x = self._levels.solve(b, tol=TOLERANCE, maxiter=MOST_ITERATIONS, accel="cg", residuals=residuals)
        if residuals and not residuals[-1] <= 2 * TOLERANCE * np.linalg.norm(b):
            raise ConvergenceError(
                f"conjugate gradients with multigrid stopped at a residual of {residuals[-1]:.3g} after "
                f"{len(residuals) - 1} iterations (wanted {TOLERANCE * np.linalg.norm(b):.3g}); the mesh may hold "
                "slivers. Mend it, or use a larger mesh.size, for which a factor fits in memory"
            )
        return np.asarray(x)
