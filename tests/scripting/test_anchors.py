"""Anchors are where faces are, and point out of the part."""

import cadquery as cq
import numpy as np
import pytest
from shapes import cantilever

from michell_cad.domain.cad_part import outline_from_shape
from michell_cad.scripting.anchors import anchors_of_problem, anchors_of_setup
from michell_cad.scripting.picks import make_setup


def anchors(part: cq.Workplane, supports, loads) -> dict:
    outline = outline_from_shape(part)
    found = anchors_of_setup(outline, make_setup(outline, supports, loads))
    return {anchor.name: (anchor.point, anchor.direction) for anchor in found}


def test_a_plane_face_has_its_centroid_and_normal():
    part = cq.Workplane().polyline([(0, 0), (30, 0), (0, 60)]).close().extrude(10)
    found = anchors(part, "<X", [("<Z", (0, 0, 1)), {"self_weight": (0.0, 0.0, -1.0)}])
    assert set(found) == {"support 1", "load 1"}
    np.testing.assert_allclose(found["load 1"][0], (10, 20, 0), atol=1e-9)  # centroid of a triangle: its corners' mean
    np.testing.assert_allclose(found["load 1"][1], (0, 0, -1), atol=1e-9)
    np.testing.assert_allclose(found["support 1"][0], (0, 30, 5), atol=1e-9)


def test_holes_have_an_anchor_each_along_their_axes():
    plate = cq.Workplane().box(60, 40, 6).faces(">Z").workplane().rarray(40, 20, 2, 2).hole(6)
    found = anchors(plate, "%CYLINDER", (">X", (1, 0, 0)))
    bolts = [value for name, value in found.items() if name.startswith("support 1.")]
    assert len(bolts) == 4
    assert {(round(p[0]), round(p[1])) for p, _ in bolts} == {(x, y) for x in (-20, 20) for y in (-10, 10)}
    for point, direction in bolts:
        assert point[2] == pytest.approx(0, abs=1e-3)
        np.testing.assert_allclose(direction, (0, 0, 1), atol=1e-6)


def test_a_blind_hole_points_out_of_the_part():
    block = cq.Workplane().box(40, 20, 20).faces("<X").workplane().hole(8, 10)
    point, direction = anchors(block, "%CYLINDER", (">X", (0, 0, 1)))["support 1"]
    np.testing.assert_allclose(direction, (-1, 0, 0), atol=1e-6)
    np.testing.assert_allclose(point, (-15, 0, 0), atol=1e-2)


def test_a_design_without_regions_knows_its_held_and_loaded_patches():
    found = {anchor.name: anchor for anchor in anchors_of_problem(cantilever((8, 4, 4)))}
    np.testing.assert_allclose(found["support 1"].direction, (-1, 0, 0), atol=1e-12)
    np.testing.assert_allclose(found["load 1"].direction, (1, 0, 0), atol=1e-12)
    assert found["load 1"].point[0] - found["support 1"].point[0] == pytest.approx(80)
