"""Stress pictures: the colour of a stress is where the stress is, and the bar tells its value."""

import numpy as np
import pytest
from PIL import Image
from quadratic_shapes import block

from michell_cad.errors import InvalidInputError
from michell_cad.picture import StressedBalls, render_member_stress, render_solid_stress
from michell_cad.picture.stress_picture import LEVELS, stress_colours, tick_values

SIZE = (700, 500)


def hues(path) -> tuple[np.ndarray, np.ndarray]:
    """Red minus blue of every pixel, and which pixels are coloured."""
    with Image.open(path) as picture:
        rgb = np.asarray(picture.convert("RGB")).astype(float)
    return rgb[:, :, 0] - rgb[:, :, 2], np.ptp(rgb, axis=2) > 30


def test_stress_grows_across_a_block(tmp_path):
    """Blue at one end, red at the other, yellow between them."""
    mesh = block((4, 2, 2), lambda x: x * [6.0, 1.0, 1.0])
    render_solid_stress(tmp_path / "a.png", mesh.nodes, mesh.boundary, mesh.nodes[:, 0], 6.0, size=SIZE)
    red, drawn = hues(tmp_path / "a.png")
    drawn[:, SIZE[0] - 170 :] = False
    columns = np.flatnonzero(drawn.sum(0) > 10)
    mean = np.array([red[drawn[:, c], c].mean() for c in columns])
    ends = sorted([mean[:20].mean(), mean[-20:].mean()])
    assert ends[0] < -60
    assert ends[1] > 80
    assert -20 < mean[len(mean) // 2] < 100


def test_the_bar_has_all_colours_from_bottom_to_top(tmp_path):
    mesh = block((1, 1, 1))
    render_solid_stress(tmp_path / "a.png", mesh.nodes, mesh.boundary, 0 * mesh.nodes[:, 0], 1.0, size=SIZE)
    with Image.open(tmp_path / "a.png") as picture:
        bar = np.asarray(picture.convert("RGB"))[210:370:10, SIZE[0] - 115].astype(float) / 255
    at = [np.linalg.norm(stress_colours() - colour, axis=1).argmin() for colour in bar]
    assert (np.diff(at) < 0).all()
    assert at[0] > 0.9 * LEVELS
    assert at[-1] < 0.15 * LEVELS


def test_members_and_nodes_have_their_own_stress(tmp_path):
    points = np.array([[[0, 0, 0], [5.0, 0, 0], [10.0, 0, 0]]])
    balls = StressedBalls(points[0, [0, 2]], np.array([1.5, 1.5]), np.array([9.0, 9.0]))
    render_member_stress(tmp_path / "a.png", points, np.full((1, 3), 0.8), np.zeros((1, 3)), balls, 9.0, size=SIZE)
    red, drawn = hues(tmp_path / "a.png")
    drawn[:, SIZE[0] - 170 :] = False
    x = np.nonzero(drawn)[1]
    middle = drawn & (abs(np.arange(SIZE[0]) - (x.min() + x.max()) / 2) < 20)
    assert (red[middle] < -30).mean() > 0.95
    assert (red[drawn & (np.arange(SIZE[0]) < x.min() + 25)] > 30).mean() > 0.9


@pytest.mark.parametrize(
    ("top", "ticks"), [(40.7, [0, 10, 20, 30, 40]), (1.0, [0, 0.2, 0.4, 0.6, 0.8, 1.0]), (0.012, [0, 0.005, 0.01])]
)
def test_ticks_are_round(top, ticks):
    assert tick_values(top) == ticks


def test_a_picture_that_cannot_be_written(tmp_path):
    mesh = block((1, 1, 1))
    with pytest.raises(InvalidInputError, match="cannot be written"):
        render_solid_stress(tmp_path / "no" / "a.png", mesh.nodes, mesh.boundary, mesh.nodes[:, 0], 1.0, size=SIZE)
