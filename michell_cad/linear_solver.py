"""Sparse symmetric positive definite systems: one factorisation, many solves.

MKL Pardiso (through pypardiso) where its wheels exist, SciPy's SuperLU elsewhere, and algebraic multigrid for what
would not fit in memory; nobody else in the package knows which.
"""

import ctypes
import os
import time
from functools import cache
from typing import Any, Protocol, runtime_checkable

import numpy as np
import psutil
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from threadpoolctl import ThreadpoolController

from michell_cad.errors import ConvergenceError
from michell_cad.multigrid import MultigridSolver

try:
    from pypardiso.pardiso_wrapper import PyPardisoSolver
except ModuleNotFoundError:  # no wheel for this platform, see pyproject.toml
    PyPardisoSolver = None

MEMORY_SHARE = 0.6
"""A factor may take this much of the memory that is free; the other stages need about as much as a fifth of it."""

PARALLEL_UNKNOWNS = 200_000
"""Systems of at least this many unknowns are factorised by all processors; smaller ones take under a second by one."""

_POSITIVE_DEFINITE = 2
"""Pardiso's matrix type `mtype` for real symmetric positive definite matrices."""
_ANALYSE, _FACTORISE, _SOLVE, _RELEASE = 11, 22, 33, -1
"""Pardiso's phases."""
_ANALYSIS_PEAK, _ANALYSIS_STAYS, _FACTOR = 14, 15, 16
"""Places in `iparm`, from 0, of memory in kB: of the analysis, of what it leaves, of the factor."""
_OWN_SETTINGS, _ORDERING_METHOD, _ORDERING_USE = 0, 1, 4
"""Places in Pardiso's `iparm`, from 0: whether it holds settings, which ordering to compute, and how to use `perm`."""
_NESTED_DISSECTION, _TAKE_ORDERING, _GIVE_ORDERING = 2, 1, 2


@runtime_checkable
class Factor(Protocol):
    """A factorised matrix."""

    @property
    def ordering(self) -> np.ndarray | None:
        """The fill-reducing permutation of the rows, for another matrix with the same pattern; None where the solver
        keeps it to itself.
        """
        ...

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solve A x = b for one right-hand side (n,) or several (n, k)."""
        ...


class _PardisoFactor:
    """A factor that MKL owns; called directly, as pypardiso's own call converts the indices anew for every solve."""

    def __init__(self, A: sp.csr_matrix, ordering: np.ndarray | None) -> None:
        upper = sp.csr_matrix(sp.triu(A, format="csr"))  # all that Pardiso takes of a symmetric matrix
        upper.sort_indices()
        self._n = upper.get_shape()[0]
        self._values = np.asarray(upper.data, np.float64)
        self._rows, self._columns = (1 + array.astype(np.int32) for array in (upper.indptr, upper.indices))
        self._handle, self._settings = np.zeros(64, np.int64), np.zeros(64, np.int32)
        self._settings[_OWN_SETTINGS], self._settings[_ORDERING_METHOD] = 1, _NESTED_DISSECTION
        self._settings[_ORDERING_USE] = _GIVE_ORDERING if ordering is None else _TAKE_ORDERING
        self.ordering = np.zeros(self._n, np.int32) if ordering is None else ordering
        _pardiso()
        _mkl_threads(None if self._n >= PARALLEL_UNKNOWNS else 1)
        try:
            self._call(_ANALYSE, np.zeros(1), np.zeros(1), 1)
            analysis, stays, factor = 1024 * self._settings[[_ANALYSIS_PEAK, _ANALYSIS_STAYS, _FACTOR]].astype(int)
            self.memory = int(max(analysis, stays + factor))
            """Bytes that the analysis foresees."""
            if self.memory > MEMORY_SHARE * free_memory():
                raise MemoryError(f"the factor needs {self.memory / 1e9:.1f} GB")
            self._call(_FACTORISE, np.zeros(1), np.zeros(1), 1)
        finally:
            _mkl_threads(1)

    def solve(self, b: np.ndarray) -> np.ndarray:
        right = np.array(b.reshape(len(b), -1), np.float64, order="F")
        x = np.empty_like(right, order="F")
        self._call(_SOLVE, right, x, right.shape[1])
        return np.ascontiguousarray(x).reshape(b.shape)

    def _call(self, phase: int, b: np.ndarray, x: np.ndarray, columns: int) -> None:
        error = ctypes.c_int32(0)
        _pardiso()(
            _pointer(self._handle),
            _integer(1),  # factors kept in this handle,
            _integer(1),  # and which of them
            _integer(_POSITIVE_DEFINITE),
            _integer(phase),
            _integer(self._n),
            *map(_pointer, (self._values, self._rows, self._columns, self.ordering)),
            _integer(columns),
            _pointer(self._settings),
            _integer(0),  # no messages
            *map(_pointer, (b, x)),
            ctypes.byref(error),
        )
        if error.value:
            raise ConvergenceError(_not_definite(f"Pardiso's error {error.value}"))

    def __del__(self) -> None:
        # Pardiso owns the factor outside Python; without this phase its memory lives until the process ends.
        if hasattr(self, "ordering"):
            try:
                self._call(_RELEASE, np.zeros(1), np.zeros(1), 1)
            except (ConvergenceError, TypeError, AttributeError, ImportError):
                return  # at shutdown the library may be gone already


