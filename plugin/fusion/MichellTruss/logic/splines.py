"""The splines of a layout as NURBS that a CAD host takes as smooth: cubic pieces joined with continuous derivatives.

The file's splines have interior knots of multiplicity three. Where the derivative is continuous, the joint is the
weighted mean of its two neighbours and can go (one knot removal, exact; Piegl and Tiller, The NURBS Book, Section 5.4),
which leaves multiplicity two. Where it is not, the curve has a corner and is split.
"""

import math
from dataclasses import dataclass
from functools import cached_property

from .layout import Curve, Layout, Spline, Vector

SAME_POINT = 2e-6
"""Points in the file are rounded to 1e-6 mm; two within this distance in every coordinate are the same, mm."""

SMOOTH_JOINT = 1e-5
"""A joint that is off the mean of its neighbours by less has a continuous derivative; rounding makes up to 3e-6 mm."""

_GAUSS = ((-0.8611363115940526, 0.3478548451374538), (-0.3399810435848563, 0.6521451548625461))
_POINTS = tuple((x, w) for a, w in _GAUSS for x in (a, -a))
"""Abscissae and weights of the Gauss rule with four points on [-1, 1]."""

_INTERVALS = 2
"""Intervals of a piece over which its speed is integrated."""

_NEWTON_STEPS = 4
"""Newton steps for the parameter at an arc length: the members are nearly straight, so the first guess is close."""


@dataclass(frozen=True)
class Piece:
    """A cubic Bézier piece: control points in mm, length of its knot interval, and the step of the curve."""

    points: tuple[Vector, Vector, Vector, Vector]
    knots: float
    step: int

    @cached_property
    def length(self) -> float:
        """Arc length, mm."""
        return self._length_to(1.0)

    def point_at_length(self, fraction: float) -> Vector:
        """The point at a fraction of the arc length."""
        t = fraction
        for _ in range(_NEWTON_STEPS):
            t -= (self._length_to(t) - fraction * self.length) / self._speed(t)
            t = min(max(t, 0.0), 1.0)
        u, (a, b, c, d) = 1 - t, self.points
        x, y, z = (u**3 * a[i] + 3 * u * u * t * b[i] + 3 * u * t * t * c[i] + t**3 * d[i] for i in range(3))
        return x, y, z

    def _length_to(self, t: float) -> float:
        """Arc length from the start to the parameter t."""
        half = t / (2 * _INTERVALS)
        return half * sum(
            weight * self._speed(half * (2 * interval + 1 + x))
            for interval in range(_INTERVALS)
            for x, weight in _POINTS
        )

    def _speed(self, t: float) -> float:
        (ax, ay, az), (bx, by, bz), (cx, cy, cz), (dx, dy, dz) = self.points
        p, q, r = (1 - t) * (1 - t), 2 * (1 - t) * t, t * t
        x = p * (bx - ax) + q * (cx - bx) + r * (dx - cx)
        y = p * (by - ay) + q * (cy - by) + r * (dy - cy)
        z = p * (bz - az) + q * (cz - bz) + r * (dz - cz)
        return 3 * math.sqrt(x * x + y * y + z * z)


def curve_pieces(layout: Layout, curve: Curve) -> tuple[Piece, ...]:
    """The cubic pieces of a curve, each with the step (from node to node) that it belongs to."""
    spline, pieces, step = curve.spline, [], 0
    for first in range(0, len(spline.points) - 1, 3):
        a, b, c, d = spline.points[first : first + 4]
        pieces.append(Piece((a, b, c, d), spline.knots[first + 4] - spline.knots[first + 1], step))
        following = layout.nodes[curve.nodes[(step + 1) % len(curve.nodes)]]
        step += all(abs(p - q) <= SAME_POINT for p, q in zip(d, following, strict=True))
    return tuple(pieces)


def is_smooth(before: Piece, after: Piece) -> bool:
    """Whether the derivative is continuous where two pieces meet."""
    h0, h1 = before.knots, after.knots
    mean = tuple((h1 * a + h0 * b) / (h0 + h1) for a, b in zip(before.points[2], after.points[1], strict=True))
    return math.dist(mean, after.points[0]) <= SMOOTH_JOINT


def joined(pieces: tuple[Piece, ...]) -> Spline:
    """Smoothly joined pieces as one cubic B-spline with interior knots of multiplicity two, mm."""
    points, knots = [pieces[0].points[0]], [0.0] * 4
    for piece in pieces:
        points += piece.points[1:3]
        knots += [knots[-1] + piece.knots] * 2
    return Spline(3, (*knots, knots[-1], knots[-1]), (*points, pieces[-1].points[3]))
