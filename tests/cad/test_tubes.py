"""Tubes against circles, Pappus' theorem and the curves that they follow."""

import numpy as np
import pytest

from michell_cad.cad.centerlines import SAMPLES, SMOOTHINGS, Centerlines, points_at, sample_splines, smooth_curves
from michell_cad.cad.tubes import BEND, FOLLOWS, SECTION_COUNTS, Tubes, circle_parameter, fit_tubes, pinched_tubes
from michell_cad.splines import fit_splines
from tests.cad.layouts import grid_truss


def arc(radius: float, turn: float) -> Centerlines:
    """A circular arc from the origin along x, turning towards y."""
    t = np.linspace(0, turn, SAMPLES)
    points = radius * np.stack([np.sin(t), 1 - np.cos(t), 0 * t], axis=1)
    back = -np.array([np.cos(turn), np.sin(turn), 0])
    return Centerlines(points[None], np.stack([[1.0, 0, 0], back])[None])


def chord(a, b) -> Centerlines:
    """The straight line from a to b."""
    a, b = np.array(a, float), np.array(b, float)
    d = (b - a) / np.linalg.norm(b - a)
    return Centerlines((a + np.linspace(0, 1, SAMPLES)[:, None] * (b - a))[None], np.stack([d, -d])[None])


def tubes_along(lines: Centerlines, reach: float, radii, tight: bool = False) -> Tubes:
    n = len(lines.points)
    radii = np.broadcast_to(np.asarray(radii, float), (n, 3)).copy()
    ends = lines.points[:, [0, -1]]
    return fit_tubes(lines, ends, np.full((n, 2), reach), radii, np.zeros(n), np.full(n, tight))


def enclosed(tubes: Tubes) -> np.ndarray:
    """Volumes between the end discs, by the divergence theorem on fine quads, for one tube."""
    points = tubes.surface_points(np.linspace(0, 2 * np.pi, 361), np.linspace(0, 1, 181))[0]
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]
    side = (np.cross(c - a, d - b) * (a + b + c + d)).sum() / 24
    caps = 0.0
    for row, sign in ((points[0], -1), (points[-1], 1)):
        caps += sign * (np.cross(row[:-1], row[1:]).sum(0) / 2) @ row.mean(0) / 3
    return side + caps


def test_circle_parameter_gives_the_angle_back() -> None:
    angles = np.linspace(0, 2 * np.pi, 101)
    tube = tubes_along(chord([10, 0, 0], [0, 10, 0]), 1.0, 1.0)
    ring = tube.surface_points(angles, np.array([0.0]))[0, 0] - tube.spine_points(np.array([0.0]))[0, 0]
    N = tube.end_normals[0, 0]
    B = np.cross([1.0, -1.0, 0.0] / -np.sqrt(2), N)
    assert pytest.approx(np.cos(angles), abs=1e-12) == ring @ N
    assert pytest.approx(np.sin(angles), abs=1e-12) == ring @ B
    assert (np.diff(circle_parameter(angles)) > 0).all()


def test_straight_tube_is_a_cylinder() -> None:
    line = chord([0, 0, 0], [3, 4, 12])
    assert tubes_along(line, 2.0, 1.0).straight.all()
    assert not tubes_along(line, 2.0, [1, 1.3, 1]).straight.any()
    assert not tubes_along(arc(20, 0.5), 1.0, 1.0).straight.any()


@pytest.mark.parametrize("turn", [0.3, 0.8, 1.5])
def test_volume_of_a_bent_tube(turn) -> None:
    """Pappus: the area of the circle times the length of the axis."""
    tubes = tubes_along(arc(10 / turn, turn), 1e-9, 0.8)
    assert enclosed(tubes) == pytest.approx(np.pi * 0.8**2 * 10, rel=2e-3)


