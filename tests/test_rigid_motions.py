"""Free rigid motions against counts by hand: one body, several, and bodies that meet in a point or an edge."""

import numpy as np
import pytest
from scipy.linalg import subspace_angles
from scipy.spatial.transform import Rotation
from shapes import box_mesh, joined_boxes

from michell_cad.rigid_motions import MOST_BODIES, free_motions, free_rigid_motions, name_motions, rigid_motions
from michell_cad.tet_mesh import TetMesh

MESH = box_mesh((4, 2, 2), (8.0, 4.0, 2.0))


def held(mesh: TetMesh, mask: np.ndarray, axes: str) -> np.ndarray:
    fixed = np.zeros((len(mesh.vertices), 3), bool)
    for axis in axes:
        fixed[mask, "xyz".index(axis)] = True
    return fixed


def test_one_body():
    everything = np.ones(len(MESH.vertices), bool)
    x, y, z = MESH.vertices.T
    assert free_rigid_motions(MESH, held(MESH, everything, "")) == ["nothing holds it"]
    assert free_rigid_motions(MESH, held(MESH, x == 0, "xyz")) == []
    assert free_rigid_motions(MESH, held(MESH, everything, "xy")) == ["it can move along z"]
    # One edge along y is held.
    assert free_rigid_motions(MESH, held(MESH, (x == 0) & (z == 0), "xyz")) == ["it can turn about y"]
    # A ball joint: one vertex is held.
    assert len(free_rigid_motions(MESH, held(MESH, (x == 0) & (y == 0) & (z == 0), "xyz"))) == 3
    # A plate on rollers.
    assert len(free_rigid_motions(MESH, held(MESH, z == 0, "z"))) == 3


def test_every_part_must_be_held():
    both = joined_boxes((100.0, 0.0, 0.0))
    motions = free_rigid_motions(both, held(both, both.vertices[:, 0] == 0, "xyz"))
    assert motions == ["nothing holds it (part 2 of 2, around (104, 2, 1) mm)"]
    assert free_rigid_motions(both, held(both, np.isin(both.vertices[:, 0], [0, 100]), "xyz")) == []


@pytest.mark.parametrize(
    ("shift", "free"), [((8.0, 0.0, 2.0), ["it can turn about y"]), ((8.0, 4.0, 0.0), ["it can turn about z"])]
)
def test_a_hinge_turns(shift, free):
    """The second box meets the first in an edge; it stands as soon as one vertex away from that edge is held."""
    both = joined_boxes(shift)
    fixed = held(both, both.vertices[:, 0] == 0, "xyz")
    motions = free_rigid_motions(both, fixed)
    assert [motion.split(" (")[0] for motion in motions] == free
    assert "part 2 of 2" in motions[0]
    assert "an edge only" in motions[0]
    fixed[np.argmax(both.vertices.sum(1))] = True
    assert free_rigid_motions(both, fixed) == []


def test_a_point_is_a_ball_joint():
    both = joined_boxes((8.0, 4.0, 2.0))
    fixed = held(both, both.vertices[:, 0] == 0, "xyz")
    assert {motion.split(" (")[0] for motion in free_rigid_motions(both, fixed)} == {
        "it can turn about x",
        "it can turn about y",
        "it can turn about z",
    }
    fixed[both.vertices[:, 0] == 16] = True
    assert free_rigid_motions(both, fixed) == []


def test_three_bodies_in_a_triangle_of_ball_joints_stand():
    """Three tets, each with two corners shared with the two others, on three held points: nothing moves; without the
    third body the other two do."""
    corner = np.array([[0.0, 0, 0], [6, 0, 0], [3, 5, 0]])
    tip = np.array([[3.0, 0, 4], [4.5, 2.5, 4], [1.5, 2.5, 4]])
    vertices = np.concatenate([corner, tip, [[3, -3, 1], [7, 4, 1], [-1, 4, 1]]])
    tets = np.array([[0, 1, 3, 6], [1, 2, 4, 7], [2, 0, 5, 8]])
    mesh = TetMesh(vertices, tets)
    fixed = np.zeros((9, 3), bool)
    fixed[[3, 4, 5]] = True
    assert mesh.body_of_tet.tolist() == [0, 1, 2]
    # 18 motions; 9 held components and 3 shared points of 3 equations each: as many equations, a rigid frame.
    assert free_rigid_motions(mesh, fixed) == []
    pair = TetMesh(vertices[[0, 1, 2, 3, 4, 6, 7]], np.array([[0, 1, 3, 5], [1, 2, 4, 6]]))
    fixed = np.zeros((7, 3), bool)
    fixed[[3, 4]] = True
    assert len(free_rigid_motions(pair, fixed)) == 12 - 9


def test_a_thin_plate_is_held_along_an_edge_of_its_own_thickness():
    plate = box_mesh((4, 4, 1), (80.0, 80.0, 1e-4))
    assert free_rigid_motions(plate, held(plate, plate.vertices[:, 0] == 0, "xyz")) == []


def test_shreds_that_touch_take_no_time():
    """More bodies than the limit are left to the factorisation."""
    grid = np.stack(np.meshgrid(*[np.arange(8)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    corners = np.array([[0, 0, 0], [1, 1, 0], [1, 0, 1], [0, 1, 1]])
    points = (grid[grid.sum(1) % 2 == 0][:, None] + corners).reshape(-1, 3).astype(float)
    vertices, inverse = np.unique(points, axis=0, return_inverse=True)
    mesh = TetMesh(vertices, inverse.reshape(-1, 4))
    assert mesh.body_of_tet.max() >= MOST_BODIES
    assert mesh.component_of_vertex.max() == 0
    fixed = np.zeros(mesh.vertices.shape, bool)
    assert len(free_rigid_motions(mesh, fixed)) == 1
    fixed[0, 0] = True
    assert free_rigid_motions(mesh, fixed) == []


def test_the_number_of_free_motions_does_not_depend_on_the_axes():
    both = joined_boxes((8.0, 0.0, 2.0))
    fixed = held(both, both.vertices[:, 0] == 0, "xyz")
    turned = TetMesh(both.vertices @ Rotation.random(random_state=0).as_matrix().T, both.tets)
    assert len(free_rigid_motions(turned, fixed)) == 1


def test_motions_are_translations_and_rotations():
    rng = np.random.default_rng(0)
    x, v, w = rng.normal(size=(5, 3)), rng.normal(size=3), rng.normal(size=3)
    np.testing.assert_allclose(rigid_motions(x) @ np.append(v, w), v + np.cross(w, x), atol=1e-14)


def test_the_transpose_gives_resultant_force_and_moment():
    rng = np.random.default_rng(1)
    x, f = rng.normal(size=(2, 5, 3))
    resultant = np.einsum("ndk,nd->k", rigid_motions(x), f)
    np.testing.assert_allclose(resultant, np.append(f.sum(0), np.cross(x, f).sum(0)), atol=1e-14)


def test_a_hinge_leaves_the_turn_about_its_line():
    constraints = rigid_motions(np.array([[0, 0, 0.5], [0, 0, -0.5]])).reshape(-1, 6)
    free = free_motions(constraints)
    assert subspace_angles(free, np.eye(6)[:, [5]]).max() < 1e-7
    assert name_motions(free) == ["it can turn about z"]
    assert name_motions(np.eye(6)[:, :2]) == ["it can move along x", "it can move along y"]
    assert free_motions(np.eye(6)).shape == (6, 0)
