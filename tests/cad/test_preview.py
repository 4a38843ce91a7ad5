import time

import numpy as np
import pytest
import trimesh
from layouts import grid_truss, sized, star

from michell_cad.cad import preview_truss
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


def test_a_knob_on_5000_members_shows_within_a_second():
    truss = grid_truss((12, 12, 13))
    assert len(truss.members) > 5000
    begin = time.process_time()
    mesh = preview_truss(size_members(truss, Knobs(radius=0.4, entasis=0.2)), Knobs())
    assert time.process_time() - begin < 1.0
    assert len(mesh.triangles) > 300_000
