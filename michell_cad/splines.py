"""The members as smooth curves: cubic Bézier pieces through the nodes and waypoints of every curve.

Arora et al. 2019 (Section 5) fit a B-spline through the nodes of each curve. Here the tangents follow from the
neighbours only (Bessel's rule: the parabola through three points, over chord length; de Boor, A Practical Guide to
Splines, Chapter IV), so that an edit far away on a curve does not move a member, and every member can be built on its
own.

1. At a point between chords of lengths h0, h1 with directions d0, d1 the derivative is (h1 d0 + h0 d1) / (h0 + h1). It
   has the same value on both sides: a curve is C1 over chord length.
2. At the end of a curve, and on both sides of a sharp bend, it is 2 d - m with m the derivative at the other end of the
   chord (the end of the parabola), or d if that end has no derivative of its own.
3. A member of several curves is shaped by one of them, ``truss.shape_of_member``. The others are only continuous there.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from michell_cad.arrays import expand, freeze, require
from michell_cad.curves import Curve, CurveKind
from michell_cad.truss.values import Truss, curve_steps

SHARP_FEATURE_BEND = np.deg2rad(50.0)
"""A feature curve that turns by more at a point has a corner there (as in `IsocurveOptions.corner_angle`), radians."""

SHARP_BEND = np.deg2rad(90.0)
"""Other curves turn by more only where cleaning merged their nodes; a smooth curve would leave its chords, radians."""

INTERVALS = 8
"""Intervals of the arc length table in each piece, with four Gauss points each."""

NEWTON_STEPS = 3
"""Newton steps for the parameter at an arc length; the first guess is linear in an eighth of a piece."""

_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(4)


class BSpline(NamedTuple):
    """A B-spline curve: degree, (n, 3) control points in mm, and all n + degree + 1 knots."""

    control_points: np.ndarray
    knots: np.ndarray
    degree: int


@dataclass(frozen=True, eq=False)
class MemberSplines:
    """Cubic Bézier pieces of every member.

    Parameters
    ----------
    control_points : (n_p, 4, 3) float, mm; the pieces of member m, in order from its first node to its second, are
        ``control_points[offsets[m] : offsets[m + 1]]``.
    offsets : (n_m + 1,) int.
    """

    control_points: Float[np.ndarray, "n_p 4 3"]
    offsets: Int[np.ndarray, " n_m1"]

    def __post_init__(self) -> None:
        freeze(self, control_points=np.float64, offsets=np.int64)
        P, offsets = self.control_points, self.offsets
        require(P.ndim == 3 and P.shape[1:] == (4, 3), f"control_points must have shape (n_p, 4, 3), found {P.shape}")
        require(
            offsets[0] == 0 and offsets[-1] == len(P) and (np.diff(offsets) >= 1).all(),
            f"offsets must ascend from 0 to {len(P)}, with at least one piece for each member",
        )

    def some(self, members: Int[np.ndarray, " k"]) -> "MemberSplines":
        """The splines of some members."""
        counts = np.diff(self.offsets)[members]
        owner, local = expand(counts)
        return MemberSplines(
            self.control_points[self.offsets[members][owner] + local], np.concatenate([[0], np.cumsum(counts)])
        )

    @cached_property
    def lengths(self) -> Float[np.ndarray, " n_m"]:
        """Arc lengths of the members, mm."""
        run = self._arc_lengths
        return run[self.offsets[1:] * INTERVALS] - run[self.offsets[:-1] * INTERVALS]

    @cached_property
    def _arc_lengths(self) -> np.ndarray:
        """Arc length up to every eighth of every piece, all members one after the other."""
        t = np.arange(INTERVALS) / INTERVALS
        speeds = _speed(self.control_points[:, None, None], t[:, None] + (1 + _GAUSS) / (2 * INTERVALS))
        return np.concatenate([[0.0], np.cumsum(speeds @ _WEIGHTS / (2 * INTERVALS))])

    def positions(self, s: Float[np.ndarray, "..."]) -> Float[np.ndarray, "n_m k 3"]:
        """Points at fractions `s` (k,) or (n_m, k) of the arc length of each member, first node to second."""
        piece, t = self._parameters(s)
        return bezier(self.control_points[piece], t)

    def tangents(self, s: Float[np.ndarray, "..."]) -> Float[np.ndarray, "n_m k 3"]:
        """Unit tangents at fractions `s` of the arc length, see `positions`; they point to the second node."""
        piece, t = self._parameters(s)
        return bezier_slopes(self.control_points[piece], t)

    def _parameters(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Piece and parameter at fractions of the arc length, both (n_m, k)."""
        n_m = len(self.offsets) - 1
        s = np.clip(np.broadcast_to(np.asarray(s, float), (n_m, np.shape(s)[-1])), 0, 1)
        run = self._arc_lengths
        first, last = self.offsets[:-1] * INTERVALS, self.offsets[1:] * INTERVALS
        goal = run[first][:, None] + s * self.lengths[:, None]
        at = np.searchsorted(run, goal.ravel(), side="right").reshape(goal.shape) - 1
        at = np.clip(at, first[:, None], last[:, None] - 1)
        piece, begin = at // INTERVALS, (at % INTERVALS) / INTERVALS
        P = self.control_points[piece]
        left, whole = goal - run[at], run[at + 1] - run[at]
        part = np.divide(left, whole, out=np.zeros_like(left), where=whole > 0) / INTERVALS
        for _ in range(NEWTON_STEPS):
            nodes = begin[..., None] + part[..., None] * (1 + _GAUSS) / 2
            length = part / 2 * (_speed(P[..., None, :, :], nodes) @ _WEIGHTS)
            speed = np.maximum(_speed(P, begin + part), np.finfo(float).tiny)
            part = np.clip(part - (length - left) / speed, 0, 1 / INTERVALS)
        return piece, begin + part


