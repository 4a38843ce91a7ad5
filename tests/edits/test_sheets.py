import igl
import numpy as np
import pytest
from designs import small_bar
from shapes import box_mesh

from michell_cad.cad.plates import export_shapes, solid_of_plate
from michell_cad.cad.step import read_step_summary
from michell_cad.edits import AddSheet, DesignFields, EditList, build_sheets
from michell_cad.edits.sheets import build_plates, trace_isosurface
from michell_cad.errors import InvalidInputError
from michell_cad.knobs import Knobs

BAR = small_bar()
FIELDS = DesignFields.of(BAR)
MESH = box_mesh((4, 3, 2), (8.0, 6.0, 4.0))


def test_the_isosurface_of_a_plane_has_its_area_and_its_normal():
    n = np.array([2.0, 1.0, 0.3])
    points, triangles = trace_isosurface(MESH, MESH.vertices @ n, 9.0)
    np.testing.assert_allclose(points @ n, 9.0, atol=1e-3)
    a, b, c = points[triangles].transpose(1, 0, 2)
    area = np.cross(b - a, c - a) / 2
    np.testing.assert_allclose(np.cross(area, n), 0, atol=1e-2)
    assert (area @ n > 0).all()
    # The plane cuts the box in y and z all through: its area is that of its shadow 6 x 4 over the cosine.
    np.testing.assert_allclose(np.linalg.norm(area, axis=1).sum(), 24 * np.linalg.norm(n) / n[0], rtol=1e-3)


def test_a_flat_plate_is_a_slab_cut_by_the_part():
    (plate,) = build_plates(MESH, MESH.vertices @ [1.0, 0.0, 0.0], 3.3, 0.5)
    assert plate.is_watertight
    assert plate.volume == pytest.approx(0.5 * 24)
    np.testing.assert_allclose(plate.vertices.min(0), [3.05, 0, 0], atol=1e-9)
    np.testing.assert_allclose(plate.vertices.max(0), [3.55, 6, 4], atol=1e-9)
    (oblique,) = build_plates(MESH, MESH.vertices @ [1.0, 0.4, 0.0], 4.0, 0.5)
    assert oblique.volume == pytest.approx(0.5 * 24 * np.hypot(1, 0.4), rel=1e-3)


def test_two_pieces_of_an_isosurface_are_two_plates():
    wave = np.abs(MESH.vertices[:, 0] - 4.0)
    plates = build_plates(MESH, wave, 2.5, 0.3)
    assert [round(plate.volume, 6) for plate in plates] == [7.2, 7.2]


def test_plates_of_a_design_are_closed_and_lie_on_the_isosurface():
    edit = AddSheet(coordinate="compression", low=2, high=5, every=2, thickness=0.8)
    plates = build_sheets(EditList((edit,)).replay(BAR, Knobs()))
    assert len(plates) >= 2
    phi = FIELDS.levels[:, FIELDS.axis("compression")]
    for plate, value in zip(plates, edit.values_in(phi), strict=True):
        assert plate.is_watertight
        points, triangles = trace_isosurface(FIELDS.mesh, phi, value)
        away = np.sqrt(np.asarray(igl.point_mesh_squared_distance(plate.vertices, points, triangles)[0]))
        a, b, c = points[triangles].transpose(1, 0, 2)
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
        inner = ~np.isclose(np.abs(plate.vertices - [40, 20, 20]), [40, 20, 20], atol=1e-3).any(1)
        off = np.abs(away[inner] - 0.4)
        assert np.quantile(off, 0.9) < 0.02
        assert off.max() < 0.1  # at corners of the rim, where the surface is carried on along one tangent plane only
        assert plate.volume == pytest.approx(0.8 * area, rel=0.02)
        low, high = plate.vertices.min(0), plate.vertices.max(0)
        assert (low >= -1e-6).all()
        assert (high <= np.array([80, 40, 40]) + 1e-6).all()


def test_no_triangle_of_a_plate_is_thinner_than_the_kernel_can_see():
    """A hundred times its 1e-7 mm; slivers of the boolean made plates that were no valid solids."""
    edits = (AddSheet(coordinate=axis, low=0, high=9, thickness=0.8) for axis in (1, 2))
    for plate in build_sheets(EditList(tuple(edits)).replay(BAR, Knobs())):
        corners = plate.vertices[plate.triangles]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(1)
        twice_area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        assert (twice_area / longest).min() > 1e-5


def test_plates_are_solids_in_step(tmp_path):
    edit = AddSheet(coordinate="third", low=3, high=3, thickness=0.8)
    plates = build_sheets(EditList((edit,)).replay(BAR, Knobs()))
    export_shapes([solid_of_plate(plate) for plate in plates], tmp_path / "sheets.step")
    summary = read_step_summary(tmp_path / "sheets.step")
    assert summary.valid
    assert summary.solids == len(plates)
    assert summary.volume_mm3 == pytest.approx(sum(plate.volume for plate in plates), rel=1e-5)


def test_a_wide_range_of_values_costs_no_more_than_those_in_the_part():
    wide = AddSheet(coordinate=0, low=-1e15, high=1e15, thickness=0.5)
    assert wide.values_in(np.array([0.4, 2.0, 3.1])) == [1.0, 2.0, 3.0]
    assert wide.values_in(np.array([0.0, 2.0])) == [1.0]  # at an extreme there is a point only
    assert AddSheet(coordinate=0, low=1, high=9, every=2, thickness=0.5).values_in(np.array([0.4, 4.1])) == [2.0, 4.0]
    odd = AddSheet(coordinate=0, low=1, high=9, every=2, offset=1, thickness=0.5)
    assert odd.values_in(np.array([0.4, 4.1])) == [1.0, 3.0]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"low": 90, "high": 95}, "no isosurface of coordinate"),
        ({"low": 3, "high": 3, "thickness": 30}, "fills the cells"),
    ],
)
def test_sheets_that_cannot_be_are_refused(values, message):
    with pytest.raises(InvalidInputError, match=message):
        EditList((AddSheet(**({"coordinate": 0, "thickness": 0.5} | values)),)).replay(BAR, Knobs())
