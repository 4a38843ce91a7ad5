import numpy as np
import pytest
from shapes import ABS, box_mesh, cantilever, renumbered, turned

from michell_cad.elasticity import (
    ElasticityOptions,
    cauchy_stress,
    internal_force,
    lame_parameters,
    solve_elasticity,
    stiffness_matrix,
)
from michell_cad.linear_solver import factorise
from michell_cad.problem import DesignProblem, LoadCase, surface_force
from michell_cad.rotations import rotation_matrix
from michell_cad.tet_mesh import TetMesh


def jittered_box(cells: int, rng: np.random.Generator) -> TetMesh:
    mesh = box_mesh((cells, cells, cells))
    inner = np.ones(len(mesh.vertices), bool)
    inner[mesh.boundary_vertices] = False
    shift = rng.uniform(-0.2, 0.2, mesh.vertices.shape) / cells
    return TetMesh(mesh.vertices + inner[:, None] * shift, mesh.tets)


def solve_dirichlet(mesh: TetMesh, displacement: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Displacements with given values on the boundary and nodal forces inside."""
    K = stiffness_matrix(mesh, ABS)
    held = np.zeros(displacement.shape, bool)
    held[mesh.boundary_vertices] = True
    free, u = ~held.ravel(), np.where(held, displacement, 0).ravel()
    u[free] = factorise(K[free][:, free]).solve((force.ravel() - K @ u)[free])
    return u.reshape(-1, 3)


def test_patch_test_reproduces_every_constant_strain():
    mesh = jittered_box(4, np.random.default_rng(0))
    H = np.random.default_rng(1).normal(size=(3, 3))
    exact = mesh.vertices @ H.T
    u = solve_dirichlet(mesh, exact, np.zeros_like(exact))
    assert np.abs(u - exact).max() <= 1e-10 * np.abs(exact).max()
    lmbda, mu = lame_parameters(ABS)
    expected = lmbda * np.trace(H) * np.eye(3) + mu * (H + H.T)
    assert np.abs(cauchy_stress(mesh, ABS, u) - expected).max() <= 1e-10 * np.abs(expected).max()


def test_rigid_motions_cause_no_stress():
    mesh = jittered_box(3, np.random.default_rng(0))
    motion = np.cross([0.1, -0.2, 0.3], mesh.vertices) + [1.0, 2.0, 3.0]
    assert np.abs(cauchy_stress(mesh, ABS, motion)).max() <= 1e-10 * ABS.youngs_modulus
    assert np.abs(stiffness_matrix(mesh, ABS) @ motion.ravel()).max() <= 1e-10 * ABS.youngs_modulus


def test_stiffness_is_the_derivative_of_the_internal_force():
    mesh = jittered_box(2, np.random.default_rng(0))
    u = np.random.default_rng(2).normal(size=mesh.vertices.shape)
    force = internal_force(mesh, cauchy_stress(mesh, ABS, u))
    np.testing.assert_allclose((stiffness_matrix(mesh, ABS) @ u.ravel()).reshape(-1, 3), force, rtol=1e-10, atol=1e-8)


def test_linear_elements_converge_with_order_two_in_displacement_and_one_in_stress():
    """u = (sin, sin, sin) of pi x times pi y times pi z directions; the body force follows by hand."""
    lmbda, mu = lame_parameters(ABS)
    k = np.pi

    def exact(x: np.ndarray) -> np.ndarray:
        return np.stack([np.sin(k * x[:, 1]), np.sin(k * x[:, 2]), np.sin(k * x[:, 0])], axis=1)

    def exact_stress(x: np.ndarray) -> np.ndarray:
        H = np.zeros((len(x), 3, 3))
        H[:, 0, 1], H[:, 1, 2], H[:, 2, 0] = (k * np.cos(k * x[:, d]) for d in (1, 2, 0))
        return mu * (H + H.swapaxes(1, 2)) + lmbda * np.einsum("tii->t", H)[:, None, None] * np.eye(3)

    errors = []
    for cells in (4, 8, 16):
        mesh = box_mesh((cells, cells, cells))
        # div u = 0 for this field, so -div sigma = -mu lap u = mu k^2 u; exact integrals by the midpoint rule suffice.
        body = mu * k**2 * exact(mesh.vertices) * mesh.vertex_volumes[:, None]
        u = solve_dirichlet(mesh, exact(mesh.vertices), body)
        centre = u[mesh.tets].mean(1) - exact(mesh.centroids)
        stress = cauchy_stress(mesh, ABS, u) - exact_stress(mesh.centroids)
        # The centroid value of a P1 function differs from the field by its curvature, of second order as well.
        errors.append([np.sqrt(mesh.volumes @ (e**2).reshape(len(e), -1).sum(1)) for e in (centre, stress)])
    rates = np.log2(np.array(errors)[:-1] / np.array(errors)[1:])
    assert rates[-1, 0] > 1.8
    assert rates[-1, 1] > 0.8


def test_tip_deflection_of_a_cantilever_converges_to_beam_theory():
    """Timoshenko: w = F L^3/(3 E I) + F L/(k G A), from below as P1 elements are too stiff."""
    L, h, F = 80.0, 10.0, -10.0
    I, G = h**4 / 12, ABS.youngs_modulus / (2 * (1 + ABS.poisson_ratio))
    k = 10 * (1 + ABS.poisson_ratio) / (12 + 11 * ABS.poisson_ratio)  # Cowper 1966, rectangle
    beam = F * L**3 / (3 * ABS.youngs_modulus * I) + F * L / (k * G * h * h)
    tips = []
    for n in (2, 4, 8):
        mesh = box_mesh((8 * n, n, n), (L, h, h))
        fixed = np.repeat((mesh.vertices[:, 0] == 0)[:, None], 3, axis=1)
        end = mesh.vertices[:, 0] == L
        force = np.zeros_like(mesh.vertices)
        weights = np.where(end, mesh.vertex_volumes, 0)
        force[:, 2] = F * weights / weights.sum()
        field = solve_elasticity(
            DesignProblem(mesh, ABS, fixed, (LoadCase("tip", force),)), ElasticityOptions(smoothing_steps=0)
        )
        tips.append(field.displacements[0][end, 2].mean())
    errors = 1 - np.array(tips) / beam
    assert (errors > 0).all()
    assert errors[-1] < 0.1
    assert np.log2(errors[1] / errors[2]) > 1.5


def test_smoothing_keeps_equilibrium_and_a_constant_stress():
    """The smoothed stress balances the loads to the stated tolerance; a bar in tension has the stress F/A exactly."""
    problem = cantilever()
    options = ElasticityOptions(smoothing_tolerance=1e-3, smoothing_steps=200)
    field = solve_elasticity(problem, options)
    assert field.smoothing_residuals[0] <= 1e-3
    mesh, free, force = problem.mesh, ~problem.fixed.ravel(), problem.load_cases[0].force
    factor = factorise(stiffness_matrix(mesh, ABS)[free][:, free])

    def norm(f: np.ndarray) -> float:
        return float(np.sqrt(f.ravel()[free] @ factor.solve(f.ravel()[free])))

    assert norm(internal_force(mesh, field.stress) - force) <= 1.001e-3 * norm(force)

    end = np.isclose(mesh.vertices[mesh.boundary_triangles][:, :, 0], 80).all(1)
    fixed = np.zeros(mesh.vertices.shape, bool)
    fixed[mesh.vertices[:, 0] == 0, 0] = True
    fixed[np.argmin(np.linalg.norm(mesh.vertices, axis=1))] = True
    fixed[np.argmin(np.linalg.norm(mesh.vertices - [0, 40, 0], axis=1)), 2] = True
    pull = surface_force(mesh, np.flatnonzero(end), np.array([1600.0, 0, 0]))
    stress = solve_elasticity(DesignProblem(mesh, ABS, fixed, (LoadCase("pull", pull),))).stress
    expected = np.zeros((3, 3))
    expected[0, 0] = 1.0
    np.testing.assert_allclose(stress, np.broadcast_to(expected, stress.shape), atol=1e-9)


def test_stress_turns_scales_and_renumbers_with_the_problem():
    problem = cantilever((6, 3, 3))
    stress = solve_elasticity(problem).stress
    Q = rotation_matrix(np.array([0.4, -1.1, 0.7]))
    rotated = solve_elasticity(turned(problem, Q, scale=1e-3)).stress
    size = np.abs(stress).max()
    np.testing.assert_allclose(rotated, Q @ stress @ Q.T, atol=1e-6 * size)
    other, _, tets = renumbered(problem, np.random.default_rng(0))
    np.testing.assert_allclose(solve_elasticity(other).stress, stress[tets], atol=1e-6 * size)


@pytest.mark.parametrize("weights", [(1.0, 1.0), (0.5, 2.0)])
def test_load_cases_combine_as_stated(weights):
    problem = cantilever((6, 3, 3))
    down = problem.load_cases[0].force
    side = np.stack([down[:, 0], down[:, 2], down[:, 1]], axis=1)
    cases = (LoadCase("down", down, weights[0]), LoadCase("side", side, weights[1]))
    one = [
        solve_elasticity(DesignProblem(problem.mesh, ABS, problem.fixed, (LoadCase(c.name, c.force),))).stress
        for c in cases
    ]
    both = DesignProblem(problem.mesh, ABS, problem.fixed, cases)
    summed = sum(w * s for w, s in zip(weights, one, strict=True))
    np.testing.assert_allclose(solve_elasticity(both).stress, summed, atol=1e-9)
    envelope = solve_elasticity(DesignProblem(problem.mesh, ABS, problem.fixed, cases, "envelope")).stress
    squared = sum(w * s @ s for w, s in zip(weights, one, strict=True))
    np.testing.assert_allclose(envelope @ envelope, squared, atol=1e-9)
    assert np.linalg.eigvalsh(envelope).min() > -1e-9
