"""United solids against inclusion and exclusion in closed form, and the mesh."""

import cadquery as cq
import numpy as np
import pytest

from michell_cad.cad import build_solid, export_step, kept_shape, kernel, read_step_summary, unite
from michell_cad.cad.shell_plan import FaceRole
from michell_cad.errors import InvalidInputError
from michell_cad.knobs import Knobs
from tests.cad.layouts import grid_truss, sized, star

PLAIN = Knobs(fillet_ratio=0.0)


def box(size, center):
    return cq.Workplane().box(*size).translate(center)


@pytest.fixture(scope="module")
def bar():
    """Two balls of radius 1.8 around a straight member of radius 1 and length 20 along x."""
    return build_solid(star([[1, 0, 0]], length=20.0), PLAIN)


@pytest.fixture(scope="module")
def grid():
    return build_solid(sized(grid_truss((4, 3, 3)), 0.8, 0.3), Knobs())


def test_member_through_a_plate_in_closed_form(bar) -> None:
    united = unite(bar, [kept_shape("plate", box((4, 10, 10), (10, 0, 0)))])
    expected = bar.report.volume_mm3 + 4 * 10 * 10 - np.pi * 4
    assert united.report.volume_mm3 == pytest.approx(expected, rel=1e-5)
    assert united.report.mesh_volume_mm3 == pytest.approx(expected, rel=1e-3)
    assert united.report.solids == 1
    assert united.report.genus is None
    assert united.report.kept is not None
    assert united.report.kept.volume_mm3 == pytest.approx(400)
    assert united.mesh.is_watertight
    # The triangles still know the member and its balls, the plate has the rest: 12 and what the member cuts.
    inside = np.linalg.norm(united.mesh.vertices[united.mesh.triangles].mean(1)[:, 1:], axis=1) < 2
    assert set(united.mesh.role[inside]) == {FaceRole.NODE, FaceRole.MEMBER}
    assert set(united.mesh.role[~inside]) == {FaceRole.KEPT}
    assert all(kernel.is_valid(solid) for solid in united.solids)


def test_clearance_stays_empty_and_what_it_cuts_off_is_dropped(bar) -> None:
    ring = cq.Workplane("XZ").circle(5).circle(3).extrude(6).translate((20, 3, 0))
    hole = cq.Workplane("XZ").circle(3).extrude(6).translate((20, 3, 0))
    united = unite(bar, [kept_shape("ring", ring, hole)])
    # The far ball is in the hole. The bar ends in the ring's inner wall, its other ball stays.
    common = cq.Workplane(bar.cadquery.val()).intersect(hole.union(ring)).val().Volume()
    assert united.report.volume_mm3 == pytest.approx(bar.report.volume_mm3 - common + np.pi * 16 * 6, rel=1e-4)
    inside = cq.Workplane(united.cadquery.val()).intersect(hole).val()
    assert inside is None or inside.Volume() < 1e-6
    assert united.report.solids == 1


def test_plate_over_a_warped_grid(grid, tmp_path) -> None:
    plate = box((60, 60, 6), (10, 10, 1))
    united = unite(grid, [kept_shape("plate", plate)])
    assert united.report.solids == 1
    assert all(kernel.is_valid(solid) for solid in united.solids)
    assert united.report.volume_mm3 == pytest.approx(united.mesh.volume, rel=2e-3)
    assert united.report.kept is not None
    assert united.report.kept.members_cut > 0
    kept = united.face_role == FaceRole.KEPT
    assert kept.sum() == united.report.kept.faces
    assert (united.face_curve[kept] == -1).all()
    export_step(united, tmp_path / "united.step")
    summary = read_step_summary(tmp_path / "united.step")
    assert summary.valid
    assert summary.solids == 1
    assert summary.volume_mm3 == pytest.approx(united.report.volume_mm3, rel=1e-4)
    assert "'plate'" in (tmp_path / "united.step").read_text()


def test_solid_out_of_reach_stays_apart_with_a_warning(bar) -> None:
    united = unite(bar, [kept_shape("far", box((1, 1, 1), (0, 0, 50)))])
    assert united.report.solids == 2
    assert any("no member reaches far" in line for line in united.report.messages)


def test_bad_calls_are_refused(bar) -> None:
    with pytest.raises(InvalidInputError, match="nothing to unite"):
        unite(bar, [])
    united = unite(bar, [kept_shape("plate", box((4, 10, 10), (10, 0, 0)))])
    with pytest.raises(InvalidInputError, match="united with plate already"):
        unite(united, [kept_shape("plate", box((4, 10, 10), (10, 0, 0)))])