def test_bent_tube_is_a_torus() -> None:
    """Every point of the surface is r away from the circular axis, also next to the ends."""
    R, r, turn = 12.0, 3.0, 0.9
    tubes = tubes_along(arc(R, turn), 1e-9, r)
    points = tubes.surface_points(np.linspace(0, 2 * np.pi, 25), np.linspace(0, 1, 61)).reshape(-1, 3)
    from_center = np.hypot(np.hypot(points[:, 0], points[:, 1] - R) - R, points[:, 2])
    assert from_center == pytest.approx(r, rel=3e-4)


def test_ends_are_circles_square_to_their_directions() -> None:
    lines = arc(12, 0.8)
    tubes = tubes_along(lines, 1.5, [0.7, 1.0, 0.5])
    rings = tubes.surface_points(np.linspace(0, 6, 25), np.array([0.0, 1.0]))[0]
    for ring, point, d, r in zip(rings, lines.points[0, [0, -1]], lines.directions[0], (0.7, 0.5), strict=True):
        arm = ring - point - 1.5 * d
        assert np.linalg.norm(arm, axis=1) == pytest.approx(r, abs=1e-12)
        assert arm @ d == pytest.approx(0, abs=1e-12)


def test_surface_leaves_its_circles_along_the_directions() -> None:
    lines = arc(12, 0.8)
    tubes = tubes_along(lines, 1.5, [0.7, 1.0, 0.5])
    h = 1e-6
    steps = np.diff(tubes.surface_points(np.linspace(0, 6, 25), np.array([0.0, h])), axis=1)[0, 0]
    sine = np.linalg.norm(np.cross(steps, lines.directions[0, 0]), axis=1) / np.linalg.norm(steps, axis=1)
    assert sine.max() < 1e-5


def test_frames_do_not_twist() -> None:
    """On a plane curve the normal of a rotation-minimising frame keeps its angle to the plane."""
    tubes = tubes_along(arc(8, 1.5), 0.5, 0.5)
    assert tubes.end_normals[0, 0, 2] == pytest.approx(tubes.end_normals[0, 1, 2], abs=1e-9)


def test_long_tubes_take_more_circles() -> None:
    """A tube along two waves keeps to them; one along a shallow arc needs the fewest circles."""
    x = np.linspace(0, 40, 161)
    y = 2 * np.sin(x * np.pi / 10)
    fine = np.stack([x, y, 0 * x], axis=1)
    arc_length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(fine, axis=0), axis=1))])
    s = np.linspace(0, arc_length[-1], 129)
    points = np.stack([np.interp(s, arc_length, fine[:, k]) for k in range(3)], axis=1)
    slope = np.array([1, 2 * np.pi / 10, 0]) / np.hypot(1, 2 * np.pi / 10)
    waves = Centerlines(points[None], np.stack([slope, -slope])[None])
    tubes = tubes_along(waves, 0.5, 0.4)
    assert tubes.sections[0] > SECTION_COUNTS[0]
    spine = tubes.spine_points(np.linspace(0.05, 0.95, 201))[0]
    # Distances to the curve, whose slope is at most 2 pi / 10 on either side.
    assert np.abs(spine[:, 1] - 2 * np.sin(spine[:, 0] * np.pi / 10)).max() < FOLLOWS * 0.4 * np.hypot(1, 0.63)
    assert tubes_along(arc(40, 0.3), 0.5, 0.4).sections[0] == SECTION_COUNTS[0]


def test_pinched_tube_is_found() -> None:
    assert pinched_tubes(tubes_along(arc(3.0, 1.5), 0.1, 3.5)).all()
    assert not pinched_tubes(tubes_along(arc(3.0, 1.5), 0.1, 1.0)).any()


def turned(lines: Centerlines, angle: float) -> Centerlines:
    """The same curve, left at its first node along a direction that is turned towards y."""
    d = lines.directions.copy()
    d[0, 0] = [np.cos(angle), np.sin(angle), 0]
    return Centerlines(lines.points, d)