def fit_splines(truss: Truss, straight: bool = False) -> MemberSplines:
    """Give every member the shape of its curve.

    Parameters
    ----------
    truss : Truss
    straight : whether members are straight from node to node instead (waypoints are then ignored).

    Returns
    -------
    MemberSplines
        Along each curve, the pieces of the members that it shapes meet with one tangent, except at sharp bends.
    """
    if straight or not len(truss.members):
        ends = truss.nodes[truss.members][:, [0, 0, 1, 1]]
        thirds = np.array([0, 1, 2, 3])[:, None] / 3
        return MemberSplines(ends[:, :1] + thirds * (ends[:, 3:] - ends[:, :1]), np.arange(len(truss.members) + 1))
    start, _, member = curve_steps(truss.curves)
    curve = np.repeat(np.arange(len(truss.curves)), [len(c.members) for c in truss.curves])
    points, following, step = _points(truss, start, member)
    is_feature = np.array([c.kind is CurveKind.FEATURE for c in truss.curves])
    # A truss of straight members has a sharp bend at every point.
    sharpest = np.where(is_feature, SHARP_FEATURE_BEND, SHARP_BEND)[curve[step]]
    pieces = _bessel_pieces(points, following, np.full_like(sharpest, -1.0) if truss.straight else sharpest)
    # Each member takes the pieces of the curve that shapes it, once, in its own direction.
    mine = truss.shape_of_member[member] == curve
    once = np.zeros(len(member), bool)
    once[np.unique(np.where(mine, member, len(truss.members)), return_index=True)[1]] = True
    chosen = np.flatnonzero(once & mine)
    chosen = chosen[np.argsort(member[chosen])]
    counts = np.bincount(step, minlength=len(member))
    first = np.cumsum(counts) - counts
    owner, local = expand(counts[chosen])
    reverse = (truss.members[member[chosen], 0] != start[chosen])[owner]
    place = first[chosen][owner] + np.where(reverse, counts[chosen][owner] - 1 - local, local)
    taken = pieces[place]
    taken[reverse] = taken[reverse, ::-1]
    return MemberSplines(taken, np.concatenate([[0], np.cumsum(counts[chosen])]))


def curve_spline(truss: Truss, splines: MemberSplines, curve: Curve) -> BSpline:
    """A whole curve of the truss as one cubic B-spline, with interior knots of multiplicity three.

    Knots are chord lengths between the points of the curve, in mm. A closed curve ends where it begins.
    """
    parts = []
    for node, member in zip(curve.nodes, curve.members, strict=False):
        pieces = splines.control_points[splines.offsets[member] : splines.offsets[member + 1]]
        parts.append(pieces if truss.members[member, 0] == node else pieces[::-1, ::-1])
    pieces = np.concatenate(parts)
    breaks = np.concatenate([[0.0], np.cumsum(np.linalg.norm(pieces[:, 3] - pieces[:, 0], axis=1))])
    knots = np.concatenate([breaks[:1], np.repeat(breaks, 3), breaks[-1:]])
    return BSpline(np.concatenate([pieces[:, :3].reshape(-1, 3), pieces[-1:, 3]]), knots, 3)


