"""Seams keep clear of caps, and fitted pcurves lie on their circles."""

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.spatial.transform import Rotation

from michell_cad.cad.fits import FINE_ENOUGH, FITS, fit_sines
from michell_cad.cad.nodes import angles_between
from michell_cad.cad.spheres import POLE_MARGIN, Caps, Seams, fit_longitudes, place_seams


def unit(x) -> np.ndarray:
    return x / np.linalg.norm(x, axis=-1, keepdims=True)


def caps(seed: int, k: int, a: float) -> np.ndarray:
    """Directions at least 2 a + 1 degree apart."""
    rng = np.random.default_rng(seed)
    found: list[np.ndarray] = []
    for d in unit(rng.normal(size=(2000, 3))):
        if len(found) < k and all(angles_between(d, other[None])[0] > 2 * a + 0.02 for other in found):
            found.append(d)
    return np.array(found)


def seam_of(d: np.ndarray, a: float, N: np.ndarray) -> Seams:
    k = len(d)
    return place_seams(Caps(d[None], np.full((1, k), a), np.arange(k)[None], N[None], np.zeros((1, k, 1))))


@pytest.mark.parametrize("k", [1, 2, 4, 6, 8, 12])
@pytest.mark.parametrize("seed", range(4))
def test_seam_meets_no_cap_but_those_of_its_poles(k, seed) -> None:
    a = 0.7 if k < 3 else 0.42
    d = caps(seed, k, a)
    N = unit(np.cross(d, [0.2, 0.5, -0.7]))
    seams = seam_of(d, a, N)
    assert seams.found[0]
    axis, zero, (south, north) = seams.axis[0], seams.zero[0], seams.latitudes[0]
    v = np.linspace(south, north, 400)[1:-1, None]
    meridian = np.cos(v) * zero + np.sin(v) * axis
    assert (np.arccos(np.clip(meridian @ d.T, -1, 1)) > a - 1e-9).all()
    for pole in (-axis, axis):
        assert np.abs(np.arccos(np.clip(d @ pole, -1, 1)) - a).min() >= POLE_MARGIN
    for e, theta, latitude in zip(seams.cap[0], seams.angle[0], (south, north), strict=True):
        if e < 0:
            assert abs(latitude) == pytest.approx(np.pi / 2)
        else:
            point = np.cos(a) * d[e] + np.sin(a) * (np.cos(theta) * N[e] + np.sin(theta) * np.cross(d[e], N[e]))
            assert point == pytest.approx(np.cos(latitude) * zero + np.sin(latitude) * axis, abs=1e-12)


CROWDED = [
    [0.109, -0.994, -0.011],
    [-0.900, -0.434, -0.045],
    [0.967, -0.255, 0.012],
    [0.014, -0.336, 0.942],
    [-0.001, 0.159, -0.987],
    [-0.965, 0.261, -0.031],
    [0.897, 0.441, 0.011],
    [-0.058, 0.347, 0.936],
    [-0.109, 0.994, 0.011],
]
"""Nine members of a node, three pairs of which overlap: 1 and 5, 2 and 6, 3 and 7."""


@pytest.mark.parametrize("turn", np.linspace(0, 2 * np.pi, 13)[:-1])
def test_no_seam_of_overlapping_caps_meets_another_cap(turn) -> None:
    """Free intervals of longitude end where any cap begins, also one that straddles the longitude pi."""
    axis = unit(np.array([0.3, -0.5, 0.8]))
    d = Rotation.from_rotvec(turn * axis).apply(unit(np.array(CROWDED)))
    a, groups = np.radians(32.65), np.array([0, 1, 2, 3, 4, 1, 2, 3, 8])
    N = unit(np.cross(d, [0.2, 0.5, -0.7]))
    seams = place_seams(Caps(d[None], np.full((1, 9), a), groups[None], N[None], np.zeros((1, 9, 1))))
    assert seams.found[0]
    v = np.linspace(*seams.latitudes[0], 400)[1:-1, None]
    meridian = np.cos(v) * seams.zero[0] + np.sin(v) * seams.axis[0]
    assert (np.arccos(np.clip(meridian @ d.T, -1, 1)) > a - 1e-9).all()


