import numpy as np
import pytest
from shapes import box_mesh, cantilever, renumbered, turned

from michell_cad.constant_frames import constant_frames
from michell_cad.elasticity import StressField, solve_elasticity
from michell_cad.frame_field import FrameFieldOptions, fit_frame_field, matching_metric
from michell_cad.matching_energy import add_tets
from michell_cad.metrics import misalignment, shear_residual
from michell_cad.rotations import rotation_matrix
from michell_cad.tet_mesh import TetMesh


def field_of(mesh: TetMesh, stress: np.ndarray) -> StressField:
    return StressField(stress, np.zeros((1, len(mesh.vertices), 3)), (0,), (0.0,), 0.0)


def test_matching_metric_by_hand():
    """Eigenvalues 5, 2, -1 become 10, 5.5, 1; the best frame has energy sqrt(5.5) + sqrt(1)."""
    Q = rotation_matrix(np.array([0.3, 0.5, -0.2]))
    metric, least = matching_metric((Q @ np.diag([5.0, 2.0, -1.0]) @ Q.T)[None])
    np.testing.assert_allclose(metric[0], Q @ np.diag([10.0, 5.5, 1.0]) @ Q.T, atol=1e-12)
    np.testing.assert_allclose(least, np.sqrt(5.5) + 1)
    np.testing.assert_allclose(matching_metric(-3 * np.eye(3)[None])[0][0], np.eye(3))


def test_matching_energy_and_its_gradient():
    """Eq. 4 written out with whole matrices, and central differences, at large, small and vanishing rotations."""
    mesh, rng = box_mesh((2, 1, 1)), np.random.default_rng(0)
    A = rng.normal(size=(len(mesh.tets), 3, 3))
    A = A @ A.swapaxes(1, 2) + 0.5 * np.eye(3)
    weights = rng.uniform(0.5, 2, len(mesh.tets))

    def energy(w: np.ndarray) -> float:
        R = rotation_matrix(w[mesh.tets].mean(1))
        S = R.swapaxes(1, 2) @ A @ R
        return float(weights @ (np.sqrt(S[:, 1, 1]) + np.sqrt(S[:, 2, 2])))

    for size in (2.0, 1e-5, 0.0):
        w = size * rng.normal(size=mesh.vertices.shape)
        gradient = np.zeros_like(w)
        assert add_tets(mesh.tets, weights, A, w, gradient) == pytest.approx(energy(w), rel=1e-12)
        direction = rng.normal(size=w.shape)
        numeric = (energy(w + 1e-6 * direction) - energy(w - 1e-6 * direction)) / 2e-6
        assert np.vdot(gradient, direction) == pytest.approx(numeric, rel=1e-6)


def test_constant_stress_gives_its_principal_frame():
    mesh = box_mesh((3, 2, 2))
    Q = rotation_matrix(np.array([1.0, -0.4, 0.9]))
    stress = np.broadcast_to(Q @ np.diag([4.0, 1.0, -3.0]) @ Q.T, (len(mesh.tets), 3, 3))
    field = fit_frame_field(mesh, field_of(mesh, stress))
    assert misalignment(stress, field.frames).max() < 0.2
    np.testing.assert_allclose(np.abs(np.einsum("ti,i->t", field.frames[:, :, 0], Q[:, 0])), 1, atol=1e-4)
    assert field.data_energy == pytest.approx(field.least_data_energy, rel=1e-5)


def test_frames_follow_circles_around_a_hole():
    """Hoop tension around an axis outside the part: the first axis turns by the polar angle."""
    mesh = box_mesh((10, 10, 2), (10.0, 10.0, 2.0))
    x = mesh.centroids + [4.0, 4.0, 0.0]
    radial = np.stack([x[:, 0], x[:, 1], 0 * x[:, 0]], axis=1)
    radial /= np.linalg.norm(radial, axis=1, keepdims=True)
    hoop = np.cross([0.0, 0.0, 1.0], radial)
    stress = 3 * np.einsum("ti,tj->tij", hoop, hoop) - np.einsum("ti,tj->tij", radial, radial)
    field = fit_frame_field(mesh, field_of(mesh, stress))
    assert shear_residual(mesh, stress, field.frames) < 0.06
    assert np.abs(np.einsum("ti,ti->t", field.frames[:, :, 0], hoop)).min() > 0.9


def test_frames_are_rotations_also_without_any_direction():
    mesh = box_mesh((2, 2, 2))
    for stress in (np.zeros((len(mesh.tets), 3, 3)), np.broadcast_to(-2 * np.eye(3), (len(mesh.tets), 3, 3))):
        R = fit_frame_field(mesh, field_of(mesh, stress)).frames
        np.testing.assert_allclose(R @ R.swapaxes(1, 2), np.broadcast_to(np.eye(3), R.shape), atol=1e-12)
        np.testing.assert_allclose(np.linalg.det(R), 1)


@pytest.mark.parametrize("scale", [1.0, 1000.0])
def test_frames_turn_with_the_problem(scale):
    problem = cantilever((8, 4, 4))
    Q = rotation_matrix(np.array([0.5, 0.9, -1.3]))
    other = turned(problem, Q, scale)
    one, two = solve_elasticity(problem), solve_elasticity(other)
    a = shear_residual(problem.mesh, one.stress, fit_frame_field(problem.mesh, one).frames)
    b = shear_residual(other.mesh, two.stress, fit_frame_field(other.mesh, two).frames)
    assert a == pytest.approx(b, rel=0.02)


def test_renumbering_does_not_matter():
    problem = cantilever((8, 4, 4))
    other, _, _ = renumbered(problem, np.random.default_rng(3))
    residuals = []
    for p in (problem, other):
        field = solve_elasticity(p)
        residuals.append(shear_residual(p.mesh, field.stress, fit_frame_field(p.mesh, field).frames))
    assert residuals[0] == pytest.approx(residuals[1], rel=0.02)


def test_refining_the_mesh_does_not_loosen_the_frames():
    residuals = []
    for cells in ((6, 3, 3), (12, 6, 6)):
        problem = cantilever(cells)
        field = solve_elasticity(problem)
        residuals.append(shear_residual(problem.mesh, field.stress, fit_frame_field(problem.mesh, field).frames))
    assert residuals[1] < residuals[0] * 1.2


def test_constant_frames_are_different_minima():
    problem = cantilever((6, 3, 3))
    metric, _ = matching_metric(solve_elasticity(problem).stress)
    frames = constant_frames(problem.mesh, metric, 4)
    assert 1 <= len(frames) <= 4
    for R in frames:
        np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-12)


def test_options_are_checked():
    with pytest.raises(ValueError, match="starts"):
        FrameFieldOptions(starts=0)
    with pytest.raises(ValueError, match="smoothness"):
        FrameFieldOptions(smoothness=())
