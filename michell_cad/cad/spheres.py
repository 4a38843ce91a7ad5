"""Sphere faces: where the poles and the seam of each node's sphere lie, and its boundary circles as pcurves.

The kernel's sphere has latitude and longitude. Each pole lies inside a cap or well inside the face, where it becomes a
degenerated edge; the seam runs along a meridian that meets no cap but those of the poles. Best is an axis through the
centre of a cap: its circle is a line of constant latitude.
"""

from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Bool, Float, Int

from michell_cad.arrays import freeze
from michell_cad.cad.fits import FINE_ENOUGH, FITS, Fitted

POLE_MARGIN = 0.12
"""Angle between a pole and the nearest circle: nearer, the longitude changes too fast to be fitted."""

SEAM_MARGIN = 0.02
"""Angle of longitude between the seam and the nearest other cap."""

CUT_MARGIN = 0.02
"""Angle on a circle between the seam's crossing and the nearest vertex."""


@dataclass(frozen=True, eq=False)
class Seams:
    """Placement of the parameters of n spheres.

    Parameters
    ----------
    found : (n,) bool; the rest has no meaning where there is no place for a seam.
    axis : (n, 3) float, unit vectors to the north poles.
    zero : (n, 3) float, unit vectors to longitude 0, where the seam runs from south to north.
    latitudes : (n, 2) float, where the seam starts and ends.
    cap : (n, 2) int, the caps at whose circles it does, counted within the node; -1 at a free pole.
    angle : (n, 2) float, and where on these circles.
    """

    found: Bool[np.ndarray, " n"]
    axis: Float[np.ndarray, "n 3"]
    zero: Float[np.ndarray, "n 3"]
    latitudes: Float[np.ndarray, "n 2"]
    cap: Int[np.ndarray, "n 2"]
    angle: Float[np.ndarray, "n 2"]

    def __post_init__(self) -> None:
        freeze(self, found=bool, axis=np.float64, zero=np.float64, latitudes=np.float64)
        freeze(self, cap=np.int64, angle=np.float64)


def no_seams(n: int) -> dict[str, np.ndarray]:
    """The columns of `Seams`, to be filled in, for n spheres without seam."""
    return {
        "found": np.zeros(n, bool),
        "axis": np.zeros((n, 3)),
        "zero": np.zeros((n, 3)),
        "latitudes": np.zeros((n, 2)),
        "cap": np.full((n, 2), -1),
        "angle": np.zeros((n, 2)),
    }


@dataclass(frozen=True, eq=False)
class Caps:
    """The caps of n nodes with k members each.

    Parameters
    ----------
    directions, half_angles : (n, k, 3) and (n, k).
    groups : (n, k) int, caps of a node with the same number overlap, directly or through others.
    normals : (n, k, 3), unit vectors to angle 0 of each circle.
    vertices : (n, k, v), angles of the vertices on each circle; filled up by repeating one.
    """

    directions: Float[np.ndarray, "n k 3"]
    half_angles: Float[np.ndarray, "n k"]
    groups: Int[np.ndarray, "n k"]
    normals: Float[np.ndarray, "n k 3"]
    vertices: Float[np.ndarray, "n k v"]

    def rows(self, some: np.ndarray) -> "Caps":
        """Some of the nodes."""
        return Caps(*(getattr(self, f.name)[some] for f in fields(self)))


def place_seams(caps: Caps) -> Seams:
    """Find an axis and a meridian for each sphere: first through the centre of a cap, then through caps off centre."""
    columns = no_seams(len(caps.directions))
    _place_on_axes(caps, -caps.directions, columns)
    if not columns["found"].all():
        _place_on_axes(caps, _tilted(caps), columns)
    return Seams(**columns)


def _tilted(caps: Caps) -> np.ndarray:
    """Axes that run through caps off their centres."""
    d, N = caps.directions[:, :, None], caps.normals[:, :, None]
    turn = np.linspace(0, 2 * np.pi, 7)[:-1, None]
    arms = np.cos(turn) * N + np.sin(turn) * np.cross(d, N)
    tilt = 0.5 * caps.half_angles[:, :, None, None]
    return -(np.cos(tilt) * d + np.sin(tilt) * arms).reshape(len(d), -1, 3)


