"""Read-only arrays: the values of the package are frozen, and so is the data that they hold."""

from typing import Any

import numpy as np
from jaxtyping import Int

from michell_cad.errors import InvalidInputError


def frozen(array: Any, dtype: Any = None) -> np.ndarray:
    """Return a read-only C-contiguous copy of `array`; itself if neither it nor what it views is writeable."""
    if isinstance(array, np.ndarray) and array.flags.c_contiguous and not array.flags.writeable:
        owner = array if array.base is None else array.base
        if isinstance(owner, np.ndarray) and not owner.flags.writeable and owner.base is None:
            if dtype is None or array.dtype == dtype:
                return array
    copy = np.array(array, dtype=dtype, order="C", copy=True)
    copy.flags.writeable = False
    return copy


def freeze(value: Any, **dtypes: Any) -> None:
    """Replace the named fields of a frozen dataclass `value` by read-only copies of the given dtypes.

    To be called from ``__post_init__``.
    """
    for name, dtype in dtypes.items():
        object.__setattr__(value, name, frozen(getattr(value, name), dtype))


def require(condition: Any, message: str) -> None:
    """Raise `InvalidInputError` with `message` unless `condition` holds."""
    if not bool(condition):
        raise InvalidInputError(message)


def expand(counts: Int[np.ndarray, " n"]) -> tuple[Int[np.ndarray, " m"], Int[np.ndarray, " m"]]:
    """Number of the owner, and running number within the owner, of ``counts[k]`` items for each owner k."""
    owner = np.repeat(np.arange(len(counts)), counts)
    ends = np.cumsum(counts)
    return owner, np.arange(len(owner)) - (ends - counts)[owner]


def same_as_previous(rows: np.ndarray) -> np.ndarray:
    """Whether each row of a table but the first equals the one before (compared column by column, for speed)."""
    same = np.ones(max(len(rows) - 1, 0), bool)
    for column in rows.T:
        same &= column[1:] == column[:-1]
    return same
