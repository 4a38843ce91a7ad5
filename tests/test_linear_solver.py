import numpy as np
import pytest
import scipy.sparse as sp

from michell_cad import linear_solver
from michell_cad.errors import ConvergenceError
from michell_cad.linear_solver import factorise, measure_factorisation


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
