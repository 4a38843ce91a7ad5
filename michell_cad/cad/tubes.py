"""Tubes: the surface of every member between the two circles where it leaves its nodes.

The spine follows the design curve. It starts at node + reach * direction, a little off the design curve if that is
bent, and at an angle to it. The offset fades out along the member with the quintic step (1 - t)^3 (1 + 3 t + 6 t^2),
the angle with t (1 - t)^3 (1 + 3 t), which begins with the slope 1 and without curvature. Circles of radius r(t)
(`member_radius`) stand on the spine at 5 to 33 places (`SECTION_COUNTS`), in rotation-minimising frames (double
reflection, Wang et al. 2008, doi:10.1145/1330511.1330513). The surface is a rational quadratic around (nine poles,
exact circles at the sections) and a cubic along, clamped so that it leaves both circles along the tangent of the spine:
with zero slope of r at the ends, tube and fillet are tangent.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cache, cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.interpolate import BSpline

from michell_cad.arrays import freeze
from michell_cad.cad.centerlines import Centerlines, points_at
from michell_cad.truss import member_radius

SECTION_COUNTS = (5, 9, 17, 33)
"""Circles per tube: the first number whose spine keeps within `FOLLOWS` of what it should follow."""

FOLLOWS = 0.1
"""Largest distance between a spine and its goal, halfway between its circles (relative to the smallest radius)."""

STRAY, BEND = 0.1, 2.5
"""Where a tube begins off its curve, or at an angle to it, the spine comes back over such a length that the slant
strays from the curve by at most the first (relative to the radius), but without bending more sharply than with the
second (radius of curvature over radius of the tube)."""

FREE = 3.0
"""Between two nodes that leave less tube than this, the spine may be the cubic with the slopes at its ends, whatever
the curve does in between (relative to the radius)."""

AROUND = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], float)
"""The poles of a circle as a rational quadratic spline, in its plane, for radius 1."""

WEIGHTS = np.array([1, np.sqrt(0.5)] * 4 + [1])
"""Weights of these poles."""

AROUND_KNOTS = np.repeat(np.linspace(0, 1, 5), [3, 2, 2, 2, 3])
"""Knots around a tube, quadratic."""

STRAIGHT = 1e-9
"""A tube whose sections leave a cylinder by less than this is one (relative to its radius)."""


@cache
def tube_knots(count: int) -> Float[np.ndarray, " k"]:
    """Knots along a tube with so many circles, cubic."""
    return np.concatenate([np.zeros(4), np.linspace(0, 1, count)[1:-1], np.ones(4)])


@dataclass(frozen=True, eq=False)
class _Bases:
    """Matrices for tubes with so many circles: from circles and end slopes to poles, slopes and curvatures there.

    `along` leads from poles to points at the places `between`, among the circles and among those of a finer tube.
    """

    fit: np.ndarray
    slopes: np.ndarray
    end_curvatures: np.ndarray
    between: np.ndarray
    along: np.ndarray


@cache
def _bases(count: int) -> _Bases:
    knots, step = tube_knots(count), np.linspace(0, 1, count)
    splines = BSpline(knots, np.eye(count + 2), 3)
    slopes = splines.derivative()(step)
    values = BSpline.design_matrix(step, knots, 3).toarray()
    fit = np.linalg.inv(np.concatenate([values, slopes[[0, -1]]]))
    between = np.linspace(0, 1, 4 * count - 3)[1:-1]
    along = BSpline.design_matrix(between, knots, 3).toarray()
    return _Bases(fit, slopes, splines.derivative(2)(step)[[0, -1]], between, along)


@dataclass(frozen=True, eq=False)
class Tubes:
    """Surfaces of the members, oriented from the first node to the second.

    Parameters
    ----------
    sections : (n_m,) int, number of circles k.
    spines : for each member (k + 2, 3) float, mm, poles of the spine on `tube_knots`.
    poles : for each member (9, k + 2, 3) float, mm: around, along. Weights are `WEIGHTS` around.
    end_normals : (n_m, 2, 3) float, unit vectors to angle 0 at both ends.
    radii : (n_m, 3) float, mm, at the start, in the middle and at the end.
    straight : (n_m,) bool, whether the tube is a cylinder.
    """

    sections: Int[np.ndarray, " n_m"]
    spines: Sequence[np.ndarray]
    poles: Sequence[np.ndarray]
    end_normals: Float[np.ndarray, "n_m 2 3"]
    radii: Float[np.ndarray, "n_m 3"]
    straight: Bool[np.ndarray, " n_m"]

    def __post_init__(self) -> None:
        freeze(self, sections=np.int64, end_normals=np.float64, radii=np.float64, straight=bool)

    def of_count(self, count: int) -> Int[np.ndarray, " k"]:
        """Members with so many circles."""
        return np.flatnonzero(self.sections == count)

    def radii_at(self, t: Float[np.ndarray, " j"]) -> Float[np.ndarray, "n_m j"]:
        """Radii at the parameters `t` in [0, 1], mm."""
        return member_radius(self.radii[:, None], t)

    @cached_property
    def radius_range(self) -> tuple[Float[np.ndarray, " n_m"], Float[np.ndarray, " n_m"]]:
        """Smallest and largest radius of each tube, mm."""
        radii = self.radii_at(np.linspace(0, 1, 9))
        return radii.min(1), radii.max(1)

    def spine_points(self, t: Float[np.ndarray, " j"]) -> Float[np.ndarray, "n_m j 3"]:
        """Points of the spines at the parameters `t` in [0, 1]."""
        points = np.empty((len(self.sections), len(t), 3))
        for count in np.unique(self.sections).tolist():
            members = self.of_count(count)
            along = BSpline.design_matrix(t, tube_knots(count), 3).toarray()
            points[members] = along @ np.array([self.spines[m] for m in members])
        return points

    def surface_points(
        self, angles: Float[np.ndarray, " i"], t: Float[np.ndarray, " j"]
    ) -> Float[np.ndarray, "n_m j i 3"]:
        """Points of the surfaces at the angles around and parameters along."""
        weighted = circle_basis(angles) * WEIGHTS
        weighted /= weighted.sum(1, keepdims=True)
        points = np.empty((len(self.sections), len(t), len(angles), 3))
        for count in np.unique(self.sections).tolist():
            members = self.of_count(count)
            along = BSpline.design_matrix(t, tube_knots(count), 3).toarray()
            poles = np.array([self.poles[m] for m in members])
            points[members] = weighted @ np.tensordot(along, poles, (1, 2)).transpose(1, 0, 2, 3)
        return points

    def some(self, members: Int[np.ndarray, " k"]) -> "Tubes":
        """Some of the tubes."""
        spines, poles = ([column[m] for m in members] for column in (self.spines, self.poles))
        return Tubes(
            self.sections[members],
            spines,
            poles,
            self.end_normals[members],
            self.radii[members],
            self.straight[members],
        )


def circle_basis(angles: Float[np.ndarray, " i"]) -> Float[np.ndarray, "i 9"]:
    """Quadratic basis functions around a tube at the given angles, see `circle_parameter`."""
    return BSpline.design_matrix(circle_parameter(angles), AROUND_KNOTS, 2).toarray()


def circle_parameter(angles: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Parameter in [0, 1] of the rational circle at an angle in [0, 2 pi].

    In each quarter, tan((angle - pi/4) / 2) = tan(pi/8) (2 t - 1) with t from 0 to 1.
    """
    quarter = np.minimum(np.floor(angles / (np.pi / 2)), 3)
    t = (1 + np.tan((angles - (quarter + 0.5) * np.pi / 2) / 2) / np.tan(np.pi / 8)) / 2
    return np.clip((quarter + t) / 4, 0, 1)


