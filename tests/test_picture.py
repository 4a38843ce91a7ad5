"""Pictures: geometry of the z-buffer by hand, and that what is shown is where it should be."""

import numpy as np
import pytest
from PIL import Image
from shapes import box_mesh

from michell_cad.curves import Curve, CurveKind
from michell_cad.domain import part_from_tets
from michell_cad.errors import InvalidInputError
from michell_cad.palette import COLOURS
from michell_cad.picture import Arrow, face_colours, render_part, render_truss
from michell_cad.picture.camera import Camera, place_camera
from michell_cad.picture.canvas import Canvas
from michell_cad.picture.sheet import corner_normals
from michell_cad.truss import SizedTruss, Truss

ONE = np.ones(1)
TAG = np.zeros(1, int)


def seen(canvas: Canvas) -> np.ndarray:
    return canvas.image(canvas.tag >= 0)


def read(path) -> np.ndarray:
    with Image.open(path) as picture:
        return np.asarray(picture.convert("RGB")).astype(float)


def test_a_ball_covers_its_disc():
    canvas = Canvas(200, 160)
    canvas.draw_balls(np.array([[90.0, 70.0, 5.0]]), 40 * ONE, TAG)
    y, x = np.mgrid[:160, :200]
    inside = np.hypot(x - 90, y - 70) < 40
    assert (seen(canvas) == inside).mean() > 0.999
    depth = canvas.image(canvas.depth)
    assert depth[70, 90] == pytest.approx(45)
    assert depth[70, 114] == pytest.approx(5 + 32)  # 24, 32, 40
    assert canvas.image(canvas.normal)[46, 90] == pytest.approx([0, 0.6, 0.8], abs=1e-6)


@pytest.mark.parametrize("angle", [0.0, 0.4, 0.8, 1.2, np.pi / 2, 2.5, 4.0])
def test_a_tube_is_a_cylinder(angle):
    """Every pixel of a tilted tube lies on the cylinder, with its normal: checked in space."""
    canvas = Canvas(300, 300)
    middle = np.array([150.0, 150.0, 0.0])
    half = np.array([90 * np.cos(angle), 90 * np.sin(angle), 60.0])
    canvas.draw_tubes((middle - half)[None], (middle + half)[None], 20 * ONE, 20 * ONE, TAG)
    y, x = np.nonzero(seen(canvas))
    points = np.stack([x, y, canvas.image(canvas.depth)[y, x]], axis=1) - middle
    axis = half / np.linalg.norm(half)
    radial = points - (points @ axis)[:, None] * axis
    assert np.linalg.norm(radial, axis=1) == pytest.approx(20, abs=1e-3)
    normal = canvas.image(canvas.normal)[y, x] * [1, -1, 1]
    assert normal == pytest.approx(radial / 20, abs=1e-3)
    # The rectangle of the tube on the screen: length 180, width 40.
    assert len(x) == pytest.approx(180 * 40, rel=0.02)


def test_triangles_cover_their_area_without_gaps():
    canvas = Canvas(200, 200)
    square = np.array([[20.0, 30.0, 0.0], [180.0, 30.0, 16.0], [180.0, 150.0, 28.0], [20.0, 150.0, 12.0]])
    corners = square[np.array([[0, 1, 2], [0, 2, 3]])]
    canvas.draw_triangles(corners, np.tile([0.0, 0.0, 1.0], (2, 3, 1)), np.array([0, 1]))
    assert seen(canvas)[30:151, 20:181].all()
    assert seen(canvas).sum() == 121 * 161
    depth = canvas.image(canvas.depth)
    assert depth[90, 100] == pytest.approx(8 + 6, abs=1e-3)  # z = (x - 20) / 10 + (y - 30) / 10


def test_the_nearest_wins_whatever_the_order():
    for order in ([0, 1, 2], [2, 0, 1]):
        canvas = Canvas(60, 60)
        centres = np.array([[30.0, 30.0, 0.0], [30.0, 30.0, 50.0], [30.0, 30.0, -50.0]])[order]
        canvas.draw_balls(centres, np.full(3, 10.0), np.array([0, 1, 2])[order])
        assert canvas.image(canvas.tag)[30, 30] == 1


def test_what_lies_outside_is_cut():
    canvas = Canvas(50, 50)
    canvas.draw_balls(np.array([[0.0, 0.0, 0.0], [500.0, 20.0, 0.0]]), np.full(2, 10.0), np.zeros(2, int))
    canvas.draw_tubes(np.array([[-100.0, 25.0, 0.0]]), np.array([[200.0, 25.0, 0.0]]), 3 * ONE, 3 * ONE, TAG)
    assert seen(canvas)[25].all()
    assert seen(canvas)[0, 0]


