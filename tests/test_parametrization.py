import numpy as np
import pytest
from shapes import box_mesh, cantilever, turned

from michell_cad.elasticity import StressField, solve_elasticity
from michell_cad.frame_field import fit_frame_field
from michell_cad.isocurves import trace_isocurves
from michell_cad.metrics import shear_residual, uncarried_stress
from michell_cad.parametrization import (
    Parametrization,
    ParametrizationOptions,
    count_double_wound_edges,
    parametrize,
)
from michell_cad.parametrization.equation_11 import integrate_frames
from michell_cad.parametrization.fold_barrier import BarrierEnergy, remove_folds
from michell_cad.parametrization.jacobians import cofactors, determinants, product, transposed
from michell_cad.parametrization.phase import CLEARANCE, MOST_STRETCH, choose_phases, hug_faces
from michell_cad.parametrization.stress_following import _FollowingEnergy
from michell_cad.rotations import rotation_matrix
from michell_cad.tet_mesh import TetMesh
from michell_cad.truss import NodeKind, clean_network, interior_degree_6


def random_frames(mesh: TetMesh, size: float, seed: int = 0) -> np.ndarray:
    return rotation_matrix(size * np.random.default_rng(seed).normal(size=(len(mesh.tets), 3)))


def test_constant_frames_integrate_exactly():
    mesh = box_mesh((3, 2, 2))
    Q = rotation_matrix(np.array([0.3, -0.8, 0.5]))
    frames = np.broadcast_to(Q, (len(mesh.tets), 3, 3))
    for beta in (0.1, 1.0):
        phi = integrate_frames(mesh, frames, beta).phi
        exact = (mesh.vertices - mesh.vertices[0]) @ Q
        np.testing.assert_allclose(phi, exact, atol=1e-12)


def test_gradient_frames_of_a_harmonic_pair_integrate_exactly():
    """Frames of the map (log r, angle) are a scaled rotation: with a small beta its directions come back."""
    mesh = box_mesh((8, 8, 2), (4.0, 4.0, 1.0))
    x = mesh.centroids + [3.0, 3.0, 0.0]
    angle = np.arctan2(x[:, 1], x[:, 0])
    frames = rotation_matrix(np.stack([0 * angle, 0 * angle, angle], axis=1))
    phi = integrate_frames(mesh, frames, 1e-3).phi
    gradients = mesh.gradients(phi)[:, :2]
    unit = gradients / np.linalg.norm(gradients, axis=2, keepdims=True)
    cosine = np.einsum("tid,tdi->ti", unit, frames[:, :, :2])
    assert np.median(cosine) > 0.995


def test_matrix_helpers_agree_with_linear_algebra():
    rng = np.random.default_rng(0)
    A, B = rng.normal(size=(2, 7, 3, 3))
    a, b = A.transpose(1, 2, 0), B.transpose(1, 2, 0)
    np.testing.assert_allclose(product(a, transposed(b)), (A @ B.swapaxes(1, 2)).transpose(1, 2, 0))
    C = cofactors(a)
    np.testing.assert_allclose(determinants(a, C), np.linalg.det(A))
    np.testing.assert_allclose(transposed(C) / determinants(a, C), np.linalg.inv(A).transpose(1, 2, 0))


@pytest.mark.parametrize("which", ["barrier", "following"])
def test_energies_have_the_gradient_they_claim(which):
    mesh = box_mesh((3, 3, 3), (3.0, 3.0, 3.0))
    rng = np.random.default_rng(1)
    phi = mesh.vertices + 0.05 * rng.normal(size=mesh.vertices.shape)
    if which == "barrier":
        frames = random_frames(mesh, 0.4)
        energy = BarrierEnergy(mesh, frames, 0.1, integrate_frames(mesh, frames, 0.1))
        energy.eps = 0.3
    else:
        stress = rng.normal(size=(len(mesh.tets), 3, 3))
        energy = _FollowingEnergy(mesh, stress + stress.swapaxes(1, 2))
    direction = rng.normal(size=phi.shape)
    step = 1e-6
    numeric = (energy(phi + step * direction)[0] - energy(phi - step * direction)[0]) / (2 * step)
    assert np.vdot(energy(phi)[1], direction) == pytest.approx(numeric, rel=1e-6)


