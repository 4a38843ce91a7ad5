"""Tubes: the surface of every member between the two circles where it leaves its nodes.

The spine follows the design curve. It starts where the direction of the end pierces the circle's plane, at
node + reach * direction, a little off the design curve if that is bent; the offset fades out along the member with the
quintic step (1 - t)^3 (1 + 3 t + 6 t^2). Circles of radius r(t) (`member_radius`) stand on the spine at `SECTIONS`
places, in rotation-minimising frames (double reflection, Wang et al. 2008, doi:10.1145/1330511.1330513). The surface
is a rational quadratic around (nine poles, exact circles at the sections) and a cubic along, clamped so that it leaves
both circles along the tangent of the spine: with zero slope of r at the ends, tube and fillet are tangent.
"""

from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.interpolate import BSpline

from michell_cad.arrays import freeze
from michell_cad.cad.centerlines import Centerlines
from michell_cad.truss import member_radius

SECTIONS = 5
"""Circles per tube."""

KNOTS = np.concatenate([np.zeros(4), np.linspace(0, 1, SECTIONS)[1:-1], np.ones(4)])
"""Knots along a tube, cubic."""

AROUND = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], float)
"""The poles of a circle as a rational quadratic spline, in its plane, for radius 1."""

WEIGHTS = np.array([1, np.sqrt(0.5)] * 4 + [1])
"""Weights of these poles."""

AROUND_KNOTS = np.repeat(np.linspace(0, 1, 5), [3, 2, 2, 2, 3])
"""Knots around a tube, quadratic."""

STRAIGHT = 1e-9
"""A tube whose sections leave a cylinder by less than this is one (relative to its radius)."""

_STEP = np.linspace(0, 1, SECTIONS)
_VALUES = BSpline.design_matrix(_STEP, KNOTS, 3).toarray()
_SLOPES = BSpline(KNOTS, np.eye(SECTIONS + 2), 3).derivative()(_STEP)
_CURVATURES = BSpline(KNOTS, np.eye(SECTIONS + 2), 3).derivative(2)(_STEP)
_FIT = np.linalg.inv(np.concatenate([_VALUES, _SLOPES[[0, -1]]]))


@dataclass(frozen=True, eq=False)
class Tubes:
    """Surfaces of the members, oriented from the first node to the second.

    Parameters
    ----------
    spines : (n_m, 9, 3) float, mm, poles of the spines on `KNOTS`.
    poles : (n_m, 9, 9, 3) float, mm: around, along. Weights are `WEIGHTS` around.
    frames : (n_m, 7, 3, 3) float, rows N, B, T of the sections.
    radii : (n_m, 7) float, mm, of the sections.
    straight : (n_m,) bool, whether the tube is a cylinder.
    """

    spines: Float[np.ndarray, "n_m c 3"]
    poles: Float[np.ndarray, "n_m 9 c 3"]
    frames: Float[np.ndarray, "n_m s 3 3"]
    radii: Float[np.ndarray, "n_m s"]
    straight: Bool[np.ndarray, " n_m"]

    def __post_init__(self) -> None:
        freeze(self, spines=np.float64, poles=np.float64, frames=np.float64, radii=np.float64, straight=bool)

    def spine_points(self, t: Float[np.ndarray, " j"]) -> Float[np.ndarray, "n_m j 3"]:
        """Points of the spines at the parameters `t` in [0, 1]."""
        return np.einsum("tc,mcd->mtd", BSpline.design_matrix(t, KNOTS, 3).toarray(), self.spines)

    def surface_points(
        self, angles: Float[np.ndarray, " i"], t: Float[np.ndarray, " j"]
    ) -> Float[np.ndarray, "n_m j i 3"]:
        """Points of the surfaces at the angles around and parameters along."""
        weighted = circle_basis(angles) * WEIGHTS
        weighted /= weighted.sum(1, keepdims=True)
        along = BSpline.design_matrix(t, KNOTS, 3).toarray()
        return weighted @ np.tensordot(along, self.poles, (1, 2)).transpose(1, 0, 2, 3)

    def some(self, members: Int[np.ndarray, " k"]) -> "Tubes":
        """Some of the tubes."""
        return Tubes(*(getattr(self, field.name)[members] for field in fields(self)))


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
) -> Tubes:
    """Fit the tubes of all members.

    Parameters
    ----------
    centerlines : design curves and directions at the nodes.
    starts : nodes of each member, mm.
    reach : distance from each node to its circle, mm.
    radii : radius at start, middle and end of each tube, mm.
    phase : rotation of the first circle's zero angle about the member, radians.
    """
    d = centerlines.directions
    ends = starts + reach[..., None] * d
    sections = _spine_sections(centerlines, ends, reach)
    chord = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    speed = np.maximum(np.linalg.norm(np.diff(sections, axis=1), axis=2).sum(1), chord)
    slopes = np.stack([d[:, 0], -d[:, 1]], axis=1) * speed[:, None, None]
    spines = np.einsum("cs,msd->mcd", _FIT, np.concatenate([sections, slopes], axis=1))
    T = np.einsum("sc,mcd->msd", _SLOPES, spines)
    T /= np.linalg.norm(T, axis=2, keepdims=True)
    T[:, 0], T[:, -1] = d[:, 0], -d[:, 1]
    N = _transport(sections, T, phase)
    B = np.cross(T, N)
    r = member_radius(radii[:, None, :], _STEP[None])
    arms = np.einsum("ak,kmsd->masd", AROUND, np.stack([N, B]))
    rings = sections[:, None] + r[:, None, :, None] * arms
    curvature = np.einsum("sc,mcd->msd", _CURVATURES[[0, -1]], spines) / speed[:, None, None] ** 2
    bend = np.einsum("masd,msd->mas", arms[:, :, [0, -1]], curvature) * r[:, None, [0, -1]]
    # A ring turns with the spine: its points advance by 1 - r k (arm), yet all along the tangent.
    advance = np.maximum(1 - bend, 0.1)[..., None] * slopes[:, None]
    poles = np.einsum("cs,masd->macd", _FIT, np.concatenate([rings, advance], axis=2))
    straight = _is_straight(sections, d, r)
    return Tubes(spines, poles, np.stack([N, B, T], axis=2), r, straight)


def pinched_tubes(tubes: Tubes) -> Bool[np.ndarray, " n_m"]:
    """Tubes that bend more sharply than their radius allows: somewhere their surface runs backwards."""
    t = np.linspace(0, 1, 4 * SECTIONS)
    points = tubes.surface_points(np.linspace(0, 2 * np.pi, 13)[:-1], t)
    spine = tubes.spine_points(t)
    step = np.diff(points, axis=1)
    forward = np.einsum("mjid,mjd->mji", step, np.diff(spine, axis=1))
    return (forward <= 0.05 * np.linalg.norm(np.diff(spine, axis=1), axis=2)[..., None] ** 2).any((1, 2))


def _spine_sections(centerlines: Centerlines, ends: np.ndarray, reach: np.ndarray) -> np.ndarray:
    # At least a trace of every curve is left, however much its nodes take.
    share = reach / np.maximum(centerlines.lengths, reach.sum(1) / 0.98)[:, None]
    s_0, s_1 = share[:, :1], 1 - share[:, 1:]
    sections = centerlines.at(s_0 + (s_1 - s_0) * _STEP)
    fade = (1 - _STEP) ** 3 * (1 + 3 * _STEP + 6 * _STEP**2)
    first, last = ends[:, 0] - sections[:, 0], ends[:, 1] - sections[:, -1]
    return sections + fade[None, :, None] * first[:, None] + fade[None, ::-1, None] * last[:, None]


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
