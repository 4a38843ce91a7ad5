"""The design curve of every member, as points at equal arc length and directions at its two nodes.

This is all that the solid needs to know of a curve, so that any spline representation can stand behind it.
"""

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from michell_cad.arrays import freeze, require
from michell_cad.compiled import compiled
from michell_cad.splines import MemberSplines

SAMPLES = 17
"""Points per member: a cubic through four neighbours then errs by less than 3e-6 of the length of a quarter circle.
Members of more than four pieces take more, as many for all members."""

PIECES = 4


@dataclass(frozen=True, eq=False)
class Centerlines:
    """Design curves of the members, oriented from the first node to the second.

    Parameters
    ----------
    points : (n_m, k, 3) float, mm, at equal arc length; the first and the last are the nodes of the member.
    directions : (n_m, 2, 3) float, unit vectors tangent to the curve that point from each node into the member.
    """

    points: Float[np.ndarray, "n_m k 3"]
    directions: Float[np.ndarray, "n_m 2 3"]

    def __post_init__(self) -> None:
        freeze(self, points=np.float64, directions=np.float64)
        require(np.isfinite(self.points).all(), "the points of a centre line must be finite")
        error = np.abs(np.linalg.norm(self.directions, axis=2) - 1)
        require((error < 1e-9).all(), "the directions of a centre line must be unit vectors")

    @cached_property
    def lengths(self) -> Float[np.ndarray, " n_m"]:
        """Lengths along the curves, mm."""
        return np.linalg.norm(np.diff(self.points, axis=1), axis=2).sum(1)

    def at(self, s: Float[np.ndarray, "n_m j"]) -> Float[np.ndarray, "n_m j 3"]:
        """Points at the fractions `s` of arc length, by the cubic through the four nearest samples."""
        return points_at(self.points, s)

    def slopes_at(self, s: Float[np.ndarray, "n_m j"]) -> Float[np.ndarray, "n_m j 3"]:
        """Unit tangents at the fractions `s` of arc length, from the first node to the second."""
        slopes = points_at(self.points, s, slope=True)
        return slopes / np.linalg.norm(slopes, axis=2, keepdims=True)


def points_at(
    points: Float[np.ndarray, "n k 3"], s: Float[np.ndarray, "n j"], slope: bool = False
) -> Float[np.ndarray, "n j 3"]:
    """Points, or derivatives, of the cubics through the four samples nearest to the fractions `s` of each row."""
    found = np.empty((*s.shape, 3))
    fill_points(points, s, slope, found)
    return found


def _point_at(points: Any, s: float, slope: bool, target: Any) -> None:
    """Write the point at the fraction s of a row of samples (k, 3), or the derivative by the number of the sample."""
    k = len(points)
    x = min(max(s, 0.0), 1.0) * (k - 1)
    first = min(max(int(np.floor(x)) - 1, 0), k - 4)
    t = x - first
    if slope:
        a = -((t - 2) * (t - 3) + (t - 1) * (t - 3) + (t - 1) * (t - 2)) / 6
        b = ((t - 2) * (t - 3) + t * (t - 3) + t * (t - 2)) / 2
        c = -((t - 1) * (t - 3) + t * (t - 3) + t * (t - 1)) / 2
        d = ((t - 1) * (t - 2) + t * (t - 2) + t * (t - 1)) / 6
    else:
        a, b = -(t - 1) * (t - 2) * (t - 3) / 6, t * (t - 2) * (t - 3) / 2
        c, d = -t * (t - 1) * (t - 3) / 2, t * (t - 1) * (t - 2) / 6
    for i in range(3):
        target[i] = (
            a * points[first, i] + b * points[first + 1, i] + c * points[first + 2, i] + d * points[first + 3, i]
        )


def _fill_points(points: Any, s: Any, slope: bool, found: Any) -> None:
    """`point_at` of row n of points (n, k, 3) at each of s (n, j)."""
    for n in range(s.shape[0]):
        for j in range(s.shape[1]):
            point_at(points[n], s[n, j], slope, found[n, j])


point_at = compiled(_point_at)
fill_points = compiled(_fill_points)


def samples_of(splines: MemberSplines) -> int:
    """Points per member that the curves of a truss need."""
    most = int(np.diff(splines.offsets).max())
    return (SAMPLES - 1) * -(-most // PIECES) + 1


def sample_splines(splines: MemberSplines, samples: int | None = None) -> Centerlines:
    """Centre lines of the design curves of a truss, by `samples_of` points unless told."""
    samples = samples_of(splines) if samples is None else samples
    ends = splines.tangents(np.array([0.0, 1.0]))
    return Centerlines(splines.positions(np.linspace(0, 1, samples)), ends * np.array([1.0, -1.0])[:, None])


SMOOTHINGS = (4, 16, 64, 0)
"""Passes of (1/4, 1/2, 1/4) over the samples of a curve, one number after the other until its tube is not pinched; 0
stands for the straight chord. On 17 samples 16 passes take a seventh of the rise of a half wave."""


def smooth_curves(points: Float[np.ndarray, "n k 3"], step: Int[np.ndarray, " n"]) -> Float[np.ndarray, "n k 3"]:
    """Curves smoothed by the first so many of `SMOOTHINGS`; their ends stay."""
    smooth = np.array(points)
    count = points.shape[1]
    for number in np.unique(step).tolist():
        some = step == number
        smooth[some] = np.einsum("jk,nkd->njd", _smoothing(count, SMOOTHINGS[number - 1]), points[some])
    return smooth


@cache
def _smoothing(count: int, passes: int) -> np.ndarray:
    """Matrix of so many passes over samples, for 17 samples; finer samples take more passes."""
    if not passes:
        s = np.linspace(0, 1, count)
        chord = np.zeros((count, count))
        chord[:, 0], chord[:, -1] = 1 - s, s
        return chord
    once = np.eye(count) / 2 + np.eye(count, k=1) / 4 + np.eye(count, k=-1) / 4
    once[[0, -1]] = np.eye(count)[[0, -1]]
    return np.linalg.matrix_power(once, passes * ((count - 1) // (SAMPLES - 1)) ** 2)
