"""Member splines against circles, straight lines and scipy's B-splines."""

import numpy as np
import pytest
from scipy.interpolate import BSpline as ScipySpline
from scipy.spatial.transform import Rotation
from shapes import box_mesh

from michell_cad.curves import Curve, CurveKind
from michell_cad.errors import InvalidInputError
from michell_cad.isocurves import trace_isocurves
from michell_cad.splines import MemberSplines, curve_spline, fit_splines
from michell_cad.truss import Truss, build_truss, keep_curves


def truss_of(points: np.ndarray, closed: bool = False, kind: CurveKind = CurveKind.INTERIOR) -> Truss:
    """One curve through points."""
    n = len(points)
    ends = np.stack([np.arange(n), np.roll(np.arange(n), -1)], axis=1)[: n if closed else n - 1]
    axis = -1 if kind is CurveKind.FEATURE else 0
    family = "feature" if axis < 0 else "tension"
    curve = Curve(kind, family, axis, (None, 0, 0), 0, np.arange(n), np.arange(len(ends)), closed)
    return Truss(np.asarray(points, float), np.zeros(n, int), np.sort(ends, axis=1), (curve,), 1.0)


def circle(n: int, turn: float = 2 * np.pi) -> np.ndarray:
    t = np.arange(n) * turn / n
    return np.stack([np.cos(t), np.sin(t), np.zeros(n)], axis=1)


@pytest.mark.parametrize("rotation", [np.zeros(3), np.array([0.3, -1.2, 0.7])])
def test_circle_converges_with_the_fourth_power(rotation: np.ndarray) -> None:
    """Bessel tangents at equal steps are exact in direction; the radius errs by O(h^4)."""
    Q = Rotation.from_rotvec(rotation).as_matrix()
    errors = []
    for n in (8, 16, 32):
        splines = fit_splines(truss_of(circle(n) @ Q.T, closed=True))
        points = splines.positions(np.linspace(0, 1, 33))
        np.testing.assert_allclose(points @ Q[:, 2], 0, atol=1e-12)
        errors.append(np.abs(np.linalg.norm(points, axis=2) - 1).max())
        at_nodes = splines.tangents(np.array([0.0, 1.0]))
        nodes = points[:, [0, -1]]
        np.testing.assert_allclose(np.einsum("mkd,mkd->mk", at_nodes, nodes), 0, atol=1e-12)
        assert splines.lengths.sum() == pytest.approx(2 * np.pi, rel=2.0 / n**2)
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (rates > 3.9).all()
    assert errors[0] < 9e-3


def test_straight_curve_stays_straight_and_is_run_at_equal_speed() -> None:
    x = np.array([0, 1, 1.5, 4, 4.2])[:, None] * np.array([[1.0, 2, -2]]) / 3
    splines = fit_splines(truss_of(x))
    np.testing.assert_allclose(splines.lengths, [1, 0.5, 2.5, 0.2], rtol=1e-12)
    s = np.linspace(0, 1, 7)
    expected = x[:-1, None] + s[:, None] * (x[1:] - x[:-1])[:, None]
    np.testing.assert_allclose(splines.positions(s), expected, atol=1e-12)
    np.testing.assert_allclose(splines.tangents(s), np.broadcast_to([1 / 3, 2 / 3, -2 / 3], (4, 7, 3)), atol=1e-12)


def test_fractions_are_of_arc_length() -> None:
    """Positions at small equal fractions are equally far apart, whatever the speed of the pieces."""
    rng = np.random.default_rng(0)
    points = np.cumsum(rng.uniform(0.2, 1.5, (12, 3)), axis=0)
    truss = keep_curves(truss_of(points), np.array([True]))  # one member, ten waypoints
    assert len(truss.members) == 1
    splines = fit_splines(truss)
    assert len(splines.control_points) == 11
    steps = np.linalg.norm(np.diff(splines.positions(np.linspace(0, 1, 4001))[0], axis=0), axis=1)
    np.testing.assert_allclose(steps * 4000, splines.lengths[0], rtol=1e-5)
    assert steps.sum() == pytest.approx(splines.lengths[0], rel=1e-6)
    own = splines.positions(np.array([[0.0, 0.25, 1.0]]))
    np.testing.assert_allclose(own[0, [0, 2]], points[[0, -1]], atol=1e-12)


def test_waypoints_are_passed_in_the_direction_of_the_member() -> None:
    points = circle(12, np.pi)
    whole = fit_splines(truss_of(points))
    merged = keep_curves(truss_of(points[::-1]), np.array([True]))
    one = fit_splines(merged)
    np.testing.assert_allclose(one.lengths[0], whole.lengths.sum(), rtol=1e-9)
    np.testing.assert_allclose(one.control_points[:, 0], points[::-1][:-1], atol=1e-12)


def test_curves_are_smooth_through_their_nodes() -> None:
    mesh = box_mesh((3, 3, 3), (3.0, 3.0, 3.0))
    levels = 1.3 * mesh.vertices + 0.3 * np.sin(mesh.vertices[:, [1, 2, 0]]) + 0.2
    truss = build_truss(trace_isocurves(mesh, levels), 0.8)
    splines = fit_splines(truss)
    ends = splines.tangents(np.array([0.0, 1.0]))
    np.testing.assert_allclose(splines.positions(np.array([0.0]))[:, 0], truss.nodes[truss.members[:, 0]], atol=1e-12)
    np.testing.assert_allclose(splines.positions(np.array([1.0]))[:, 0], truss.nodes[truss.members[:, 1]], atol=1e-12)
    shape = truss.shape_of_member
    checked = 0
    for number, curve in enumerate(truss.curves):
        for a, b, node in zip(curve.members[:-1], curve.members[1:], curve.nodes[1:], strict=False):
            if shape[a] == shape[b] == number and curve.kind is not CurveKind.FEATURE:
                leaving = [
                    ends[m, int(truss.members[m, 1] == node)] * (1 if truss.members[m, 0] == node else -1)
                    for m in (a, b)
                ]
                np.testing.assert_allclose(leaving[0], -leaving[1], atol=1e-9)
                checked += 1
    assert checked > 100