def test_folds_are_removed_also_from_random_frames():
    mesh = box_mesh((5, 5, 5), (5.0, 5.0, 5.0))
    for size in (0.8, 2.0):
        frames = random_frames(mesh, size)
        linear = integrate_frames(mesh, frames, 0.1)
        phi = remove_folds(mesh, frames, 0.1, linear)
        assert np.linalg.det(mesh.gradients(phi)).min() > 0
        assert count_double_wound_edges(mesh, phi) == 0


def test_a_doubly_wound_edge_is_seen():
    """Six tets around an edge, their angles doubled: every determinant stays positive, the edge winds twice."""
    angle = np.arange(6) * np.pi / 3
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    vertices = np.concatenate([[[0.0, 0, -1], [0, 0, 1]], ring])
    k = np.arange(6)
    mesh = TetMesh(vertices, np.stack([0 * k, 0 * k + 1, 2 + k, 2 + (k + 1) % 6], axis=1))
    assert count_double_wound_edges(mesh, vertices) == 0
    wound = vertices.copy()
    wound[2:] = np.stack([np.cos(2 * angle), np.sin(2 * angle), 0 * angle], axis=1)
    assert np.linalg.det(mesh.gradients(wound)).min() > 0
    assert count_double_wound_edges(mesh, wound) == 1


def test_following_the_stress_beats_equation_11():
    problem = cantilever((12, 6, 6))
    mesh, field = problem.mesh, solve_elasticity(problem)
    frames = fit_frame_field(mesh, field)
    results = {}
    for follow in (False, True):
        p = parametrize(mesh, field, frames, ParametrizationOptions(follow_stress=follow))
        assert p.determinants.min() > 0
        assert count_double_wound_edges(mesh, p.phi) == 0
        results[follow] = (
            shear_residual(mesh, field.stress, p.tangents),
            uncarried_stress(mesh, field.stress, p.tangents),
        )
    assert results[True][0] < results[False][0]
    assert results[True][1] < results[False][1]


def test_a_larger_spacing_weight_spaces_more_evenly():
    problem = cantilever((8, 4, 4))
    field = solve_elasticity(problem)
    frames = fit_frame_field(problem.mesh, field)
    spread = []
    for beta in (0.1, 1.0):
        edges = parametrize(problem.mesh, field, frames, ParametrizationOptions(beta)).cell_edges
        spread.append(np.quantile(edges, 0.99) / np.median(edges))
    assert spread[1] < spread[0]


def test_residuals_do_not_depend_on_orientation_or_scale():
    problem = cantilever((8, 4, 4))
    other = turned(problem, rotation_matrix(np.array([0.7, -0.2, 1.9])), 25.4)
    residuals = []
    for p in (problem, other):
        field = solve_elasticity(p)
        phi = parametrize(p.mesh, field, fit_frame_field(p.mesh, field))
        residuals.append(shear_residual(p.mesh, field.stress, phi.tangents))
    assert residuals[0] == pytest.approx(residuals[1], rel=0.02)


def test_levels_have_the_stated_scale():
    mesh = box_mesh((4, 2, 2), (8.0, 4.0, 4.0))
    parametrization = Parametrization(mesh, mesh.vertices)
    levels, edge = parametrization.levels(resolution=16)
    assert edge == pytest.approx(0.5)
    np.testing.assert_allclose(np.ptp(levels, axis=0), [16, 8, 8])
    levels, edge = parametrization.levels(spacing=2.0)
    assert edge == pytest.approx(2.0)
    np.testing.assert_allclose(np.ptp(levels, axis=0), [4, 2, 2])
    with pytest.raises(ValueError, match="either"):
        parametrization.levels(resolution=3, spacing=2)


