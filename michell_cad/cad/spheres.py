"""Sphere faces: where the poles and the seam of each node's sphere lie, and its boundary circles as pcurves.

The kernel's sphere has latitude and longitude. Each pole lies inside a cap or well inside the face, where it becomes a
degenerated edge; the seam runs along a meridian that meets no cap but those of the poles. Best is an axis through the
centre of a cap: its circle is a line of constant latitude.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from michell_cad.cad.fits import FINE_ENOUGH, FITS, Fitted

POLE_MARGIN = 0.12
"""Angle between a pole and the nearest circle: nearer, the longitude changes too fast to be fitted."""

SEAM_MARGIN = 0.02
"""Angle of longitude between the seam and the nearest other cap."""

CUT_MARGIN = 0.02
"""Angle on a circle between the seam's crossing and the nearest vertex."""

@dataclass(frozen=True, eq=False)
class Seam:
    """Placement of one sphere's parameters.

    `axis` points to the north pole, `zero` is the direction of longitude 0, where the seam runs from latitude `south`
    to `north`. `south_cut` and `north_cut` are (cap, angle on its circle) where it meets caps, None at a free pole.
    """

    axis: Float[np.ndarray, " 3"]
    zero: Float[np.ndarray, " 3"]
    south: float
    north: float
    south_cut: tuple[int, float] | None
    north_cut: tuple[int, float] | None


def place_seam(
    directions: Float[np.ndarray, "k 3"],
    half_angles: Float[np.ndarray, " k"],
    groups: Int[np.ndarray, " k"],
    normals: Float[np.ndarray, "k 3"],
    vertices: list[Float[np.ndarray, " _"]],
) -> Seam | None:
    """Find an axis and a meridian for the sphere of one node; None if there is none.

    Parameters
    ----------
    directions, half_angles : the caps.
    groups : caps with the same number overlap, directly or through others.
    normals : unit vectors to angle 0 of each circle.
    vertices : angles of the vertices on each circle.
    """
    best, score = None, 0.0
    for axes in (-directions, _tilted(directions, half_angles, normals)):
        for axis in axes:
            found = _try_axis(axis, directions, half_angles, groups)
            if found is None or found[1] - found[0] <= max(score, 2 * SEAM_MARGIN):
                continue
            seam = _try_meridians(axis, found, directions, half_angles, normals, vertices)
            if seam is not None:
                best, score = seam, found[1] - found[0]
        if best is not None:
            return best
    return None


def renumber_cuts(seam: Seam, numbers: Int[np.ndarray, " k"]) -> Seam:
    """The seam with cap i called ``numbers[i]``."""
    south, north = (cut and (int(numbers[cut[0]]), cut[1]) for cut in (seam.south_cut, seam.north_cut))
    return replace(seam, south_cut=south, north_cut=north)


def _tilted(d: np.ndarray, a: np.ndarray, N: np.ndarray) -> np.ndarray:
    """Axes that run through caps off their centres."""
    B = np.cross(d, N)
    turn = np.linspace(0, 2 * np.pi, 7)[:-1]
    arms = np.cos(turn)[:, None, None] * N + np.sin(turn)[:, None, None] * B
    tilt = 0.5 * a[None, :, None]
    return -(np.cos(tilt) * d + np.sin(tilt) * arms).reshape(-1, 3)


def _basis(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    x = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    x /= np.linalg.norm(x)
    return x, np.cross(axis, x)


def _try_axis(axis: np.ndarray, d: np.ndarray, a: np.ndarray, groups: np.ndarray) -> tuple[float, float] | None:
    """The widest free interval of longitudes (from the basis of the axis) between the caps, or None."""
    north = np.arccos(np.clip(d @ axis, -1, 1))
    from_south = np.pi - north
    if min(np.abs(north - a).min(), np.abs(from_south - a).min()) < POLE_MARGIN:
        return None
    at_north, at_south = north < a, from_south < a
    # One union of caps around both poles leaves no room for a seam.
    if set(groups[at_north]) & set(groups[at_south]):
        return None
    rest = ~(at_north | at_south)
    if not rest.any():
        return -np.pi, np.pi
    x, y = _basis(axis)
    middle = np.arctan2(d[rest] @ y, d[rest] @ x)
    half = np.arcsin(np.minimum(np.sin(a[rest]) / np.sin(north[rest]), 1.0))
    order = np.argsort(middle - half)
    low, high = (middle - half)[order], np.maximum.accumulate((middle + half)[order])
    wrapped = max(high[-1] - 2 * np.pi, -np.inf)
    opens = np.concatenate([high[:-1], [high[-1]]])
    opens = np.maximum(opens, wrapped)
    closes = np.concatenate([low[1:], [low[0] + 2 * np.pi]])
    widest = int(np.argmax(closes - opens))
    return (float(opens[widest]), float(closes[widest])) if closes[widest] > opens[widest] else None


def _try_meridians(axis, interval, d, a, N, vertices) -> Seam | None:
    low, high = interval
    x, y = _basis(axis)
    width = high - low
    # From the middle outwards.
    for share in (0.5, 0.42, 0.58, 0.34, 0.66, 0.26, 0.74, 0.18, 0.82):
        longitude = low + share * width
        zero = np.cos(longitude) * x + np.sin(longitude) * y
        ends = []
        for pole in (-axis, axis):
            cut = _leave_caps(pole, zero, d, a, N)
            if cut is not None:
                cap, angle, _ = cut
                gaps = np.abs(np.mod(angle - vertices[cap] + np.pi, 2 * np.pi) - np.pi)
                if len(gaps) and gaps.min() < CUT_MARGIN:
                    break
            ends.append(cut)
        if len(ends) == 2:
            (south, north) = ends
            return Seam(
                axis,
                zero,
                -np.pi / 2 + (south[2] if south else 0.0),
                np.pi / 2 - (north[2] if north else 0.0),
                south[:2] if south else None,
                north[:2] if north else None,
            )
    return None


def _leave_caps(pole, zero, d, a, N) -> tuple[int, float, float] | None:
    """Where the meridian from a pole to `zero` leaves the caps: (cap, angle on its circle, angle from the pole)."""
    caps = np.flatnonzero(np.arccos(np.clip(d @ pole, -1, 1)) < a)
    if not len(caps):
        return None
    p, m = d[caps] @ pole, d[caps] @ zero
    away = np.arctan2(m, p) + np.arccos(np.clip(np.cos(a[caps]) / np.hypot(p, m), -1, 1))
    last = int(np.argmax(away))
    cap = int(caps[last])
    q = np.cos(away[last]) * pole + np.sin(away[last]) * zero
    angle = np.arctan2(q @ np.cross(d[cap], N[cap]), q @ N[cap])
    return cap, float(np.mod(angle, 2 * np.pi)), float(away[last])


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