def test_members_on_the_surface_have_the_shape_of_the_surface_curve() -> None:
    """An interior curve that joins the edge of a box for one member does not bow out of it."""
    nodes = np.array([[0, 1, 1], [0, 0, 1], [0, 0, 2], [0, 1, 3], [0, 0, 0], [0, 0, 3.0]])
    edge = Curve(CurveKind.FEATURE, "feature", -1, (None,) * 3, 0, np.array([4, 1, 2, 5]), np.array([2, 1, 4]), False)
    inner = Curve(CurveKind.INTERIOR, "tension", 0, (None, 1, 1), 0, np.array([0, 1, 2, 3]), np.array([0, 1, 3]), False)
    members = np.array([[0, 1], [1, 2], [1, 4], [2, 3], [2, 5]])
    truss = Truss(nodes, np.array([1, 2, 2, 1, 3, 3]), members, (edge, inner), 1.0)
    assert truss.curve_of_member.tolist() == [1, 1, 0, 1, 0]
    assert truss.shape_of_member.tolist() == [1, 0, 0, 1, 0]
    middle = fit_splines(truss).positions(np.array([0.5]))[1, 0]
    np.testing.assert_allclose(middle, [0, 0, 1.5], atol=1e-12)


def test_sharp_bends_of_features_stay_sharp() -> None:
    corner = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0], [2, 2, 0.0]])
    s = np.linspace(0, 1, 5)
    sharp = fit_splines(truss_of(corner, kind=CurveKind.FEATURE)).positions(s)
    np.testing.assert_allclose(sharp[:2, :, 1], 0, atol=1e-12)
    np.testing.assert_allclose(sharp[2:, :, 0], 2, atol=1e-12)
    smooth = fit_splines(truss_of(corner)).positions(s)
    assert np.abs(smooth[1, :, 1]).max() > 0.05


def test_tangent_at_a_point_weighs_the_nearer_neighbour_more() -> None:
    """Chords of lengths 1 and 3 along x and y: the parabola through the three points leaves along (3 x + 1 y) / 4."""
    tangents = fit_splines(truss_of(np.array([[0, 0, 0], [1, 0, 0], [1, 3, 0.0]]))).tangents(np.array([0.0, 1.0]))
    middle = np.array([3, 1, 0]) / np.sqrt(10)
    np.testing.assert_allclose(tangents[:, ::-1][[0, 1], [0, 1]], [middle, middle], atol=1e-12)
    # At the ends 2 d - m: (2 - 3/4, -1/4) and (-3/4, 2 - 1/4).
    ends = np.array([[5, -1, 0], [-3, 7, 0]])
    np.testing.assert_allclose(tangents[[0, 1], [0, 1]], ends / np.linalg.norm(ends, axis=1)[:, None], atol=1e-12)


def test_straight_members_ignore_the_curve() -> None:
    truss = keep_curves(truss_of(circle(7, np.pi)), np.array([True]))
    splines = fit_splines(truss, straight=True)
    np.testing.assert_allclose(splines.lengths, truss.lengths)
    middle = splines.positions(np.array([0.5]))[:, 0]
    np.testing.assert_allclose(middle, truss.nodes[truss.members].mean(1), atol=1e-12)


@pytest.mark.parametrize("closed", [False, True])
def test_whole_curve_as_one_b_spline(closed: bool) -> None:
    """scipy evaluates the B-spline to the nodes at its knots, with one derivative on both sides (C1)."""
    rng = np.random.default_rng(1)
    points = circle(9, 2 * np.pi if closed else 3.0) * rng.uniform(0.95, 1.05, (9, 1)) + rng.normal(size=(9, 3)) * 0.02
    truss = truss_of(points, closed)
    splines = fit_splines(truss)
    curve = truss.curves[0]
    control_points, knots, degree = curve_spline(truss, splines, curve)
    assert degree == 3
    assert len(knots) == len(control_points) + degree + 1
    spline = ScipySpline(knots, control_points, degree)
    breaks = np.unique(knots)
    expected = np.concatenate([points, points[:1]]) if closed else points
    np.testing.assert_allclose(spline(breaks), expected, atol=1e-12)
    np.testing.assert_allclose(breaks[-1], np.linalg.norm(np.diff(expected, axis=0), axis=1).sum())
    derivative = spline.derivative()
    for t in breaks[1:-1]:
        np.testing.assert_allclose(derivative(t - 1e-9), derivative(t + 1e-9), atol=1e-6)
    middle = spline((breaks[:-1] + breaks[1:]) / 2)
    dense = splines.positions(np.linspace(0, 1, 801))
    distance = np.linalg.norm(dense[curve.members] - middle[:, None], axis=2).min(1)
    assert distance.max() < 2e-3


def test_bad_control_points_are_refused() -> None:
    with pytest.raises(InvalidInputError, match="offsets must ascend"):
        MemberSplines(np.zeros((2, 4, 3)), np.array([0, 2, 2]))