def fence() -> np.ndarray:
    """The corners of an icosahedron."""
    golden = (1 + np.sqrt(5)) / 2
    corners = [(0, y, z) for y in (1, -1) for z in (golden, -golden)]
    return unit(np.array([np.roll(c, i) for c in corners for i in range(3)], float))


def test_no_seam_through_a_fence() -> None:
    """Caps all around, wherever the axis: no meridian passes, and none is made up."""
    d = fence()
    assert not seam_of(d, 0.553, unit(np.cross(d, [0.2, 0.5, -0.7]))).found[0]


def test_nodes_of_a_batch_do_not_mix() -> None:
    """Several nodes at once give what each gives alone, also if one of them has no seam."""
    rng = np.random.default_rng(3)
    d = np.stack([caps(0, 12, 0.35), fence(), caps(1, 12, 0.35)])
    a = np.repeat([[0.35], [0.553], [0.35]], 12, axis=1)
    N = unit(np.cross(d, rng.normal(size=3)))
    vertices = np.sort(rng.uniform(0, 2 * np.pi, (3, 12, 2)), axis=2)
    groups = np.tile(np.arange(12), (3, 1))
    together = place_seams(Caps(d, a, groups, N, vertices))
    assert together.found.tolist() == [True, False, True]
    for i in (0, 2):
        alone = place_seams(Caps(d[[i]], a[[i]], groups[[i]], N[[i]], vertices[[i]]))
        assert alone.zero[0] == pytest.approx(together.zero[i], abs=1e-12)
        assert alone.cap[0].tolist() == together.cap[i].tolist()


@pytest.mark.parametrize("tilt", [0.0, 0.3, 1.1, 2.0])
def test_fitted_circles_lie_on_their_circles(tilt) -> None:
    a, R = 0.6, 2.5
    d = np.array([np.sin(tilt) * np.cos(2.0), np.sin(tilt) * np.sin(2.0), np.cos(tilt)])
    N = unit(np.cross(d, [0.3, 0.1, 0.9]))
    circle = np.stack([N, np.cross(d, N), d])
    start = 0.0
    if tilt < a:
        # Around the pole, the arc begins where it meets longitude 0.
        theta = np.linspace(0, 2 * np.pi, 200001)
        q = np.cos(a) * d + np.sin(a) * (np.cos(theta)[:, None] * N + np.sin(theta)[:, None] * np.cross(d, N))
        u = np.arctan2(q[:, 1], q[:, 0])
        start = float(theta[np.argmin(np.abs(u))])
    ranges = np.array([[start, start + 2 * np.pi]])
    fitted = fit_longitudes(np.eye(3)[None], np.array([R]), circle[None], np.array([a]), ranges)
    assert fitted.deviation[0] < FINE_ENOUGH * R
    fit = FITS[fitted.fit[0]]
    x = np.linspace(0, 1, 501)
    u, v = BSpline(fit.knots, fitted.poles[fitted.fit[0]][0], fit.degree)(x).T
    point = np.stack([np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)], axis=1)
    assert point @ d == pytest.approx(np.cos(a), abs=2 * FINE_ENOUGH)


def test_finer_fits_where_needed() -> None:
    """An arc past a pole takes more points than one along the equator."""
    near = np.array([[[0, 1.0, 0], [0, 0, 1], [1, 0, 0]], [[1.0, 0, 0], [0, 1, 0], [0, 0, 1]]])
    a = np.array([1.4, np.pi / 2 - 0.3])
    ranges = np.array([[0.3, 2.9], [0.3, 2.9]])
    fitted = fit_longitudes(np.stack([np.eye(3)] * 2), np.ones(2), near, a, ranges)
    assert fitted.fit[0] > fitted.fit[1] == 0
    assert (fitted.deviation < FINE_ENOUGH).all()


def test_fitted_ellipse_on_its_cylinder() -> None:
    fitted = fit_sines(np.array([[-0.4, 1.2]]), np.array([2.0]), np.array([-1.0]), np.array([3.0]))
    t = np.linspace(-0.4, 1.2, 50)
    u, v = BSpline(FITS[0].knots, fitted.poles[0][0], FITS[0].degree)((t + 0.4) / 1.6).T
    assert u == pytest.approx(2.0 - t, abs=1e-8)
    assert v == pytest.approx(3 * np.cos(t), abs=1e-8)
