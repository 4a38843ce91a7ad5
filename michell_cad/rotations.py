"""Rotations of three-space, vectorised: the exponential map and its derivative."""

import numpy as np
from jaxtyping import Float

_SMALL_ANGLE = 1e-4
"""Below this angle (radians) the Taylor series are exact to double precision: their next terms are below 1e-16."""


def rotation_matrix(w: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3 3"]:
    """Matrix exponential of [w]_x (Rodrigues): R = I + a [w]_x + b [w]_x^2, a = sin t / t, b = (1 - cos t) / t^2."""
    a, b = _coefficients(w)
    x, y, z = w[..., 0], w[..., 1], w[..., 2]
    R = np.empty((*w.shape, 3))
    R[..., 0, 0] = 1 - b * (y * y + z * z)
    R[..., 1, 1] = 1 - b * (x * x + z * z)
    R[..., 2, 2] = 1 - b * (x * x + y * y)
    for i, j, component in ((1, 0, z), (0, 2, y), (2, 1, x)):
        symmetric = b * w[..., i] * w[..., j]
        R[..., i, j] = symmetric + a * component
        R[..., j, i] = symmetric - a * component
    return R


def rotate_back(w: Float[np.ndarray, "*n 3"], v: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
    """J' v with the right Jacobian J of the exponential map: the gradient by w of a function of R = exp [w]_x.

    v is its gradient by d under R -> R exp [d]_x, and J = I - b [w]_x + e [w]_x^2 with b = (1 - cos t) / t^2,
    e = (t - sin t) / t^3, t = |w|.
    """
    a, b = _coefficients(w)
    t2 = np.einsum("...i,...i->...", w, w)
    small = t2 < _SMALL_ANGLE**2
    e = np.where(small, 1 / 6 - t2 / 120, (1 - a) / np.where(small, 1.0, t2))
    c = np.cross(w, v)
    return v + b[..., None] * c + e[..., None] * np.cross(w, c)


def _coefficients(w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    t2 = np.einsum("...i,...i->...", w, w)
    t = np.sqrt(t2)
    small = t < _SMALL_ANGLE
    t, t2_safe = np.where(small, 1.0, t), np.where(small, 1.0, t2)
    a = np.where(small, 1 - t2 / 6, np.sin(t) / t)
    b = np.where(small, 0.5 - t2 / 24, (1 - np.cos(t)) / t2_safe)
    return a, b