def _place_on_axes(caps: Caps, axes: np.ndarray, columns: dict[str, np.ndarray]) -> None:
    """Enter seams for nodes that have none, on one of their axes (n, j, 3): those with wide gaps between caps first."""
    rows = np.flatnonzero(~columns["found"])
    low, high = _widest_gaps(caps.rows(rows), axes[rows])
    width = np.where(high - low > 2 * SEAM_MARGIN, high - low, -1.0)
    order = np.argsort(-width, axis=1, kind="stable")
    at = np.arange(len(rows))
    for j in range(axes.shape[1]):
        at = at[width[at, order[at, j]] > 0]
        if not len(at):
            break
        k = order[at, j]
        found = _try_meridians(caps.rows(rows[at]), axes[rows[at], k], low[at, k], high[at, k])
        good = np.flatnonzero(found.found)
        for name, column in columns.items():
            column[rows[at[good]]] = getattr(found, name)[good]
        at = at[~found.found]


def _bases(axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors normal to each axis (..., 3) and to each other."""
    helper = np.eye(3)[np.argmin(np.abs(axes), axis=-1)]
    x = np.cross(axes, helper)
    x /= np.linalg.norm(x, axis=-1, keepdims=True)
    return x, np.cross(axes, x)


def _widest_gaps(caps: Caps, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The widest free interval of longitudes, from the basis of each axis; empty where an axis is not possible."""
    d, a = caps.directions, caps.half_angles[:, None]
    north = np.arccos(np.clip(axes @ d.transpose(0, 2, 1), -1, 1))
    south = np.pi - north
    possible = np.minimum(np.abs(north - a), np.abs(south - a)).min(2) >= POLE_MARGIN
    at_north, at_south = north < a, south < a
    # One union of caps around both poles leaves no room for a seam.
    same = caps.groups[:, None, :, None] == caps.groups[:, None, None, :]
    possible &= ~(at_north[..., None] & at_south[..., None, :] & same).any((2, 3))
    rest = ~(at_north | at_south)
    x, y = _bases(axes)
    middle = np.arctan2(y @ d.transpose(0, 2, 1), x @ d.transpose(0, 2, 1))
    half = np.arcsin(np.minimum(np.sin(a) / np.maximum(np.sin(north), np.finfo(float).tiny), 1.0))
    # All intervals begin in one turn, so that none is met again before the first one.
    lower = np.where(rest, np.mod(middle - half, 2 * np.pi), np.inf)
    upper = np.where(rest, lower + 2 * half, -np.inf)
    order = np.argsort(lower, axis=2)
    lower, upper = (np.take_along_axis(bound, order, axis=2) for bound in (lower, upper))
    opens = np.maximum(np.maximum.accumulate(upper, axis=2), upper.max(2, keepdims=True) - 2 * np.pi)
    closes = np.concatenate([lower[..., 1:], np.full_like(lower[..., :1], np.inf)], axis=2)
    closes = np.where(np.isinf(closes), lower[..., :1] + 2 * np.pi, closes)
    with np.errstate(invalid="ignore"):
        gap = np.where(np.isinf(lower), -np.inf, closes - opens)
    widest = gap.argmax(2)[..., None]
    free = ~rest.any(2)
    low = np.where(free, -np.pi, np.take_along_axis(opens, widest, axis=2)[..., 0])
    high = np.where(free, np.pi, np.take_along_axis(closes, widest, axis=2)[..., 0])
    return np.where(possible, low, 0.0), np.where(possible, high, 0.0)


SHARES = np.array([0.5, 0.42, 0.58, 0.34, 0.66, 0.26, 0.74, 0.18, 0.82])
"""Meridians that are tried, as shares of the free interval: from the middle outwards."""


def _try_meridians(caps: Caps, axis: np.ndarray, low: np.ndarray, high: np.ndarray) -> Seams:
    """The first meridian in the interval that keeps away from the vertices where it leaves the caps of the poles."""
    x, y = _bases(axis)
    longitude = low[:, None] + SHARES * (high - low)[:, None]
    zero = np.cos(longitude)[..., None] * x[:, None] + np.sin(longitude)[..., None] * y[:, None]
    ok = np.ones(longitude.shape, bool)
    cuts = []
    for pole in (-axis, axis):
        cap, angle, away = _leave_caps(caps, pole, zero)
        vertices = np.take_along_axis(caps.vertices, np.maximum(cap, 0)[..., None], axis=1)
        gap = np.abs(np.mod(angle[..., None] - vertices + np.pi, 2 * np.pi) - np.pi).min(2)
        ok &= (cap < 0) | (gap >= CUT_MARGIN)
        cuts.append((cap, angle, away))
    n, first = np.arange(len(axis)), ok.argmax(1)
    cap, angle, away = (np.stack([cut[k][n, first] for cut in cuts], axis=1) for k in range(3))
    latitudes = np.array([-np.pi / 2, np.pi / 2]) + np.array([1, -1]) * away
    return Seams(ok.any(1), axis, zero[n, first], latitudes, cap, angle)


def _leave_caps(caps: Caps, pole: np.ndarray, zero: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where meridians from a pole to `zero` (n, j, 3) leave the caps: cap (or -1), angle on its circle and from the
    pole."""
    d, a = caps.directions, caps.half_angles
    inside = (np.arccos(np.clip(np.einsum("nkd,nd->nk", d, pole), -1, 1)) < a)[:, None]
    p, m = np.einsum("nkd,nd->nk", d, pole)[:, None], zero @ d.transpose(0, 2, 1)
    length = np.maximum(np.hypot(p, m), np.finfo(float).tiny)
    away = np.arctan2(m, p) + np.arccos(np.clip(np.cos(a)[:, None] / length, -1, 1))
    away = np.where(inside, away, -np.inf)
    cap = away.argmax(2)
    farthest = np.take_along_axis(away, cap[..., None], axis=2)[..., 0]
    none = np.isinf(farthest)
    farthest = np.where(none, 0.0, farthest)
    q = np.cos(farthest)[..., None] * pole[:, None] + np.sin(farthest)[..., None] * zero
    rows = np.arange(len(d))[:, None]
    N, at = caps.normals[rows, cap], d[rows, cap]
    angle = np.arctan2((q * np.cross(at, N)).sum(-1), (q * N).sum(-1))
    return np.where(none, -1, cap), np.mod(angle, 2 * np.pi), farthest


def fit_longitudes(
    sphere_frames: Float[np.ndarray, "n 3 3"],
    R: Float[np.ndarray, " n"],
    circle_frames: Float[np.ndarray, "n 3 3"],
    half_angles: Float[np.ndarray, " n"],
    ranges: Float[np.ndarray, "n 2"],
) -> Fitted:
    """Pcurves (longitude, latitude) of circular arcs on spheres, each by the smallest of `FITS` that is fine enough.

    Parameters
    ----------
    sphere_frames : rows: direction of longitude 0, of longitude pi/2, axis.
    R : radii of the spheres, mm.
    circle_frames : rows N, B, d of the circles, d pointing from the sphere's centre to the circle's.
    half_angles : of the caps inside the circles.
    ranges : first and last angle of the arcs. No arc crosses longitude 0 but at its ends.
    """
    fit, deviation, poles = np.zeros(len(R), int), np.zeros(len(R)), []
    rows = np.arange(len(R))
    for number, one in enumerate(FITS):
        arcs = circle_frames[rows], half_angles[rows], ranges[rows]
        found = np.einsum("px,nxd->npd", one.to_poles, _longitudes(_arc(*arcs, one.places), sphere_frames[rows]))
        longitude, latitude = np.moveaxis(one.halfway(found), -1, 0)
        on_sphere = np.stack(
            [np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)], axis=-1
        )
        expected = np.einsum("nxd,nkd->nxk", _arc(*arcs, one.between), sphere_frames[rows])
        missed = np.linalg.norm(on_sphere - expected, axis=-1).max(1)
        done = (missed <= FINE_ENOUGH) | (number == len(FITS) - 1)
        fit[rows[done]], deviation[rows[done]] = number, R[rows[done]] * missed[done]
        poles.append(found[done])
        rows = rows[~done]
    return Fitted(fit, poles, deviation)


def _arc(circle_frames: np.ndarray, half_angles: np.ndarray, ranges: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Unit vectors at the places x along arcs of circles."""
    theta = ranges[:, :1] + (ranges[:, 1:] - ranges[:, :1]) * x
    N, B, d = circle_frames.transpose(1, 0, 2)[:, :, None]
    a = half_angles[:, None, None]
    return np.cos(a) * d + np.sin(a) * (np.cos(theta)[..., None] * N + np.sin(theta)[..., None] * B)


def _longitudes(points: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Longitude, continuous along each row and from 0 to 2 pi in its middle, and latitude."""
    q = np.einsum("nxd,nkd->nxk", points, frames)
    u = np.unwrap(np.arctan2(q[..., 1], q[..., 0]), axis=1)
    u -= 2 * np.pi * np.floor(u[:, u.shape[1] // 2] / (2 * np.pi))[:, None]
    return np.stack([u, np.arcsin(np.clip(q[..., 2], -1, 1))], axis=-1)