@pytest.mark.parametrize("angle", [0.1, 0.3, 0.6])
def test_spine_comes_back_to_its_curve(angle) -> None:
    """It starts reach * angle off the curve; a radius of curvature of BEND r lets it be back half way."""
    line = turned(chord([0, 0, 0], [40, 0, 0]), angle)
    tubes = tubes_along(line, 2.0, 1.0)
    x, y = tubes.spine_points(np.linspace(0, 1, 801))[0, :, :2].T
    assert y[0] == pytest.approx(2 * np.sin(angle))
    assert y.max() < 2 * np.sin(angle) + 3.9 * BEND * 0.2 * angle**2 + 2 * FOLLOWS
    assert np.abs(y[(x > 25) & (x < 38)]).max() < 0.02
    slope = np.gradient(y, x)
    bend = np.gradient(slope, x) / (1 + slope**2) ** 1.5
    assert np.abs(bend[5:-5]).max() < 1.0
    assert not pinched_tubes(tubes).any()


def test_short_tube_between_slanted_ends_is_not_pinched_once_it_is_free() -> None:
    """The curve's own bend in the rest between two nodes does not matter, only the directions of both ends do."""
    x = np.linspace(0, 3, SAMPLES)
    kinked = np.stack([x, 0.4 * np.exp(-(((x - 1.5) / 0.15) ** 2)), 0 * x], axis=1)
    lines = Centerlines(kinked[None], np.array([[[1.0, 0, 0], [-1, 0, 0]]]))
    bound, free = (tubes_along(lines, 1.1, 1.0, tight) for tight in (False, True))
    assert pinched_tubes(bound).all()
    assert not pinched_tubes(free).any()
    assert free.spine_points(np.linspace(0, 1, 9))[0, :, 1] == pytest.approx(0, abs=1e-12)
    # A long tube follows its curve all the same.
    long = Centerlines(4 * kinked[None], lines.directions)
    assert tubes_along(long, 1.1, 0.1, True).spine_points(np.array([0.5]))[0, 0, 1] > 1.4


def test_smoothing_takes_of_a_half_wave_what_the_eigenvalue_says() -> None:
    """sin(pi k / 16) is an eigenvector of (1/4, 1/2, 1/4) with the eigenvalue cos(pi / 32)^2."""
    x = np.linspace(0, 1, SAMPLES)
    wave = np.stack([x, np.sin(np.pi * x), 0 * x], axis=1)
    for number, passes in enumerate(SMOOTHINGS, 1):
        smooth = smooth_curves(wave[None], np.array([number]))[0]
        kept = np.cos(np.pi / 32) ** (2 * passes) if passes else 0.0
        assert smooth == pytest.approx(wave * [1, kept, 1], abs=1e-12)


def test_slopes_of_a_circle() -> None:
    s = np.linspace(0, 1, 33)
    slopes = arc(10, 1.5).slopes_at(s[None])[0]
    assert slopes == pytest.approx(np.stack([np.cos(1.5 * s), np.sin(1.5 * s), 0 * s], axis=1), abs=3e-4)
    assert points_at(arc(10, 1.5).points, np.array([[0.0, 1.0]]))[0] == pytest.approx(arc(10, 1.5).points[0, [0, -1]])


def test_centerlines_interpolate_between_samples() -> None:
    lines = arc(10, 1.5)
    s = np.linspace(0, 1, 77)
    at = lines.at(s[None])[0]
    exact = 10 * np.stack([np.sin(1.5 * s), 1 - np.cos(1.5 * s), 0 * s], axis=1)
    assert np.abs(at - exact).max() < 3e-6 * 15


def test_centerlines_of_splines() -> None:
    truss = grid_truss((3, 3, 2))
    lines = sample_splines(fit_splines(truss))
    assert np.abs(lines.points[:, [0, -1]] - truss.nodes[truss.members]).max() < 1e-12
    # Along a curve, the two members of an inner node leave it in opposite directions.
    curve = next(c for c in truss.curves if len(c.members) == 2)
    a, b = curve.members
    middle = curve.nodes[1]
    d = [lines.directions[m, list(truss.members[m]).index(middle)] for m in (a, b)]
    assert d[0] @ d[1] == pytest.approx(-1, abs=1e-12)
