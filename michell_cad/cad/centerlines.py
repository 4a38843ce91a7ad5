"""The design curve of every member, as points at equal arc length and directions at its two nodes.

This is all that the solid needs to know of a curve, so that any spline representation can stand behind it.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from michell_cad.arrays import freeze, require

SAMPLES = 33
"""Points per member: a cubic through four neighbours then errs by less than 1e-6 of the length of a quarter circle."""

PIECE_SAMPLES = 17
"""Points per Bezier piece in the table of arc lengths; the points themselves are evaluated on the curve."""


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
        return sum(w[..., None] * self.points[rows, first + i] for i, w in enumerate(weights))


def sample_bezier_members(
    control_points: Float[np.ndarray, "n_p 4 3"], offsets: Int[np.ndarray, " n_m1"]
) -> Centerlines:
    """Centre lines of members that are chains of cubic Bezier pieces; those of member m are ``offsets[m : m + 2]``."""
    n_m = len(offsets) - 1
    require(n_m == 0 or (np.diff(offsets) > 0).all(), "every member needs at least one Bezier piece")
    points = np.empty((n_m, SAMPLES, 3))
    count = np.diff(offsets)
    for q in np.unique(count):
        members = np.flatnonzero(count == q)
        pieces = control_points[offsets[members][:, None] + np.arange(q)]
        points[members] = _equal_arc_length(pieces)
    first, last = control_points[offsets[:-1]], control_points[offsets[1:] - 1][:, ::-1]
    directions = np.stack([_leaving(first), _leaving(last)], axis=1)
    return Centerlines(points, directions)


def straight_centerlines(
    nodes: Float[np.ndarray, "n_n 3"], members: Int[np.ndarray, "n_m 2"]
) -> Centerlines:
    """Centre lines that are the straight chords between the nodes."""
    a, b = nodes[members[:, 0]], nodes[members[:, 1]]
    s = np.linspace(0, 1, SAMPLES)[:, None]
    chord = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
    return Centerlines(a[:, None] * (1 - s) + b[:, None] * s, np.stack([chord, -chord], axis=1))


def _equal_arc_length(pieces: np.ndarray) -> np.ndarray:
    """Points at equal arc length on chains of q Bezier pieces, (n, q, 4, 3) -> (n, SAMPLES, 3)."""
    n, q = pieces.shape[:2]
    t = np.linspace(0, 1, PIECE_SAMPLES)
    dense = np.einsum("tk,nqkd->nqtd", _bernstein(t), pieces)
    steps = np.linalg.norm(np.diff(dense, axis=2), axis=3).reshape(n, -1)
    arc = np.concatenate([np.zeros((n, 1)), np.cumsum(steps, axis=1)], axis=1)
    parameter = np.linspace(0, q, q * (PIECE_SAMPLES - 1) + 1)
    s = np.linspace(0, 1, SAMPLES)
    where = np.array([np.interp(s * row[-1], row, parameter) for row in arc])
    piece = np.minimum(where.astype(int), q - 1)
    local = np.take_along_axis(pieces, piece[:, :, None, None], axis=1)
    return np.einsum("nsk,nskd->nsd", _bernstein(where - piece), local)


def _bernstein(t: np.ndarray) -> np.ndarray:
    return np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3], axis=-1)


def _leaving(pieces: np.ndarray) -> np.ndarray:
    """Unit tangent at the start of Bezier pieces: towards the first control point that differs from the start."""
    legs = pieces[:, 1:] - pieces[:, :1]
    size = np.linalg.norm(legs, axis=2)
    usable = size > 1e-9 * size.max(1, keepdims=True)
    leg = legs[np.arange(len(legs)), np.argmax(usable, axis=1)]
    return leg / np.linalg.norm(leg, axis=1, keepdims=True)