def test_integers_keep_clear_of_faces_they_would_graze():
    """A straight grid in a box whose faces lie at 0.2 and 0.8 of a cell: the integers go half-way between."""
    mesh = box_mesh((5, 4, 4), (7.6, 4.6, 4.6))
    phases = choose_phases(mesh, mesh.vertices + 0.2)
    np.testing.assert_allclose(phases, 0.5, atol=0.05)  # both faces are then 0.3 of a cell from an integer
    for shift in (0.0, 0.3, 0.77):
        whole = box_mesh((3, 2, 2), (3.0, 2.0, 2.0))
        phases = choose_phases(whole, whole.vertices + shift)
        np.testing.assert_allclose((phases + shift) % 1, 0.5, atol=0.02)


@pytest.mark.parametrize("turn", [np.zeros(3), np.array([0.4, -1.1, 2.0])])
def test_layers_hug_both_faces_of_a_box_on_request(turn):
    """A straight grid of about 14.6 x 12.3 x 11.5 cells, along the edges of a box that is turned in space."""
    R = rotation_matrix(turn)
    box = box_mesh((6, 5, 5), (14.6, 12.3, 11.5))
    mesh = TetMesh(box.vertices @ R.T, box.tets)
    levels, edge = Parametrization(mesh, mesh.vertices @ R).levels(spacing=1.0, layers="hug")
    np.testing.assert_allclose(1 - levels.min(0), CLEARANCE, atol=0.02)  # the lowest integer is 1
    np.testing.assert_allclose(levels.max(0) % 1, CLEARANCE, atol=0.02)
    assert edge == pytest.approx(1, rel=MOST_STRETCH)
    truss, _ = clean_network(network := trace_isocurves(mesh, levels), edge)
    assert interior_degree_6(network) == 1
    assert len(np.unique(np.sort(truss.members, axis=1), axis=0)) == len(truss.members)
    # The cells below the surface are whole: no node lies within half a cell of a face, but for those on it.
    x = (truss.nodes @ R)[truss.node_kinds == NodeKind.INTERIOR]
    assert len(x) > 500
    assert np.minimum(x, [14.6, 12.3, 11.5] - x).min() > 0.5


def test_one_face_is_hugged_by_a_shift_alone():
    """Between parallel faces the map is stretched to whole cells; with the other face slanted there is no need to."""
    cube = box_mesh((4, 4, 4), (10.3, 10.0, 10.0))
    stretch, shift = hug_faces(cube, cube.vertices + 0.3)
    np.testing.assert_allclose(stretch[0] * 10.3 % 1, 2 * CLEARANCE, atol=0.03)
    vertices = cube.vertices.copy()
    end = vertices[:, 0] > 10
    vertices[end, 0] += 3 * vertices[end, 1]
    slanted = TetMesh(vertices, cube.tets)
    stretch, shift = hug_faces(slanted, vertices + 0.3)
    assert stretch[0] == pytest.approx(1, abs=0.003)
    assert (0.3 + CLEARANCE + shift[0]) % 1 == pytest.approx(0, abs=0.02)


def test_tangents_and_cell_edges_by_hand():
    mesh = box_mesh((1, 1, 1))
    A = np.array([[2.0, 0, 0], [0, 4.0, 0], [1.0, 0, 1.0]])
    p = Parametrization(mesh, mesh.vertices @ A.T)
    B = np.linalg.inv(A)
    np.testing.assert_allclose(p.cell_edges[0], np.linalg.norm(B, axis=0))
    np.testing.assert_allclose(p.tangents[0], B / np.linalg.norm(B, axis=0), atol=1e-12)
    np.testing.assert_allclose(p.determinants, 8.0)


def test_zero_and_isotropic_stress_give_an_even_grid():
    mesh = box_mesh((3, 2, 2), (3.0, 2.0, 2.0))
    for stress in (np.zeros((len(mesh.tets), 3, 3)), np.broadcast_to(np.eye(3), (len(mesh.tets), 3, 3))):
        field = StressField(stress, np.zeros((1, len(mesh.vertices), 3)), (0,), (0.0,), 0.0)
        p = parametrize(mesh, field, fit_frame_field(mesh, field))
        np.testing.assert_allclose(p.cell_edges, 1, atol=1e-3)


def test_options_are_checked():
    with pytest.raises(ValueError, match="spacing_weight"):
        ParametrizationOptions(spacing_weight=0)
