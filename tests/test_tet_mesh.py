import numpy as np
import pytest
from shapes import box_mesh

from michell_cad.errors import InvalidInputError
from michell_cad.tet_mesh import TetMesh

CORNER = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])


def test_one_tet_by_hand():
    mesh = TetMesh(CORNER, np.array([[0, 1, 2, 3]]))
    assert mesh.volumes == pytest.approx([1 / 6])
    np.testing.assert_allclose(mesh.hat_gradients[0], [[-1, -1, -1], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    np.testing.assert_allclose(mesh.boundary_area_vectors.sum(0), 0, atol=1e-15)
    assert len(mesh.boundary_triangles) == 4
    assert len(mesh.feature_edges) == 6
    np.testing.assert_allclose(mesh.vertex_volumes, 1 / 24)


def test_negative_tets_are_reoriented():
    mesh = TetMesh(CORNER, np.array([[0, 2, 1, 3]]))
    assert mesh.volumes == pytest.approx([1 / 6])


def test_boundary_of_a_box_points_outwards_and_encloses_it():
    mesh = box_mesh((3, 2, 4), (3.0, 5.0, 2.0))
    assert mesh.volumes.sum() == pytest.approx(30)
    middles = mesh.vertices[mesh.boundary_triangles].mean(1)
    # Divergence theorem: the flux of x through the surface is three times the volume.
    assert np.einsum("bd,bd->", middles, mesh.boundary_area_vectors) == pytest.approx(90)
    assert (np.einsum("bd,bd->b", middles - [1.5, 2.5, 1], mesh.boundary_area_vectors) > 0).all()
    assert len(mesh.feature_edges) == 4 * (3 + 2 + 4)
    n_faces, n_edges = len(mesh.faces), len(mesh.edges)
    assert len(mesh.vertices) - n_edges + n_faces - len(mesh.tets) == 1  # Euler number of a ball


def test_gradients_of_linear_functions_are_exact():
    mesh = box_mesh((2, 2, 2))
    A = np.random.default_rng(0).normal(size=(3, 3))
    np.testing.assert_allclose(mesh.gradients(mesh.vertices @ A.T), np.broadcast_to(A, (len(mesh.tets), 3, 3)))
    G = mesh.gradient_operator @ (mesh.vertices @ A[0])
    np.testing.assert_allclose(G.reshape(-1, 3), np.broadcast_to(A[0], (len(mesh.tets), 3)))


def test_laplacian_is_the_dirichlet_form():
    mesh = box_mesh((3, 2, 2), (3.0, 2.0, 2.0))
    f = mesh.vertices @ [1.0, -2.0, 0.5]
    assert f @ mesh.laplacian() @ f == pytest.approx(12 * (1 + 4 + 0.25))
    assert np.abs(mesh.laplacian() @ np.ones(len(f))).max() < 1e-12


def test_parts_are_counted():
    a = box_mesh((1, 1, 1))
    both = TetMesh(np.concatenate([a.vertices, a.vertices + 5]), np.concatenate([a.tets, a.tets + len(a.vertices)]))
    assert set(both.component_of_vertex) == {0, 1}


def test_values_are_read_only():
    mesh = TetMesh(CORNER, np.array([[0, 1, 2, 3]]))
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[0, 0] = 3


@pytest.mark.parametrize(
    ("vertices", "tets", "message"),
    [
        (CORNER, [[0, 1, 2, 4]], "index"),
        (np.concatenate([CORNER, [[1.0, 1, 0]]]), [[0, 1, 2, 3], [0, 1, 2, 4]], "volume"),
        (np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, np.nan]]), [[0, 1, 2, 3]], "finite"),
        (np.concatenate([CORNER, [[5.0, 5, 5]]]), [[0, 1, 2, 3]], "every vertex"),
        (np.concatenate([CORNER, [[0, 0, -1.0], [0.2, 0.2, -1.0]]]), [[0, 1, 2, 3], [0, 1, 2, 4], [0, 1, 2, 5]], "two"),
    ],
)
def test_bad_meshes_are_refused(vertices, tets, message):
    with pytest.raises(InvalidInputError, match=message):
        _ = TetMesh(vertices, np.array(tets)).boundary_triangles


def test_cad_faces_must_fit():
    with pytest.raises(InvalidInputError, match="boundary triangles"):
        TetMesh(CORNER, np.array([[0, 1, 2, 3]]), np.array([1, 2]))
