"""Splines through given points at fixed places: the fits that stand for curves in the parameters of a surface.

All fits work on [0, 1] and are stretched to the range of their edge. A fit is one constant matrix, so that thousands of
curves are fitted in one product.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int
from scipy.interpolate import BSpline

from michell_cad.arrays import freeze


@dataclass(frozen=True, eq=False)
class Fit:
    """Interpolation by a spline of the given degree at the given places, with averaged knots (de Boor)."""

    degree: int
    places: Float[np.ndarray, " k"]

    def __post_init__(self) -> None:
        freeze(self, places=np.float64)

    @cached_property
    def knots(self) -> Float[np.ndarray, " k_degree_1"]:
        """Clamped knots on [0, 1]."""
        p, x = self.degree, self.places
        inner = np.array([x[i + 1 : i + 1 + p].mean() for i in range(len(x) - p - 1)])
        return np.concatenate([np.zeros(p + 1), inner, np.ones(p + 1)])

    @cached_property
    def to_poles(self) -> Float[np.ndarray, "k k"]:
        """Matrix from points at the places to poles."""
        return np.linalg.inv(BSpline.design_matrix(self.places, self.knots, self.degree).toarray())

    @cached_property
    def between(self) -> Float[np.ndarray, " j"]:
        """Places at which the deviation of a fit is measured."""
        return (self.places[1:] + self.places[:-1]) / 2

    @cached_property
    def _at_between(self) -> np.ndarray:
        return BSpline.design_matrix(self.between, self.knots, self.degree).toarray()

    def halfway(self, poles: Float[np.ndarray, "n k d"]) -> Float[np.ndarray, "n j d"]:
        """Points of the splines at `between`."""
        return np.einsum("xp,npd->nxd", self._at_between, poles)


@dataclass(frozen=True, eq=False)
class Fitted:
    """Fitted curves: the number in `FITS` of each, the poles by fit (in the order of the curves), deviations in mm."""

    fit: Int[np.ndarray, " n"]
    poles: list[Float[np.ndarray, "_ _ 2"]]
    deviation: Float[np.ndarray, " n"]


def _even(n: int) -> np.ndarray:
    """Places in [0, 1], denser towards the ends, where a spline errs most."""
    x = np.linspace(0, 1, n)
    return 0.7 * x + 0.3 * (1 - np.cos(np.pi * x)) / 2


FITS = (
    Fit(9, (1 - np.cos(np.pi * np.arange(10) / 9)) / 2),
    *(Fit(7, _even(n)) for n in (15, 19, 23, 27, 33, 43)),
)
"""From the smallest, one polynomial, to the finest. The kernel's check takes time in proportion to their points."""

FINE_ENOUGH = 3e-5
"""A finer fit is taken where a fit misses its curve by more (relative to the radius of the surface)."""


def fit_polynomials(
    locate: Callable[[Float[np.ndarray, " k"]], Float[np.ndarray, "n k 2"]],
) -> Fitted:
    """The first of `FITS` through curves that are nearly polynomials; `locate` gives points at places in [0, 1]."""
    one = FITS[0]
    poles = np.einsum("px,nxd->npd", one.to_poles, locate(one.places))
    missed = np.abs(one.halfway(poles) - locate(one.between)).max((1, 2))
    return Fitted(np.zeros(len(poles), int), [poles], missed)


def fit_sines(
    t_range: Float[np.ndarray, "n 2"],
    middle: Float[np.ndarray, " n"],
    sign: Float[np.ndarray, " n"],
    size: Float[np.ndarray, " n"],
) -> Fitted:
    """(angle, height) = (middle + sign t, size cos t) for t in a range below pi: an ellipse seen from its cylinder."""

    def locate(x: np.ndarray) -> np.ndarray:
        t = t_range[:, :1] + (t_range[:, 1:] - t_range[:, :1]) * x
        return np.stack([middle[:, None] + sign[:, None] * t, size[:, None] * np.cos(t)], axis=-1)

    return fit_polynomials(locate)
