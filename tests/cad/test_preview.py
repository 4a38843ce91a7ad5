import time

import igl
import numpy as np
import pytest
import trimesh
from layouts import grid_truss, sized, star

from michell_cad.cad import preview_truss
from michell_cad.cad.swept_solid import build_swept
from michell_cad.errors import InvalidInputError
from michell_cad.knobs import Knobs, size_members


def test_a_straight_member_is_a_tube_between_two_balls():
    one = star([(0, 0, 1)], length=10.0, radius=0.5)
    mesh = preview_truss(one, Knobs(node_ratio=2.0), sides=32)
    tube = mesh.vertices[np.unique(mesh.triangles[mesh.curve == 0])]
    np.testing.assert_allclose(np.linalg.norm(tube[:, :2], axis=1), 0.5)
    np.testing.assert_allclose([tube[:, 2].min(), tube[:, 2].max()], [0, 10])
    balls = mesh.vertices[np.unique(mesh.triangles[mesh.curve == -1])]
    away = np.minimum(np.linalg.norm(balls, axis=1), np.linalg.norm(balls - [0, 0, 10], axis=1))
    np.testing.assert_allclose(away, 1.0)


def test_triangles_face_outward_and_belong_to_their_curves():
    truss = grid_truss()
    mesh = preview_truss(sized(truss, 0.5, 0.3), Knobs())
    assert set(mesh.curve.tolist()) == {-1, *range(len(truss.curves))}
    for curve in (0, 7, -1):
        mine = mesh.triangles[mesh.curve == curve]
        surface = trimesh.Trimesh(mesh.vertices, mine, process=False)
        assert surface.volume > 0  # tubes are open at their ends, where balls are


def test_two_sides_are_no_tube():
    with pytest.raises(InvalidInputError, match="at least 3 sides"):
        preview_truss(star([(0, 0, 1)]), Knobs(), sides=2)


@pytest.mark.parametrize(
    "knobs",
    [
        Knobs(profile="square", profile_aspect=2.0),
        Knobs(profile="triangle", node_form="hull"),
        Knobs(profile_aspect=0.5),
        Knobs(node_form="hull"),
    ],
)
def test_other_profiles_look_like_their_solid(knobs):
    """Every point of the drawing lies on or in the united mesh of the solid, and reaches as far.

    Balls reach as far as an icosahedron does, whose faces are at 0.79 of its corners.
    """
    truss = sized(grid_truss((2, 2, 2)), 0.7, 0.2)
    drawn, solid = preview_truss(truss, knobs), build_swept(truss, knobs).mesh
    blunt = 0.03 if knobs.node_form == "hull" else 0.21 * 1.8 * truss.radii.max()
    np.testing.assert_allclose(drawn.vertices.min(0), solid.vertices.min(0), atol=blunt)
    np.testing.assert_allclose(drawn.vertices.max(0), solid.vertices.max(0), atol=blunt)
    away = np.sqrt(np.asarray(igl.point_mesh_squared_distance(drawn.vertices, solid.vertices, solid.triangles)[0]))
    inside = np.asarray(igl.fast_winding_number(solid.vertices, solid.triangles, drawn.vertices)) > 0.5
    assert away[~inside].max() < 0.03
    walls = trimesh.Trimesh(drawn.vertices, drawn.triangles[drawn.curve >= 0], process=False)
    assert walls.volume > 0
    assert set(drawn.curve.tolist()) == {-1, *range(len(truss.truss.curves))}


def test_a_knob_on_5000_members_shows_within_a_second():
    truss = grid_truss((12, 12, 13))
    assert len(truss.members) > 5000
    begin = time.process_time()
    mesh = preview_truss(size_members(truss, Knobs(radius=0.4, entasis=0.2)), Knobs())
    assert time.process_time() - begin < 1.0
    assert len(mesh.triangles) > 300_000
    squares = Knobs(radius=0.4, profile="square", node_form="hull")
    begin = time.process_time()
    mesh = preview_truss(size_members(truss, squares), squares)
    assert time.process_time() - begin < 1.0
    assert len(mesh.triangles) > 200_000
