"""Seams keep clear of caps, and fitted pcurves lie on their circles."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

from michell_cad.cad.nodes import angles_between
from michell_cad.cad.spheres import DEGREE, FIT_KNOTS, POLE_MARGIN, fit_longitudes, fit_sines, place_seam, renumber_cuts


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


@pytest.mark.parametrize("k", [1, 2, 4, 6, 8, 12])
@pytest.mark.parametrize("seed", range(4))
def test_seam_meets_no_cap_but_those_of_its_poles(k, seed) -> None:
    a = 0.7 if k < 3 else 0.42
    d = caps(seed, k, a)
    N = unit(np.cross(d, [0.2, 0.5, -0.7]))
    seam = place_seam(d, np.full(len(d), a), np.arange(len(d)), N, [np.zeros(1)] * len(d))
    assert seam is not None
    v = np.linspace(seam.south, seam.north, 400)[1:-1, None]
    meridian = np.cos(v) * seam.zero + np.sin(v) * seam.axis
    assert (np.arccos(np.clip(meridian @ d.T, -1, 1)) > a - 1e-9).all()
    for pole in (-seam.axis, seam.axis):
        assert np.abs(np.arccos(np.clip(d @ pole, -1, 1)) - a).min() >= POLE_MARGIN
    for cut, latitude in ((seam.south_cut, seam.south), (seam.north_cut, seam.north)):
        if cut is None:
            assert abs(latitude) == pytest.approx(np.pi / 2)
        else:
            e, theta = cut
            point = np.cos(a) * d[e] + np.sin(a) * (np.cos(theta) * N[e] + np.sin(theta) * np.cross(d[e], N[e]))
            assert point == pytest.approx(np.cos(latitude) * seam.zero + np.sin(latitude) * seam.axis, abs=1e-12)


def test_no_seam_through_a_fence() -> None:
    """Caps all around, wherever the axis: no meridian passes, and none is made up."""
    golden = (1 + np.sqrt(5)) / 2
    corners = [(0, y, z) for y in (1, -1) for z in (golden, -golden)]
    d = unit(np.array([np.roll(c, i) for c in corners for i in range(3)], float))
    N = unit(np.cross(d, [0.2, 0.5, -0.7]))
    assert place_seam(d, np.full(12, 0.553), np.arange(12), N, [np.zeros(1)] * 12) is None


def test_renumbered_cuts() -> None:
    d = np.array([[0, 0, 1.0]])
    seam = place_seam(d, np.array([0.5]), np.arange(1), np.array([[1.0, 0, 0]]), [np.zeros(1)])
    assert seam is not None
    assert seam.south_cut is not None
    renumbered = renumber_cuts(seam, np.array([17]))
    assert renumbered.south_cut == (17, seam.south_cut[1])


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
    poles, deviation = fit_longitudes(np.eye(3)[None], np.array([R]), circle[None], np.array([a]), ranges)
    assert deviation[0] < 2e-6 * R
    x = np.linspace(0, 1, 501)
    u, v = BSpline(FIT_KNOTS, poles[0], DEGREE)(x).T
    point = np.stack([np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)], axis=1)
    assert point @ d == pytest.approx(np.cos(a), abs=2e-6)


def test_fitted_ellipse_on_its_cylinder() -> None:
    poles = fit_sines((-0.4, 1.2), 2.0, -1.0, 3.0)[0]
    t = np.linspace(-0.4, 1.2, 50)
    u, v = BSpline(FIT_KNOTS, poles, DEGREE)((t + 0.4) / 1.6).T
    assert u == pytest.approx(2.0 - t, abs=1e-10)
    assert v == pytest.approx(3 * np.cos(t), abs=1e-10)
