"""Frames along the normals of the boundary."""

import numpy as np
import pytest
from shapes import box_mesh, tube_mesh

from michell_cad.rotations import rotation_matrix
from michell_cad.strength.comparison.boundary_frames import (
    best_constant_frame,
    boundary_alignment,
    boundary_normals,
    fit_boundary_frames,
)
from michell_cad.tet_mesh import TetMesh

TURN = rotation_matrix(np.array([0.3, -0.8, 0.5]))


def off_normal_deg(mesh, frames):
    """Angle between the normal of each boundary triangle and the nearest axis of its frame."""
    _, normals = boundary_normals(mesh)
    return np.degrees(np.arccos(np.clip(np.abs(np.einsum("bdi,bd->bi", frames, normals)).max(1), 0, 1)))


def test_gradient_by_differences():
    rng = np.random.default_rng(1)
    areas, normals, w = rng.uniform(0.5, 1, 6), rng.normal(size=(6, 3)), rng.normal(size=(6, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    w[0] *= 1e-6  # where series take the place of quotients
    value, gradient = boundary_alignment(areas, normals, w)
    assert -areas.sum() < value < -areas.sum() / 3
    h = 1e-6
    for place in np.ndindex(w.shape):
        step = np.zeros_like(w)
        step[place] = h
        ahead, behind = (boundary_alignment(areas, normals, w + sign * step)[0] for sign in (1, -1))
        assert gradient[place] == pytest.approx((ahead - behind) / (2 * h), abs=1e-8)


def test_a_box_has_its_own_axes_however_it_is_turned():
    box = box_mesh((4, 3, 2), (5.0, 3.0, 2.0))
    turned = TetMesh(box.vertices @ TURN.T, box.tets)
    in_tets, on_triangles = fit_boundary_frames(turned)
    assert off_normal_deg(turned, on_triangles).max() < 0.02
    cosines = np.abs(TURN.T @ in_tets)
    np.testing.assert_allclose(cosines.max(1), 1, atol=1e-6)
    np.testing.assert_allclose(np.linalg.det(in_tets), 1)


def test_on_a_tube_an_axis_is_radial_where_frames_do_not_turn_back():
    """One chart cannot go round: over four quarters the axes follow the normal, in four strips they turn back."""
    mesh = tube_mesh((4, 48, 6), inner=3.0, outer=10.0, length=20.0)
    in_tets, on_triangles = fit_boundary_frames(mesh)
    areas, normals = boundary_normals(mesh)
    off = off_normal_deg(mesh, on_triangles)
    side = np.abs(normals[:, 2]) < 0.5
    assert np.average(off[side] < 5, weights=areas[side]) > 0.75
    assert off[~side].max() < 0.1
    # Any constant frame is up to 45 degrees off, 5 degrees or less on a ninth of the tube.
    constant = off_normal_deg(mesh, np.broadcast_to(best_constant_frame(mesh), on_triangles.shape))
    assert np.average(constant[side] < 5, weights=areas[side]) < 0.2
    # The part's own axis stays one of the frames' everywhere.
    np.testing.assert_allclose(np.abs(in_tets[:, 2]).max(1), 1, atol=1e-4)
