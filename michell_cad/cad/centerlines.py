"""The design curve of every member, as points at equal arc length and directions at its two nodes.

This is all that the solid needs to know of a curve, so that any spline representation can stand behind it.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from michell_cad.arrays import freeze, require
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
        n_m, k, _ = self.points.shape
        x = np.clip(s, 0, 1) * (k - 1)
        first = np.clip(np.floor(x).astype(int) - 1, 0, k - 4)
        t = x - first
        weights = (
            -(t - 1) * (t - 2) * (t - 3) / 6,
            t * (t - 2) * (t - 3) / 2,
            -t * (t - 1) * (t - 3) / 2,
            t * (t - 1) * (t - 2) / 6,
        )
        rows = np.arange(n_m)[:, None]
        return np.sum([w[..., None] * self.points[rows, first + i] for i, w in enumerate(weights)], axis=0)


def samples_of(splines: MemberSplines) -> int:
    """Points per member that the curves of a truss need."""
    most = int(np.diff(splines.offsets).max())
    return (SAMPLES - 1) * -(-most // PIECES) + 1


def sample_splines(splines: MemberSplines, samples: int | None = None) -> Centerlines:
    """Centre lines of the design curves of a truss, by `samples_of` points unless told."""
    samples = samples_of(splines) if samples is None else samples
    ends = splines.tangents(np.array([0.0, 1.0]))
    return Centerlines(splines.positions(np.linspace(0, 1, samples)), ends * np.array([1.0, -1.0])[:, None])


def straight_centerlines(
    nodes: Float[np.ndarray, "n_n 3"], members: Int[np.ndarray, "n_m 2"], samples: int = SAMPLES
) -> Centerlines:
    """Centre lines that are the straight chords between the nodes."""
    a, b = nodes[members[:, 0]], nodes[members[:, 1]]
    s = np.linspace(0, 1, samples)[:, None]
    chord = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
    return Centerlines(a[:, None] * (1 - s) + b[:, None] * s, np.stack([chord, -chord], axis=1))
