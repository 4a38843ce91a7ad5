"""How the kernels of this package are compiled: loops over tets that NumPy would take dozens of passes for."""

from collections.abc import Callable
from inspect import unwrap
from typing import Any

import numba

_REORDER = {"contract", "reassoc", "arcp", "nsz"}
"""What the compiler may do to sums, products and quotients, but not to inf and NaN."""


def compiled(function: Callable[..., Any], reorder: bool = False, inline: bool = False) -> Callable[..., Any]:
    """Compile a function of arrays and numbers on its first call; the machine code is kept on disk.

    Division by zero gives inf or NaN as in NumPy. Kernels carry no shapes in their signatures: the checker that wraps
    the package's functions while tests run cannot be compiled, so the plain function is.

    Parameters
    ----------
    function : of arrays and numbers.
    reorder : whether sums may be reordered and products fused: a quarter faster, and right for energies, never for
        exact predicates.
    inline : whether it becomes part of the compiled functions that call it.
    """
    options: dict[str, Any] = {"fastmath": _REORDER} if reorder else {}
    plain = unwrap(function)
    return numba.njit(cache=True, error_model="numpy", inline="always" if inline else "never", **options)(plain)
