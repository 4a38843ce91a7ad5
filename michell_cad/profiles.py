"""Profiles: the cross-sections that members may have besides the circle.

A profile is a closed outline of lines and cubic Bézier pieces, without holes and without crossing itself. It is scaled
to the AREA of the unit circle and moved to its centre of area, so that the radius of a member keeps its meaning for any
profile: volume, mass and axial stress are those of the round member of that radius.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, get_args

import numpy as np
from jaxtyping import Bool, Float, Int

from michell_cad.arrays import freeze, require
from michell_cad.errors import InvalidInputError

ProfileName = Literal["round", "triangle", "square", "hexagon", "octagon"]
PROFILE_NAMES: tuple[ProfileName, ...] = get_args(ProfileName)

SIDES = {"triangle": 3, "square": 4, "hexagon": 6, "octagon": 8}

ARCS = 8
"""Pieces of the round profile: a cubic for 45 degrees errs by 4e-6 of the radius."""

CORNER = np.deg2rad(1.0)
"""Pieces that meet at a smaller angle join smoothly, radians."""

SEGMENTS = 16
"""Segments of a polygon for a curve that turns once around, as many as a round tube has."""

MOST_POINTS = 200
"""Every straight side of an outline is a face of every member: more is no profile, but a picture."""

SAMPLES = 8
"""Segments of a curved piece when crossings are looked for."""

TOUCHING = 1e-9
"""Points nearer than this are one (relative to the size of the outline)."""

Row = tuple[float, ...]
"""A point of an outline: (x, y) for a straight side to the next point, or (x, y, x1, y1, x2, y2) with the two control
points of a cubic Bézier piece to the next point, as in SVG paths."""

_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(5)
"""Exact to degree 9: the first moments of area of cubic pieces have degree 8."""


@dataclass(frozen=True, eq=False)
class Profile:
    """A closed outline of the area pi around its centre of area, counter-clockwise.

    Parameters
    ----------
    pieces : (n, 4, 2) float, control points of cubic Bézier pieces, each beginning where the one before ends.
    straight : (n,) bool, pieces that are lines.
    """

    pieces: Float[np.ndarray, "n 4 2"]
    straight: Bool[np.ndarray, " n"]

    def __post_init__(self) -> None:
        freeze(self, pieces=np.float64, straight=bool)

    @cached_property
    def corners(self) -> Int[np.ndarray, " k"]:
        """Pieces that begin at a corner; the first piece alone if the outline is smooth all around."""
        P = self.pieces
        leave, arrive = _direction(P[:, 1] - P[:, 0]), _direction(P[:, 3] - P[:, 2])
        before = np.roll(arrive, 1, axis=0)
        turn = np.arctan2(before[:, 0] * leave[:, 1] - before[:, 1] * leave[:, 0], (before * leave).sum(1))
        found = np.flatnonzero(np.abs(turn) > CORNER)
        return found if len(found) else np.zeros(1, np.int64)

    @cached_property
    def sides(self) -> tuple[np.ndarray, ...]:
        """Control points of the sides from corner to corner: (2, 2) of a line, or (3 m + 1, 2) of m joined cubics."""
        n, k = len(self.pieces), self.corners
        found = []
        for first, last in zip(k, [*k[1:], k[0] + n], strict=True):
            run = np.arange(first, last) % n
            if len(run) == 1 and self.straight[run[0]]:
                found.append(self.pieces[run[0], [0, 3]])
            else:
                found.append(np.concatenate([self.pieces[run, :3].reshape(-1, 2), self.pieces[run[-1:], 3]]))
        return tuple(found)

    @cached_property
    def reach(self) -> float:
        """Largest distance of the outline from the centre, over the radius."""
        return float(np.linalg.norm(_sampled(self.pieces, self.straight, 4 * SAMPLES), axis=1).max())

    @cached_property
    def polygon(self) -> Float[np.ndarray, "k 2"]:
        """Points along the outline for meshes, all corners among them, scaled to the outline's area."""
        D = np.diff(self.pieces, axis=1)
        around = np.abs(np.angle(_complex(D[:, 1:]) * np.conj(_complex(D[:, :-1])))).sum(1)
        counts = np.where(self.straight, 1, np.maximum(np.ceil(around * SEGMENTS / (2 * np.pi) - 1e-9), 1)).astype(int)
        points = np.concatenate(
            [_points(one[None], np.arange(k) / k)[0] for one, k in zip(self.pieces, counts.tolist(), strict=True)]
        )
        return points * np.sqrt(np.pi / _polygon_area(points))


