"""Vectors of three numbers in compiled loops; numba's own `cross` and `dot` take seconds to compile."""

from typing import Any

import numpy as np

from michell_cad.compiled import compiled


def _dot(a: Any, b: Any) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Any, b: Any, target: Any) -> None:
    """Write a x b; the target is neither of them."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        target[i] = a[j] * b[k] - a[k] * b[j]


def _triple(a: Any, b: Any, c: Any) -> float:
    """(a x b) . c"""
    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    return x * c[0] + y * c[1] + z * c[2]


def _normalise(a: Any) -> None:
    """Make a vector a unit vector."""
    size = np.sqrt(a[0] ** 2 + a[1] ** 2 + a[2] ** 2)
    for i in range(3):
        a[i] /= size


def _distance(a: Any, b: Any) -> float:
    return np.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


dot = compiled(_dot)
cross = compiled(_cross)
triple = compiled(_triple)
normalise = compiled(_normalise)
distance = compiled(_distance)
