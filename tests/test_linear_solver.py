import numpy as np
import pytest
import scipy.sparse as sp
from shapes import box_mesh, cantilever

from michell_cad import linear_solver, multigrid
from michell_cad.elasticity import solve_elasticity
from michell_cad.errors import ConvergenceError
from michell_cad.linear_solver import factorise, measure_factorisation
from michell_cad.multigrid import MultigridSolver


def spd(n: int = 60) -> sp.csr_matrix:
    A = sp.random(n, n, 0.1, random_state=np.random.default_rng(0))
    return sp.csr_matrix(A @ A.T + 2 * sp.identity(n))


@pytest.fixture(params=["preferred", "fallback"])
def solver(request, monkeypatch):
    if request.param == "fallback":
        monkeypatch.setattr(linear_solver, "PyPardisoSolver", None)
    return request.param


def test_one_and_several_right_hand_sides(solver):
    A, rng = spd(), np.random.default_rng(1)
    factor = factorise(A)
    for b in (rng.normal(size=60), rng.normal(size=(60, 3))):
        np.testing.assert_allclose(A @ factor.solve(b), b, atol=1e-10)
    factor, x, unit = measure_factorisation(A, np.ones(60))
    np.testing.assert_allclose(A @ x, 1, atol=1e-10)
    assert unit > 0


def test_an_indefinite_matrix_is_refused():
    if linear_solver.PyPardisoSolver is None:
        pytest.skip("only the Cholesky solver notices")
    with pytest.raises(ConvergenceError, match="positive definite"):
        factorise(sp.diags([1.0, -1.0, 2.0]))


def test_a_singular_matrix_is_refused(solver):
    with pytest.raises(ConvergenceError, match="positive definite"):
        factorise(sp.csr_matrix(np.ones((2, 2))))


def test_an_ordering_serves_all_matrices_of_a_pattern(solver):
    A = spd()
    first = factorise(A)
    B = sp.csr_matrix(A + 3 * sp.diags(A.diagonal()))
    b = np.random.default_rng(2).normal(size=60)
    np.testing.assert_allclose(factorise(B, first.ordering).solve(b), np.linalg.solve(B.toarray(), b), atol=1e-12)
    np.testing.assert_allclose(A @ first.solve(b), b, atol=1e-10)


def test_what_does_not_fit_in_memory_is_solved_by_multigrid(monkeypatch):
    if linear_solver.PyPardisoSolver is None:
        pytest.skip("only Pardiso foresees the size of its factor")
    problem = cantilever((24, 8, 8))
    mesh = problem.mesh
    direct = solve_elasticity(problem)
    monkeypatch.setattr(linear_solver, "free_memory", lambda: 1_000_000)
    assert isinstance(factorise(mesh.laplacian() + sp.identity(len(mesh.vertices))), MultigridSolver)
    field = solve_elasticity(problem)
    scale = np.abs(direct.displacements).max()
    np.testing.assert_allclose(field.displacements, direct.displacements, atol=1e-6 * scale)
    assert field.smoothing_steps == direct.smoothing_steps
    np.testing.assert_allclose(field.stress, direct.stress, atol=1e-5 * np.abs(direct.stress).max())


def test_multigrid_that_does_not_converge_says_so(monkeypatch):
    monkeypatch.setattr(multigrid, "MOST_ITERATIONS", 2)
    mesh = box_mesh((24, 6, 6), (24.0, 6.0, 6.0))
    A = sp.csr_matrix(mesh.laplacian() + 1e-6 * sp.identity(len(mesh.vertices)))
    with pytest.raises(ConvergenceError, match="after 2 iterations"):
        MultigridSolver(A).solve(np.random.default_rng(0).normal(size=len(mesh.vertices)))