def named_profile(name: ProfileName, aspect: float = 1.0) -> Profile:
    """A profile by its name, stretched to be `aspect` times as long along x as it was; its area stays."""
    if name == "round":
        angles = 2 * np.pi * np.arange(ARCS) / ARCS
        points = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        along = np.stack([-np.sin(angles), np.cos(angles)], axis=1) * 4 / 3 * np.tan(np.pi / (2 * ARCS))
        ends, end_along = np.roll(points, -1, axis=0), np.roll(along, -1, axis=0)
        return _settled(
            np.stack([points, points + along, ends - end_along, ends], axis=1), np.zeros(ARCS, bool), aspect
        )
    n = SIDES[name]
    # A side faces x, so that a square has its sides across the axes of its frame.
    angles = 2 * np.pi * (np.arange(n) - 0.5) / n
    return outline_profile([(float(np.cos(a)), float(np.sin(a))) for a in angles], aspect)


def outline_profile(rows: Sequence[Row], aspect: float = 1.0) -> Profile:
    """A profile from the points of a closed outline, in order, in any unit and either direction.

    Parameters
    ----------
    rows : see `Row`. The last point is joined to the first, which may be repeated at the end.
    aspect : stretches the outline along x; its area stays.

    Raises
    ------
    InvalidInputError
        For fewer than two or too many points, points that coincide, an outline without area or one that crosses
        itself; names the points and what would work.
    """
    rows = [tuple(row) for row in rows]
    for number, row in enumerate(rows, 1):
        require(
            len(row) in (2, 6) and np.isfinite(row).all(),
            f"point {number} of the profile: expected [x, y], or [x, y, x1, y1, x2, y2] for a curve, found {list(row)}",
        )
    size = float(np.ptp([row[:2] for row in rows], axis=0).max()) if rows else 0.0
    if len(rows) > 1 and np.linalg.norm(np.subtract(rows[0][:2], rows[-1][:2])) <= TOUCHING * size:
        rows.pop()
    curved = any(len(row) == 6 for row in rows)
    require(
        (2 if curved else 3) <= len(rows) <= MOST_POINTS,
        f"a profile is a closed outline of 3 to {MOST_POINTS} points, found {len(rows)}"
        + (": draw it with fewer points" if len(rows) > MOST_POINTS else ": add points until it encloses an area"),
    )
    X = np.array([row[:2] for row in rows])
    following = np.roll(X, -1, axis=0)
    twice = np.flatnonzero(np.linalg.norm(following - X, axis=1) <= TOUCHING * size)
    require(
        not len(twice),
        f"points {twice[0] + 1 if len(twice) else 0} and {(twice[0] + 1) % len(X) + 1 if len(twice) else 0} of the "
        "profile coincide: leave one of them out",
    )
    pieces = np.stack([X, (2 * X + following) / 3, (X + 2 * following) / 3, following], axis=1)
    straight = np.array([len(row) == 2 for row in rows])
    for k in np.flatnonzero(~straight).tolist():
        pieces[k, 1:3] = np.reshape(rows[k][2:], (2, 2))
    _require_simple(pieces, straight, size)
    return _settled(pieces, straight, aspect)


def _settled(pieces: np.ndarray, straight: np.ndarray, aspect: float) -> Profile:
    """The outline counter-clockwise, stretched, around its centre, with the area pi."""
    pieces = pieces * [aspect, 1.0]
    if _area(pieces) < 0:
        pieces, straight = pieces[::-1, ::-1], straight[::-1]
    area = _area(pieces)
    P, D = _points(pieces, (1 + _GAUSS) / 2), _slopes(pieces, (1 + _GAUSS) / 2)
    # By Green's theorem: the integrals of x and y over the area, as integrals along the outline.
    x = (P[..., 0] ** 2 * D[..., 1] @ _WEIGHTS).sum() / 4
    y = -(P[..., 1] ** 2 * D[..., 0] @ _WEIGHTS).sum() / 4
    return Profile((pieces - np.array([x, y]) / area) * np.sqrt(np.pi / area), straight)