def _pointer(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def _integer(value: int) -> Any:
    return ctypes.byref(ctypes.c_int32(value))


@cache
def _pardiso() -> Any:
    """MKL's entry point; making pypardiso's solver searches the disk for the library, 0.3 s."""
    assert PyPardisoSolver is not None  # factorise asks before
    library: Any = PyPardisoSolver(mtype=_POSITIVE_DEFINITE).libmkl
    entry = library["pardiso"]
    entry.restype = None
    _mkl_threads(1)
    return entry


def _mkl_threads(count: int | None) -> None:
    """Set the number of MKL's threads (None: one for each processor).

    One for all solves: they are memory-bound and short, and threads that wait for each other between them cost ten
    times their work as soon as anything else runs on the machine.
    """
    _mkl().limit(limits=count or os.cpu_count())


@cache
def _mkl() -> ThreadpoolController:
    """The threads of MKL, once it is loaded; looking for it again and again costs a millisecond."""
    return ThreadpoolController().select(internal_api="mkl")


class _SuperLUFactor:
    ordering = None

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


def factorise(A: sp.spmatrix, ordering: np.ndarray | None = None, modes: np.ndarray | None = None) -> Factor:
    """Factorise a symmetric positive definite sparse matrix.

    A matrix whose factor would take more than `MEMORY_SHARE` of the free memory is solved by multigrid instead, with a
    relative residual of `multigrid.TOLERANCE`. (Only Pardiso foresees the size of its factor.)

    Parameters
    ----------
    A : (n, n) sparse.
    ordering : the `ordering` of a factor of a matrix with the same pattern, if there is one. For scalar equations on a
        mesh finding an ordering costs several times what the rest of the factorisation does.
    modes : (n, k) for multigrid, see there.

    Raises
    ------
    ConvergenceError
        If the matrix is not positive definite to working precision.
    """
    A = sp.csr_matrix(A)
    if PyPardisoSolver is None:
        return _SuperLUFactor(A)
    try:
        return _PardisoFactor(A, ordering)
    except MemoryError:
        return MultigridSolver(A, modes)


def free_memory() -> int:
    """Bytes that programs can still take without swapping."""
    return psutil.virtual_memory().available


def solver_name() -> str:
    """Name of the direct solver in use, for the report."""
    return "SuperLU" if PyPardisoSolver is None else "MKL Pardiso"


def measure_factorisation(
    A: sp.spmatrix, b: np.ndarray, modes: np.ndarray | None = None
) -> tuple[Factor, np.ndarray, float]:
    """Factorise, solve once and say how many CPU seconds of this process both took (the report's `solver_unit_s`)."""
    if PyPardisoSolver is not None:
        _pardiso()  # loading the library is no part of a factorisation
    start = time.process_time()
    factor = factorise(A, modes=modes)
    x = factor.solve(b)
    return factor, x, time.process_time() - start


def _not_definite(detail: str) -> str:
    return (
        "the system is not positive definite to working precision; the mesh may hold slivers or parts that hang "
        f"together at a point only. Mend the mesh or choose another mesh size ({detail})"
    )
