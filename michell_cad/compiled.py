"""How the kernels of this package are compiled: loops over tets that NumPy would take dozens of passes for."""

from collections.abc import Callable
from inspect import unwrap
from typing import Any

import numba


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function of arrays and numbers on its first call; the machine code is kept on disk.

    Divisions by zero give inf or NaN as in NumPy. The compiler may reorder sums and fuse products, which takes a
    quarter off, but has to keep inf and NaN. Kernels carry no shapes in their signatures: the checker that wraps the
    package's functions while tests run cannot be compiled, so the plain function is.
    """
    fast = {"contract", "reassoc", "arcp", "nsz"}
    return numba.njit(cache=True, error_model="numpy", fastmath=fast)(unwrap(function))