def fit_tubes(
    centerlines: Centerlines,
    starts: Float[np.ndarray, "n_m 2 3"],
    reach: Float[np.ndarray, "n_m 2"],
    radii: Float[np.ndarray, "n_m 3"],
    phase: Float[np.ndarray, " n_m"],
    tight: Bool[np.ndarray, " n_m"],
) -> Tubes:
    """Fit the tubes of all members.

    Parameters
    ----------
    centerlines : design curves and directions at the nodes.
    starts : nodes of each member, mm.
    reach : distance from each node to its circle, mm.
    radii : radius at start, middle and end of each tube, mm.
    phase : rotation of the first circle's zero angle about the member, radians.
    tight : tubes that were pinched: those shorter than `FREE` bend as little as their ends let them.
    """
    n = len(starts)
    ends = starts + reach[..., None] * centerlines.directions
    free = tight & (np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) < FREE * radii.max(1))
    some = _Goal.of(centerlines, ends, reach, radii.min(1), free)
    sections, straight = np.zeros(n, int), np.zeros(n, bool)
    spines: list[np.ndarray] = [np.zeros((0, 3))] * n
    poles, end_normals = spines.copy(), np.zeros((n, 2, 3))
    rows = np.arange(n)
    for count in SECTION_COUNTS:
        circles, spine = _fit_spines(some, count)
        follows = _follows(some, spine, count) | (count == SECTION_COUNTS[-1])
        good, m = np.flatnonzero(follows), rows[follows]
        if len(m):
            found, normals, straight[m] = _fit_surfaces(
                some.some(good), circles[good], spine[good], radii[m], phase[m], count
            )
            sections[m], end_normals[m] = count, normals
            for i, one, surface in zip(m.tolist(), spine[good], found, strict=True):
                spines[i], poles[i] = one, surface
        if follows.all():
            break
        some, rows = some.some(np.flatnonzero(~follows)), rows[~follows]
    return Tubes(sections, spines, poles, end_normals, radii, straight)


