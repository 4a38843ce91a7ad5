import numpy as np
import pytest
import trimesh
from quadratic_shapes import capsule, dihedral_angles

from michell_cad.closed_mesh import ClosedMesh
from michell_cad.errors import ConvergenceError, InvalidInputError
from michell_cad.rotations import rotation_matrix
from michell_cad.strength.solid import mesh_solid, solid_mesh
from michell_cad.strength.solid.quadratic_mesh import GAUSS_POINTS, quadratic_mesh
from michell_cad.strength.solid.stuffing import stuff_surface
from michell_cad.tet_mesh import TetMesh

TURN = rotation_matrix(np.array([[0.4, 0.2, 0.9]]))[0]


def turned_torus() -> ClosedMesh:
    shape = trimesh.creation.torus(major_radius=5.0, minor_radius=2.0, major_sections=96, minor_sections=48)
    return ClosedMesh(shape.vertices @ TURN.T + 3.0, shape.faces)


def ball(radius=1.0, centre=(0.0, 0.0, 0.0)) -> ClosedMesh:
    shape = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    return ClosedMesh(shape.vertices + np.array(centre), shape.faces)


def genus(mesh: TetMesh) -> int:
    triangles, edges = mesh.boundary_triangles, mesh.boundary_edges
    return 1 - (len(np.unique(triangles)) - len(edges) + len(triangles)) // 2


@pytest.mark.parametrize("surface", [ball(), turned_torus()], ids=["ball", "torus"])
def test_tets_fill_a_surface(surface):
    """One conforming body, whose boundary is a closed surface of the right genus that lies on the given one."""
    size = 0.25 * np.sqrt(surface.volume / np.pi**2) ** (1 / 3)
    X, T, on = stuff_surface(surface, size)
    mesh = TetMesh(X, T)
    assert mesh.body_of_tet.max() == 0
    np.testing.assert_array_equal(np.unique(mesh.boundary_triangles), np.flatnonzero(on))
    assert np.bincount(mesh.boundary_triangle_edges.ravel()).max() == 2
    assert genus(mesh) == (0 if len(surface.vertices) == 2562 else 1)
    assert np.linalg.norm(surface.nearest(X[on]) - X[on], axis=1).max() < 1e-9
    assert (surface.depth(X[~on]) > 0).all()
    angles = dihedral_angles(mesh)
    assert angles.min() > 5
    assert angles.max() < 172
    curved = quadratic_mesh(mesh, surface.nearest)
    assert curved.volumes.sum() == pytest.approx(surface.volume, rel=3e-3)
    straight_error, curved_error = (abs(v.sum() / surface.volume - 1) for v in (mesh.volumes, curved.volumes))
    assert curved_error < straight_error / 5
    assert (curved.determinants(GAUSS_POINTS) > 0).all()


def test_a_surface_knows_depth_volume_and_bodies():
    hollow = ball(0.5)
    two = [ball(), ball(1.0, (3.0, 0.0, 0.0)), ClosedMesh(hollow.vertices, hollow.triangles[:, ::-1])]
    shift = np.cumsum([0, *(len(s.vertices) for s in two[:-1])])
    both = ClosedMesh(
        np.concatenate([s.vertices for s in two]),
        np.concatenate([s.triangles + k for s, k in zip(two, shift, strict=True)]),
    )
    assert both.bodies == 2
    assert both.volume == pytest.approx(4 / 3 * np.pi * (2 - 1 / 8), rel=0.005)
    depth = both.depth(np.array([[0, 0, 0.75], [0, 0, 0.0], [0, 0, 2.0], [3.0, 0, 0]]))
    np.testing.assert_allclose(depth, [0.25, -0.5, -1.0, 1.0], atol=0.01)


def test_the_mesh_of_a_bar_has_its_volume_and_chooses_its_size():
    bar = ClosedMesh(*capsule(1.0, 12.0))
    mesh = mesh_solid(bar, 1.0)
    assert mesh.volumes.sum() == pytest.approx((12 + 4 / 3) * np.pi, rel=0.005)
    assert solid_mesh.lattice_size(bar.volume, 1.0) == solid_mesh.FINEST
    assert len(mesh.tets) == pytest.approx(solid_mesh.forecast(bar.volume, solid_mesh.FINEST)[0], rel=0.1)
    assert solid_mesh.lattice_size(1e6, 1.0) == solid_mesh.COARSEST
    middle = solid_mesh.lattice_size(20_000.0, 1.0)
    assert solid_mesh.forecast(20_000.0, middle)[0] == pytest.approx(solid_mesh.USUAL_TETS, rel=1e-3)
    with pytest.raises(InvalidInputError, match=r"at most 1.2 of the smallest radius of a member, 1.2 mm, found 3"):
        mesh_solid(bar, 1.0, 3.0)
    with pytest.raises(InvalidInputError, match=r"quadratic tets of 0.004 mm and .* GB free: use a size of"):
        mesh_solid(bar, 1.0, 0.004)
    for thickness, message in ((0.4, "bodies and .* use a smaller size"), (0.1, "falls through a lattice of 1 mm")):
        vertices, triangles = capsule(thickness, 12.0)
        thin = ClosedMesh(vertices @ TURN.T, triangles)
        with pytest.raises(ConvergenceError, match=message):
            mesh_solid(thin, 1.0, 1.0)
