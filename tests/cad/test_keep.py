"""Kept material against closed forms."""

import cadquery as cq
import numpy as np
import pytest

from michell_cad.cad import keep_material, kept_shape, kernel
from michell_cad.domain.cad_part import outline_from_shape
from michell_cad.errors import InvalidInputError

PLATE = cq.Workplane().box(60, 40, 10).faces(">Z").workplane().hole(12)


@pytest.fixture(scope="module")
def plate():
    return outline_from_shape(PLATE, "plate")


def volumes(solids) -> float:
    return sum(map(kernel.volume, solids))


def test_ring_around_a_hole(plate) -> None:
    kept = keep_material(plate, "%CYLINDER", 4.0, 3.0)
    assert volumes(kept.solids) == pytest.approx(np.pi * (10**2 - 6**2) * 10, rel=1e-6)
    # The hole stays free, and 3 mm above and below it the seat of a washer as wide as the ring.
    assert volumes(kept.clearance) == pytest.approx(np.pi * (6**2 * 10 + 2 * 10**2 * 3), rel=1e-6)


def test_layer_under_a_plane_keeps_its_hole(plate) -> None:
    kept = keep_material(plate, ">Z", 2.0, 1.0)
    area = 60 * 40 - np.pi * 6**2
    assert volumes(kept.solids) == pytest.approx(2.0 * area, rel=1e-6)
    assert volumes(kept.clearance) == pytest.approx(1.0 * area, rel=1e-6)


def test_material_ends_where_the_part_ends(plate) -> None:
    kept = keep_material(plate, "%CYLINDER", 16.0, 1.0)
    # A ring to the radius 22 is cut by the sides of the plate at +-20.
    segment = 22**2 * np.arccos(20 / 22) - 20 * np.sqrt(22**2 - 20**2)
    assert volumes(kept.solids) == pytest.approx(10 * (np.pi * (22**2 - 6**2) - 2 * segment), rel=1e-5)


@pytest.mark.parametrize(
    ("faces", "depth", "message"),
    [
        ("%CYLINDER", 0.0, "depth must be positive, found 0 mm"),
        ("%CYLINDER", -1.0, "depth must be positive"),
        ([7], 1.0, "there is no face 7; faces are numbered 0 to 6"),
        ("%SPHERE", 1.0, "matches nothing"),
        (">Z", 10.0, "depth = 10 mm keeps the whole part"),
    ],
)
def test_bad_input_is_refused(plate, faces, depth, message) -> None:
    with pytest.raises(InvalidInputError, match=message):
        keep_material(plate, faces, depth, 1.0)


def test_round_bar_cannot_be_thickened_beyond_its_axis() -> None:
    bar = outline_from_shape(cq.Workplane().circle(5).extrude(20), "bar")
    with pytest.raises(InvalidInputError, match="cannot be thickened by depth = 6 mm"):
        keep_material(bar, "%CYLINDER", 6.0, 1.0)


def test_objects_that_are_no_solids_are_refused() -> None:
    with pytest.raises(InvalidInputError, match="expected valid solids, found none"):
        kept_shape("wire", cq.Workplane().rect(1, 1))
    with pytest.raises(InvalidInputError, match="found int"):
        kept_shape("number", 3)
