"""The part of a stress that has directions, and when it has none."""

import numpy as np
from jaxtyping import Float

ISOTROPIC = 1e-9
"""Differences of principal stresses below this fraction of the largest stress of the part are rounding: the tet has no
direction to follow."""


def deviator(stress: Float[np.ndarray, "n_t 3 3"]) -> Float[np.ndarray, "n_t 3 3"]:
    """dev sigma = sigma - tr(sigma)/3 I per tet; exactly zero where it is rounding, see `ISOTROPIC`."""
    result = stress - np.einsum("tii->t", stress)[:, None, None] / 3 * np.eye(3)
    result[np.linalg.norm(result, axis=(1, 2)) <= ISOTROPIC * np.abs(stress).max(initial=0.0)] = 0
    return result
