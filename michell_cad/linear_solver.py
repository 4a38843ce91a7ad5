"""Sparse symmetric positive definite systems: one factorisation, many solves.

MKL Pardiso (through pypardiso) where its wheels exist, SciPy's SuperLU elsewhere; nobody else in the package knows
which.
"""

import copy
import os
import time
from functools import cache
from typing import Any, Protocol, runtime_checkable

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from threadpoolctl import ThreadpoolController

from michell_cad.errors import ConvergenceError

try:
    from pypardiso.pardiso_wrapper import PyPardisoError, PyPardisoSolver
except ModuleNotFoundError:  # no wheel for this platform, see pyproject.toml
    PyPardisoSolver = None

PARALLEL_UNKNOWNS = 200_000
"""Systems of at least this many unknowns are factorised by all processors; smaller ones take under a second by one."""

_POSITIVE_DEFINITE = 2
"""Pardiso's matrix type `mtype` for real symmetric positive definite matrices."""
_ANALYSE_AND_FACTORISE, _SOLVE, _RELEASE = 12, 33, -1
"""Pardiso's phases."""


@runtime_checkable
class Factor(Protocol):
    """A factorised matrix."""

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solve A x = b for one right-hand side (n,) or several (n, k)."""
        ...


class _PardisoFactor:
    def __init__(self, A: sp.csr_matrix) -> None:
        # A copy of one template, with state of its own: making a solver searches the disk for the library, 0.3 s.
        self._solver: Any = copy.copy(_pardiso_template())
        for name in ("pt", "iparm", "perm"):
            setattr(self._solver, name, np.zeros_like(getattr(self._solver, name)))
        # Pardiso takes the upper triangle; 32-bit indices are the interface's only form.
        self._upper = sp.csr_matrix(sp.triu(A, format="csr"))
        self._upper.sort_indices()
        self._solver.set_phase(_ANALYSE_AND_FACTORISE)
        _mkl_threads(None if self._upper.get_shape()[0] >= PARALLEL_UNKNOWNS else 1)
        try:
            self._solver._call_pardiso(self._upper, np.zeros((self._upper.get_shape()[0], 1)))
        except PyPardisoError as error:
            raise ConvergenceError(_not_definite(str(error))) from error
        finally:
            _mkl_threads(1)

    def solve(self, b: np.ndarray) -> np.ndarray:
        self._solver.set_phase(_SOLVE)
        x = self._solver._call_pardiso(self._upper, np.asfortranarray(b.reshape(len(b), -1)))
        return np.ascontiguousarray(x).reshape(b.shape)

    def __del__(self) -> None:
        # Pardiso owns the factor outside Python; without this phase its memory lives until the process ends.
        solver = getattr(self, "_solver", None)
        if solver is not None:
            solver.set_phase(_RELEASE)
            try:
                solver._call_pardiso(sp.csr_matrix((0, 0)), np.zeros((0, 1)))
            except (PyPardisoError, ValueError, TypeError):  # at interpreter shutdown the library may be gone already
                return


@cache
def _pardiso_template() -> Any:
    assert PyPardisoSolver is not None  # factorise asks before
    template = PyPardisoSolver(mtype=_POSITIVE_DEFINITE)
    _mkl_threads(1)
    return template


def _mkl_threads(count: int | None) -> None:
    """Set the number of MKL's threads (None: one for each processor).

    One for all solves: they are memory-bound and short, and threads that wait for each other between them cost ten
    times their work as soon as anything else runs on the machine.
    """
    ThreadpoolController().select(internal_api="mkl").limit(limits=count or os.cpu_count())


class _SuperLUFactor:
    def __init__(self, A: sp.csr_matrix) -> None:
        try:
            # A symmetric mode ordering, without pivoting: the matrix is positive definite.
            self._lu = spla.splu(
                sp.csc_matrix(A), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
            )
        except RuntimeError as error:
            raise ConvergenceError(_not_definite(str(error))) from error

    def solve(self, b: np.ndarray) -> np.ndarray:
        return self._lu.solve(np.ascontiguousarray(b))


def factorise(A: sp.spmatrix) -> Factor:
    """Factorise a symmetric positive definite sparse matrix.

    Raises
    ------
    ConvergenceError
        If the matrix is not positive definite to working precision.
    """
    A = sp.csr_matrix(A)
    return _SuperLUFactor(A) if PyPardisoSolver is None else _PardisoFactor(A)


def solver_name() -> str:
    """Name of the direct solver in use, for the report."""
    return "SuperLU" if PyPardisoSolver is None else "MKL Pardiso"


def measure_factorisation(A: sp.spmatrix, b: np.ndarray) -> tuple[Factor, np.ndarray, float]:
    """Factorise, solve once and say how many CPU seconds of this process both took (the report's `solver_unit_s`)."""
    if PyPardisoSolver is not None:
        _pardiso_template()  # loading the library is no part of a factorisation
    start = time.process_time()
    factor = factorise(A)
    x = factor.solve(b)
    return factor, x, time.process_time() - start


def _not_definite(detail: str) -> str:
    return (
        "the system is not positive definite to working precision; the mesh may hold slivers or parts that hang "
        f"together at a point only. Mend the mesh or choose another mesh size ({detail})"
    )
