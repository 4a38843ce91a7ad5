"""Node spheres against the formulas that they obey."""

from itertools import pairwise

import numpy as np
import pytest

from michell_cad.cad.node_sizing import angle_between, separating_radius, size_node
from michell_cad.cad.nodes import (
    LARGEST_RATIO,
    MARGIN,
    SHARPEST_TURN,
    NodeSizes,
    angles_between,
    cap_angle,
    node_levels,
)


def sizes_of(directions, radii, fillet_ratio=0.4, node_ratio=1.8, level=0) -> NodeSizes:
    d = np.array(directions, float)
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    k, room = len(d), node_levels(node_ratio)[level]
    wanted = np.broadcast_to(np.asarray(radii, float), (k,)).copy()
    r, f, reach, creased = np.empty(k), np.empty(k), np.empty(k), np.empty(k, bool)
    ratios = room.smallest_ratio, room.largest_ratio, room.largest_fillet * fillet_ratio
    R, rival = size_node(d, wanted, *ratios, r, f, reach, creased)
    return NodeSizes(np.array([R]), r, f, reach, creased, rival)


def at_angle(degrees: float) -> list[list[float]]:
    a = np.radians(degrees)
    return [[1, 0, 0], [np.cos(a), np.sin(a), 0]]


def test_angles_near_zero_and_pi() -> None:
    tiny = np.array([[np.cos(1e-9), np.sin(1e-9), 0.0]])
    x = np.array([[1.0, 0, 0]])
    assert angles_between(x, tiny)[0] == pytest.approx(1e-9, rel=1e-6)
    assert angles_between(-x, tiny)[0] == pytest.approx(np.pi - 1e-9, abs=1e-15)
    assert angle_between(x[0], tiny[0]) == angles_between(x, tiny)[0]


@pytest.mark.parametrize("degrees", [30.0, 60.0, 100.0])
@pytest.mark.parametrize("f", [0.0, 0.4])
def test_separating_radius_of_equal_members(degrees, f) -> None:
    """R = (r + f) / sin((alpha - margin) / 2) - f."""
    alpha = np.radians(degrees)
    R = separating_radius(alpha, 1.0, 1.0, f, f)
    expected = (1 + f) / np.sin((alpha - MARGIN) / 2) - f
    assert pytest.approx(max(expected, 1.15), rel=1e-6) == R


def test_no_sphere_separates_members_that_nearly_coincide() -> None:
    assert np.isinf(separating_radius(1.9 * MARGIN, 1.0, 1.0, 0.4, 0.4))


def test_separating_radius_of_unequal_members() -> None:
    alpha = np.radians(50.0)
    R = separating_radius(alpha, 1.0, 0.4, 0.4, 0.16)
    total = cap_angle(R, np.array([1.0]), np.array([0.4])) + cap_angle(R, np.array([0.4]), np.array([0.16]))
    assert total + MARGIN == pytest.approx(alpha, rel=1e-6)


def test_room_at_rest() -> None:
    sizes = sizes_of(at_angle(90), 2.0)
    assert sizes.radius == pytest.approx([3.6])
    assert sizes.fillet == pytest.approx([0.8, 0.8])
    assert sizes.reach == pytest.approx(np.sqrt((3.6 + 0.8) ** 2 - (2.0 + 0.8) ** 2))


def test_sphere_grows_then_members_are_creased() -> None:
    grown, creased, acute = (sizes_of(at_angle(a), 1.0) for a in (62.0, 55.0, 20.0))
    assert 1.8 < grown.radius[0] <= LARGEST_RATIO
    assert not grown.creased.any()
    assert creased.creased.all()
    assert creased.fillet == pytest.approx([0.4, 0.4])
    # The tip of the ball's way, and a tenth of the radius beyond it.
    assert creased.reach == pytest.approx(1.4 / np.tan(np.radians(27.5)) + 0.1)
    assert creased.rival.tolist() == [1, 0]
    # The ball keeps to the bend of its way: f = 0.7 (r + f) sin(alpha / 2).
    f = acute.fillet[0]
    assert f == pytest.approx(SHARPEST_TURN * (1 + f) * np.sin(np.radians(10.0)))


def test_without_fillets_members_still_meet() -> None:
    sizes = sizes_of(at_angle(30), 1.0, fillet_ratio=0.0)
    assert sizes.creased.all()
    assert sizes.fillet == pytest.approx([0, 0])
    assert sizes.reach == pytest.approx(1 / np.tan(np.radians(15.0)) + 0.1)


def test_blunt_creases_reach_beyond_their_tips_too() -> None:
    """At a small sphere, members more than a right angle apart can still be creased."""
    sizes = sizes_of(at_angle(92), 1.0, level=3)
    assert sizes.creased.all()
    assert (sizes.reach > 1 / np.tan(np.radians(46.0))).all()


def test_creased_members_share_the_largest_radius() -> None:
    sizes = sizes_of([*at_angle(20), [-1, 0, 0]], [1.0, 0.5, 0.5])
    assert sizes.creased.tolist() == [True, True, False]
    assert sizes.end_radius == pytest.approx([1.0, 1.0, 0.5])


def test_smaller_levels_take_less_room() -> None:
    reaches = [sizes_of(np.eye(3), 1.0, level=level).reach.max() for level in range(len(node_levels(1.8)))]
    assert all(after < 1.02 * before for before, after in pairwise(reaches))
    assert reaches[-1] < 0.7 * reaches[0]


@pytest.mark.parametrize("seed", range(20))
def test_caps_are_clear_or_overlap_clearly(seed) -> None:
    rng = np.random.default_rng(seed)
    d = rng.normal(size=(int(rng.integers(2, 9)), 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    sizes = sizes_of(d, rng.uniform(0.5, 1.0, len(d)))
    if not np.isfinite(sizes.radius[0]):
        return
    a = cap_angle(sizes.radius[0], sizes.end_radius, sizes.fillet)
    first, second = np.triu_indices(len(d), 1)
    gap = angles_between(d[first], d[second]) - a[first] - a[second]
    both = sizes.creased[first] & sizes.creased[second]
    assert ((gap >= MARGIN - 1e-6) | (both & (gap < -0.9 * 2 * MARGIN))).all()