@dataclass(frozen=True, eq=False)
class _Goal:
    """What spines should follow: design curves, led to the circles at their ends.

    Parameters
    ----------
    points, directions : (n_m, k, 3) and (n_m, 2, 3), of the design curves.
    ends : (n_m, 2, 3), centres of the circles.
    radius : (n_m,), the smallest of each tube.
    free : (n_m,), tubes that need not follow their curve.
    trims : (n_m, 2), fractions of arc length at which the tubes begin and end.
    gap, turn : (n_m, 2, 3), from the curve to the circle, and from its slope to the direction.
    over, turn_over : (n_m, 2), over which shares of the length these two fade.
    speed : (n_m,), length from circle to circle.
    """

    points: np.ndarray
    directions: np.ndarray
    ends: np.ndarray
    radius: np.ndarray
    free: np.ndarray
    trims: np.ndarray
    gap: np.ndarray
    turn: np.ndarray
    over: np.ndarray
    turn_over: np.ndarray
    speed: np.ndarray

    @staticmethod
    def of(lines: Centerlines, ends: np.ndarray, reach: np.ndarray, radius: np.ndarray, free: np.ndarray) -> "_Goal":
        """The goals of all tubes; a trace of every curve is left, whatever its nodes take."""
        share = reach / np.maximum(lines.lengths, reach.sum(1) / 0.98)[:, None]
        trims = np.stack([share[:, 0], 1 - share[:, 1]], axis=1)
        size = np.maximum((trims[:, 1] - trims[:, 0]) * lines.lengths, 1e-9)[:, None]
        gap = ends - lines.at(trims)
        turn = lines.directions - np.array([1.0, -1.0])[:, None] * lines.slopes_at(trims)
        far, angle, r = np.linalg.norm(gap, axis=2), np.linalg.norm(turn, axis=2), radius[:, None]
        room = STRAY * r
        # The largest second derivative of the first step is 5.8; of the other 3.9, and its largest value 0.2.
        over = np.maximum(size * room / np.maximum(far, room), np.sqrt(5.8 * BEND * r * far))
        turn_over = np.maximum(room / (0.2 * np.maximum(angle, 1e-12)), 3.9 * BEND * r * angle)
        over, turn_over = (np.minimum(x / size, 1) for x in (over, turn_over))
        chord = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        goal = _Goal(
            lines.points,
            lines.directions,
            ends,
            radius,
            free,
            trims,
            gap,
            turn * size[..., None],
            over,
            turn_over,
            chord,
        )
        points = goal._curves_at(np.linspace(0, 1, lines.points.shape[1] // 2 + 1))
        along = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(1)
        return replace(goal, speed=np.where(free, chord, np.maximum(along, chord)))

    def some(self, rows: np.ndarray) -> "_Goal":
        """The goals of some members."""
        return _Goal(*(getattr(self, f.name)[rows] for f in fields(self)))

    @property
    def slopes(self) -> np.ndarray:
        """Derivatives of the spines at both ends, (n_m, 2, 3)."""
        d = self.directions
        return np.stack([d[:, 0], -d[:, 1]], axis=1) * self.speed[:, None, None]

    def at(self, t: np.ndarray) -> np.ndarray:
        """Points (n_m, j, 3) at the parameters t."""
        points = self._curves_at(t)
        if self.free.any():
            (a, b), (slope_a, slope_b) = (x[self.free].transpose(1, 0, 2)[:, :, None] for x in (self.ends, self.slopes))
            u = t[:, None]
            points[self.free] = (
                (1 + 2 * u) * (1 - u) ** 2 * a
                + u**2 * (3 - 2 * u) * b
                + u * (1 - u) ** 2 * slope_a
                - u**2 * (1 - u) * slope_b
            )
        return points

    def _curves_at(self, t: np.ndarray) -> np.ndarray:
        """Points of the design curves, led to the circles at both ends."""
        s_0, s_1 = self.trims[:, :1], self.trims[:, 1:]
        points = points_at(self.points, s_0 + (s_1 - s_0) * t)
        for side, x in enumerate((t, 1 - t)):
            u = np.minimum(x / self.over[:, [side]], 1)[..., None]
            points += (1 - u) ** 3 * (1 + 3 * u + 6 * u**2) * self.gap[:, [side]]
            over = self.turn_over[:, [side]]
            u = np.minimum(x / over, 1)
            points += (over * u * (1 + 3 * u) * (1 - u) ** 3)[..., None] * self.turn[:, [side]]
        return points


def _fit_spines(goal: _Goal, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Centres of the circles, and poles of the spines."""
    circles = goal.at(np.linspace(0, 1, count))
    return circles, _bases(count).fit @ np.concatenate([circles, goal.slopes], axis=1)


def _follows(goal: _Goal, spines: np.ndarray, count: int) -> np.ndarray:
    """Whether the spines keep to their goal halfway between the circles, also between those of a finer tube."""
    bases = _bases(count)
    return np.linalg.norm(bases.along @ spines - goal.at(bases.between), axis=2).max(1) <= FOLLOWS * goal.radius


def _fit_surfaces(
    goal: _Goal, sections: np.ndarray, spines: np.ndarray, radii: np.ndarray, phase: np.ndarray, count: int
):
    """Poles of the surfaces around spines, normals at their ends, and whether they are cylinders."""
    bases, step = _bases(count), np.linspace(0, 1, count)
    slopes, d = goal.slopes, goal.directions
    T = bases.slopes @ spines
    T /= np.linalg.norm(T, axis=2, keepdims=True)
    T[:, 0], T[:, -1] = d[:, 0], -d[:, 1]
    N = _transport(sections, T, phase)
    r = member_radius(radii[:, None, :], step[None])
    arms = np.einsum("ak,kmsd->masd", AROUND, np.stack([N, np.cross(T, N)]))
    rings = sections[:, None] + r[:, None, :, None] * arms
    curvature = bases.end_curvatures @ spines / goal.speed[:, None, None] ** 2
    bend = np.einsum("masd,msd->mas", arms[:, :, [0, -1]], curvature) * r[:, None, [0, -1]]
    # A ring turns with the spine: its points advance by 1 - r k (arm), yet all along the tangent.
    advance = np.maximum(1 - bend, 0.1)[..., None] * slopes[:, None]
    poles = bases.fit @ np.concatenate([rings, advance], axis=2)
    return poles, N[:, [0, -1]], _is_straight(sections, d, r)


def pinched_tubes(tubes: Tubes) -> Bool[np.ndarray, " n_m"]:
    """Tubes that bend more sharply than their radius allows: somewhere their surface runs backwards."""
    pinched = np.zeros(len(tubes.sections), bool)
    for count in np.unique(tubes.sections).tolist():
        members = tubes.of_count(count)
        some, t = tubes.some(members), np.linspace(0, 1, 4 * count)
        step = np.diff(some.spine_points(t), axis=1)
        forward = np.einsum(
            "mjid,mjd->mji", np.diff(some.surface_points(np.linspace(0, 2 * np.pi, 13)[:-1], t), axis=1), step
        )
        pinched[members] = (forward <= 0.05 * np.linalg.norm(step, axis=2)[..., None] ** 2).any((1, 2))
    return pinched


def _transport(points: np.ndarray, T: np.ndarray, phase: np.ndarray) -> np.ndarray:
    """Normals of rotation-minimising frames along the sections."""
    N = np.empty_like(T)
    helper = np.eye(3)[np.argmin(np.abs(T[:, 0]), axis=1)]
    normal = np.cross(T[:, 0], helper)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    N[:, 0] = np.cos(phase)[:, None] * normal + np.sin(phase)[:, None] * np.cross(T[:, 0], normal)
    for i in range(T.shape[1] - 1):
        v = points[:, i + 1] - points[:, i]
        reflected, tangent = _reflect(N[:, i], v), _reflect(T[:, i], v)
        N[:, i + 1] = _reflect(reflected, T[:, i + 1] - tangent)
        # Rounding would pile up: stay in the plane of the circle.
        N[:, i + 1] -= (N[:, i + 1] * T[:, i + 1]).sum(1, keepdims=True) * T[:, i + 1]
        N[:, i + 1] /= np.linalg.norm(N[:, i + 1], axis=1, keepdims=True)
    return N


def _reflect(x: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Mirror x in the plane normal to v; x itself where v is zero."""
    square = (v * v).sum(1, keepdims=True)
    return x - np.where(square > 1e-30, 2 * (x * v).sum(1, keepdims=True) / np.maximum(square, 1e-30), 0) * v


def _is_straight(sections: np.ndarray, directions: np.ndarray, r: np.ndarray) -> np.ndarray:
    axis = directions[:, 0]
    arm = sections - sections[:, :1]
    off = arm - np.einsum("msd,md->ms", arm, axis)[..., None] * axis[:, None]
    small = STRAIGHT * r.min(1)
    turned = np.linalg.norm(directions.sum(1), axis=1) * r[:, 0]
    return (np.linalg.norm(off, axis=2).max(1) < small) & (np.ptp(r, axis=1) < small) & (turned < small)