def _points(truss: Truss, start: np.ndarray, member: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Start points of all pieces along all curves and then the ends of open curves; where each piece ends; its step."""
    offsets, waypoints = np.asarray(truss.waypoint_offsets), np.asarray(truss.waypoints)
    counts = np.diff(offsets)[member]
    step, local = expand(counts + 1)
    forward = truss.members[member[step], 0] == start[step]
    place = offsets[member[step]] + np.where(forward, local - 1, counts[step] - local)
    inner = local > 0
    points = truss.nodes[start[step]]
    points[inner] = waypoints[place[inner]]
    # Behind the pieces come the end points of the open curves.
    sizes = np.array([len(c.members) for c in truss.curves])
    last_step = np.cumsum(sizes) - 1
    piece_ends = np.cumsum(counts + 1)
    first_piece = np.concatenate([[0], piece_ends[last_step][:-1]])
    following = np.arange(1, len(step) + 1)
    closed = np.array([c.closed for c in truss.curves])
    tips = np.array([c.nodes[-1] for c in truss.curves])[~closed]
    following[piece_ends[last_step][closed] - 1] = first_piece[closed]
    following[piece_ends[last_step][~closed] - 1] = len(points) + np.arange(len(tips))
    return np.concatenate([points, truss.nodes[tips]]), following, step


def _bessel_pieces(points: np.ndarray, following: np.ndarray, sharpest: np.ndarray) -> np.ndarray:
    """Bézier pieces from points[i] to points[following[i]] with the tangents of the module's rules 1 and 2."""
    n = len(following)
    chord = points[following] - points[:n]
    h = np.maximum(np.linalg.norm(chord, axis=1), np.finfo(float).tiny)[:, None]
    d = chord / h
    before = np.full(len(points), -1)
    before[following] = np.arange(n)
    # At the start of piece i, which is the end of piece before[i]; an open curve has no piece before its first.
    previous = before[:n]
    turn = np.arccos(np.clip(np.einsum("nd,nd->n", d, d[previous]), -1, 1))
    smooth = np.append((previous >= 0) & (turn <= sharpest), np.zeros(len(points) - n, bool))
    m = np.zeros_like(points)
    m[:n] = (h * d[previous] + h[previous] * d) / (h + h[previous])
    at_start, at_end = smooth[:n, None], smooth[following][:, None]
    leave = np.where(at_start, m[:n], np.where(at_end, 2 * d - m[following], d))
    arrive = np.where(at_end, m[following], np.where(at_start, 2 * d - m[:n], d))
    return np.stack(
        [points[:n], points[:n] + h * leave / 3, points[following] - h * arrive / 3, points[following]], axis=1
    )


def bezier(P: Float[np.ndarray, "*n 4 3"], t: Float[np.ndarray, "*k"]) -> Float[np.ndarray, "*m 3"]:
    """Points of Bézier pieces P (..., 4, 3) at parameters t (...)."""
    t = t[..., None]
    u = 1 - t
    return u**3 * P[..., 0, :] + 3 * u**2 * t * P[..., 1, :] + 3 * u * t**2 * P[..., 2, :] + t**3 * P[..., 3, :]


def bezier_slopes(P: Float[np.ndarray, "*n 4 3"], t: Float[np.ndarray, "*k"]) -> Float[np.ndarray, "*m 3"]:
    """Unit tangents of Bézier pieces P (..., 4, 3) at parameters t (...)."""
    derivative = _derivative(P, t)
    return derivative / np.linalg.norm(derivative, axis=-1, keepdims=True)


def _derivative(P: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Derivatives of Bézier pieces by t."""
    t = t[..., None]
    D = 3 * np.diff(P, axis=-2)
    return (1 - t) ** 2 * D[..., 0, :] + 2 * (1 - t) * t * D[..., 1, :] + t**2 * D[..., 2, :]


def _speed(P: np.ndarray, t: np.ndarray) -> np.ndarray:
    return np.linalg.norm(_derivative(P, t), axis=-1)