def _require_simple(pieces: np.ndarray, straight: np.ndarray, size: float) -> None:
    """Refuse an outline that crosses or touches itself, or encloses nothing."""
    owner = np.repeat(np.arange(len(pieces)), np.where(straight, 1, SAMPLES))
    meeting = _meeting_segments(_sampled(pieces, straight, SAMPLES), size)
    if len(meeting):
        a, b = owner[meeting[0]].tolist()
        raise InvalidInputError(
            f"the profile crosses or touches itself: its side from point {a + 1} {_spell(pieces[a, 0])} and its side "
            f"from point {b + 1} {_spell(pieces[b, 0])} meet; {_better_order(pieces, straight, size)}"
        )
    require(
        abs(_area(pieces)) > TOUCHING * size**2,
        f"the {len(pieces)} points of the profile enclose no area: they must not lie on one line",
    )


def _meeting_segments(A: np.ndarray, size: float) -> np.ndarray:
    """Pairs of segments of a closed polygon that meet, though they do not follow each other: (k, 2)."""
    n, B = len(A), np.roll(A, -1, axis=0)
    i, j = np.triu_indices(n, 2)
    apart = (i > 0) | (j < n - 1)
    i, j = i[apart], j[apart]
    margin = (TOUCHING * size**2) ** 2
    meet = _turn(A[i], B[i], A[j]) * _turn(A[i], B[i], B[j]) <= margin
    meet &= _turn(A[j], B[j], A[i]) * _turn(A[j], B[j], B[i]) <= margin
    # Segments of one line meet only if their boxes do.
    low, high = np.minimum(A, B), np.maximum(A, B)
    meet &= ((low[i] <= high[j] + TOUCHING * size) & (low[j] <= high[i] + TOUCHING * size)).all(1)
    return np.stack([i, j], axis=1)[meet]


def _better_order(pieces: np.ndarray, straight: np.ndarray, size: float) -> str:
    """What would work: the order of the points around their middle, if that is an outline."""
    X = pieces[:, 0]
    middle = X.mean(0)
    order = np.argsort(np.arctan2(X[:, 1] - middle[1], X[:, 0] - middle[0]), kind="stable")
    order = np.roll(order, -int(np.argmin(order)))
    if straight.all() and not len(_meeting_segments(X[order], size)):
        return f"in the order {', '.join(str(k + 1) for k in order)} the points make an outline that does not"
    return "list the points in their order around one simple outline"


def _turn(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Twice the area of the triangles a b c, positive if they turn left."""
    return (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])


def _area(pieces: np.ndarray) -> float:
    """Enclosed area, positive if the pieces run counter-clockwise: half the integral of x dy - y dx."""
    t = (1 + _GAUSS) / 2
    P, D = _points(pieces, t), _slopes(pieces, t)
    return float(((P[..., 0] * D[..., 1] - P[..., 1] * D[..., 0]) @ _WEIGHTS).sum() / 4)


def _polygon_area(X: np.ndarray) -> float:
    Y = np.roll(X, -1, axis=0)
    return float((X[:, 0] * Y[:, 1] - X[:, 1] * Y[:, 0]).sum() / 2)


def _sampled(pieces: np.ndarray, straight: np.ndarray, samples: int) -> np.ndarray:
    """Points along the outline: the ends of lines, and so many points of each curved piece."""
    t = np.arange(samples) / samples
    return np.concatenate([p[:1] if line else _points(p[None], t)[0] for p, line in zip(pieces, straight, strict=True)])


def _points(P: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Points (n, k, 2) of Bézier pieces at parameters t."""
    t = t[:, None]
    u = 1 - t
    P = P[:, None]
    return u**3 * P[:, :, 0] + 3 * u**2 * t * P[:, :, 1] + 3 * u * t**2 * P[:, :, 2] + t**3 * P[:, :, 3]


def _slopes(P: np.ndarray, t: np.ndarray) -> np.ndarray:
    t = t[:, None]
    D = 3 * np.diff(P, axis=1)[:, None]
    return (1 - t) ** 2 * D[:, :, 0] + 2 * (1 - t) * t * D[:, :, 1] + t**2 * D[:, :, 2]


def _direction(v: np.ndarray) -> np.ndarray:
    return v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), np.finfo(float).tiny)


def _complex(v: np.ndarray) -> np.ndarray:
    return v[..., 0] + 1j * v[..., 1]


def _spell(point: np.ndarray) -> str:
    return f"({point[0]:g}, {point[1]:g})"