@pytest.mark.parametrize("up", [0, 1, 2])
@pytest.mark.parametrize("behind", [False, True])
def test_the_camera_sees_everything_upright(up, behind):
    corners = box_mesh((1, 1, 1), (8.0, 4.0, 2.0)).vertices
    camera = place_camera(corners, (10, 20, 310, 220), up, behind)
    assert camera.axes @ camera.axes.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(camera.axes) == pytest.approx(1)
    x, y, _ = camera.project(corners).T
    assert (x >= 10 - 1e-9).all()
    assert (x <= 310 + 1e-9).all()
    assert (y >= 20 - 1e-9).all()
    assert (y <= 220 + 1e-9).all()
    assert max(np.ptp(x) / 300, np.ptp(y) / 200) == pytest.approx(1)
    assert camera.turn(np.eye(3)[up])[1] > 0
    assert (camera.axes[2, up] < 0) == behind


def test_corner_normals_are_sharp_between_faces_and_smooth_within():
    part = part_from_tets(box_mesh((2, 2, 2)))
    surface = part.surface
    normals = corner_normals(surface.vertices, surface.triangles, surface.face_numbers)
    flat = surface.area_vectors / surface.areas[:, None]
    assert normals == pytest.approx(np.repeat(flat[:, None], 3, axis=1), abs=1e-12)
    together = corner_normals(surface.vertices, surface.triangles, np.zeros_like(surface.face_numbers))
    assert np.abs(together - flat[:, None]).max() > 0.3


def cross() -> SizedTruss:
    """Three struts through the middle of the unit cube, one of each family."""
    nodes = np.array([[0.5, 0.5, 0.5], *(v for axis in np.eye(3) for v in (0.5 - 0.5 * axis, 0.5 + 0.5 * axis))])
    members = np.array([[0, k] for k in range(1, 7)])
    curves = tuple(
        Curve(
            CurveKind.INTERIOR,
            family,
            axis,
            tuple(None if k == axis else 0 for k in range(3)),
            0,
            np.array([2 * axis + 1, 0, 2 * axis + 2]),
            np.array([2 * axis, 2 * axis + 1]),
            False,
        )
        for axis, family in enumerate(("tension", "compression", "third"))
    )
    truss = Truss(nodes, np.array([0, 1, 1, 1, 1, 1, 1]), members, curves, 1.0)
    return SizedTruss(truss, np.full((6, 3), 0.05))


def near(picture: np.ndarray, colour, tolerance: float = 0.12) -> np.ndarray:
    """Pixels whose hue is that of a colour, whatever their brightness."""
    rgb = picture / 255.0
    unit = rgb / np.maximum(np.linalg.norm(rgb, axis=2, keepdims=True), 1e-9)
    wanted = np.array(colour) / np.linalg.norm(colour)
    return np.linalg.norm(unit - wanted, axis=2) < tolerance


def test_truss_picture_shows_three_families_where_they_are(tmp_path):
    path = tmp_path / "preview.png"
    render_truss(path, box_mesh((2, 2, 2)), cross(), size=(420, 300))
    picture = read(path)
    assert picture.shape == (300, 420, 3)
    assert (picture[0] == 255).all()
    drawing = picture[:, 160:]  # right of the legend
    for family in ("tension", "compression", "third"):
        # The ghost before them makes all of them bluer, compression and third differ by 0.37.
        assert near(drawing, COLOURS[family], 0.3).sum() > 500, family


def test_pictures_repeat_bit_by_bit(tmp_path):
    for name in ("a.png", "b.png"):
        render_truss(tmp_path / name, box_mesh((2, 2, 2)), cross(), size=(280, 200))
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_part_picture_has_each_face_in_its_colour(tmp_path):
    surface = part_from_tets(box_mesh((2, 2, 2), (3.0, 2.0, 1.0))).surface
    palette = np.eye(3)[[0, 1, 2, 0, 1, 2]]
    labels = {k: str(k) for k in range(6)}
    arrow = Arrow((3.0, 1.0, 0.5), (1.0, 0.0, 0.0), (0.9, 0.5, 0.0))
    render_part(
        tmp_path / "faces.png",
        surface,
        surface.face_numbers,
        palette,
        labels=labels,
        arrows=[arrow],
        legend=[((1.0, 0.0, 0.0), "red")],
        size=(560, 400),
    )
    picture = read(tmp_path / "faces.png")
    for colour in np.eye(3):
        assert near(picture, colour, 0.3).sum() > 500
    assert near(picture, arrow.colour, 0.15).sum() > 50


def test_face_colours_differ():
    colours = face_colours(40)
    assert colours.shape == (40, 3)
    gaps = np.linalg.norm(colours[:, None] - colours[None], axis=2) + 9 * np.eye(40)
    assert gaps.min() > 0.01


def test_a_picture_that_cannot_be_written(tmp_path):
    with pytest.raises(InvalidInputError, match="cannot be written"):
        render_truss(tmp_path / "none" / "preview.png", box_mesh((1, 1, 1)), cross(), size=(140, 100))


def test_camera_projection_by_hand():
    camera = Camera(np.eye(3), 2.0, np.array([1.0, 1.0, 0.0]), np.array([100.0, 50.0]))
    assert camera.project(np.array([2.0, 3.0, 4.0])) == pytest.approx([102, 46, 8])
