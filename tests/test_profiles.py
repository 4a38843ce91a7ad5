"""Profiles: area, centre, sides; and outlines that are none."""

import numpy as np
import pytest

from michell_cad.errors import InvalidInputError
from michell_cad.profiles import MOST_POINTS, PROFILE_NAMES, SIDES, Profile, named_profile, outline_profile

SQUARE = [(0, 0), (2, 0), (2, 2), (0, 2)]


def moments(profile: Profile, samples: int = 400) -> tuple[float, np.ndarray]:
    """Area and centre of a fine polygon, by the shoelace formula."""
    t = np.arange(samples)[:, None, None] / samples
    P = profile.pieces.transpose(1, 0, 2)[:, None]
    X = ((1 - t) ** 3 * P[0] + 3 * (1 - t) ** 2 * t * P[1] + 3 * (1 - t) * t**2 * P[2] + t**3 * P[3]).transpose(1, 0, 2)
    X = X.reshape(-1, 2)
    Y = np.roll(X, -1, axis=0)
    cross = X[:, 0] * Y[:, 1] - X[:, 1] * Y[:, 0]
    area = cross.sum() / 2
    return area, ((X + Y) * cross[:, None]).sum(0) / (6 * area)


@pytest.mark.parametrize("name", PROFILE_NAMES)
@pytest.mark.parametrize("aspect", [1.0, 2.5])
def test_every_profile_has_the_area_of_the_unit_circle_around_its_centre(name, aspect) -> None:
    profile = named_profile(name, aspect)
    area, centre = moments(profile)
    assert area == pytest.approx(np.pi, rel=1e-5)
    assert centre == pytest.approx([0, 0], abs=1e-6)
    assert len(profile.sides) == SIDES.get(name, 1)


def test_the_round_profile_is_a_circle() -> None:
    t = np.linspace(0, 1, 33)[:, None, None]
    P = named_profile("round").pieces.transpose(1, 0, 2)
    X = (1 - t) ** 3 * P[0] + 3 * (1 - t) ** 2 * t * P[1] + 3 * (1 - t) * t**2 * P[2] + t**3 * P[3]
    assert np.abs(np.linalg.norm(X, axis=-1) - 1).max() < 5e-6


def test_a_square_of_aspect_two_is_a_rectangle_along_x() -> None:
    """Sides a and a / 2 with a^2 / 2 = pi."""
    corners = named_profile("square", 2.0).pieces[:, 0]
    assert np.ptp(corners, axis=0) == pytest.approx([np.sqrt(2 * np.pi), np.sqrt(np.pi / 2)])
    assert named_profile("square").reach == pytest.approx(np.sqrt(np.pi / 2))


@pytest.mark.parametrize("rows", [SQUARE, SQUARE[::-1], [*SQUARE, SQUARE[0]], [(7 + x / 9, y / 9) for x, y in SQUARE]])
def test_size_place_direction_and_a_repeated_first_point_do_not_matter(rows) -> None:
    corners = outline_profile(rows).pieces[:, 0]
    expected = named_profile("square").pieces[:, 0]
    distance = np.linalg.norm(corners[:, None] - expected, axis=2)
    assert distance.min(1) == pytest.approx(np.zeros(4), abs=1e-12)
    assert sorted(distance.argmin(1).tolist()) == [0, 1, 2, 3]


def test_a_smooth_join_is_no_corner() -> None:
    """A square with one corner rounded by a curve that leaves and arrives along its sides."""
    profile = outline_profile([(0, 0), (3, 0, 3.5, 0, 4, 0.5), (4, 1), (4, 4), (0, 4)])
    assert [len(side) for side in profile.sides] == [10, 2, 2]
    assert moments(profile)[0] == pytest.approx(np.pi, rel=1e-5)


def test_polygons_for_meshes_have_the_area_and_the_corners() -> None:
    for profile in (
        named_profile("round", 2.0),
        named_profile("hexagon"),
        outline_profile([(0, 0), (4, 0, 4, 3, 0, 3)]),
    ):
        X = np.asarray(profile.polygon)
        Y = np.roll(X, -1, axis=0)
        assert (X[:, 0] * Y[:, 1] - X[:, 1] * Y[:, 0]).sum() / 2 == pytest.approx(np.pi)
    assert named_profile("hexagon").polygon == pytest.approx(named_profile("hexagon").pieces[:, 0])


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (
            [(0, 0), (1, 1), (1, 0), (0, 1)],
            r"side from point 1 \(0, 0\) .* point 3 \(1, 0\) meet; in the order 1, 3, 2, 4",
        ),
        ([(0, 0), (4, 0), (4, 4), (2, 0), (0, 4)], "crosses or touches itself"),
        ([(0, 0, 3, 3, -1, 3), (2, 0)], "crosses or touches itself"),
        ([(0, 0), (1, 0)], "closed outline of 3 to 200 points, found 2: add points"),
        ([(0, 0), (1, 0), (2, 0)], "touches itself|enclose no area"),
        ([(0, 0), (1, 0), (1, 0), (0, 1)], "points 2 and 3 of the profile coincide"),
        ([(0, 0), (1, 0, 3), (0, 1)], r"point 2 of the profile: expected \[x, y\]"),
        ([(0, 0), (1, float("nan")), (0, 1)], "point 2 of the profile"),
        ([(np.cos(a), np.sin(a)) for a in np.linspace(0, 6, MOST_POINTS + 1)], "found 201: draw it with fewer"),
        ([], "found 0"),
    ],
)
def test_what_is_no_outline_is_refused(rows, message) -> None:
    with pytest.raises(InvalidInputError, match=message):
        outline_profile(rows)
