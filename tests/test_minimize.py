import numpy as np
import pytest

from michell_cad.minimize import minimize


def rosenbrock(x: np.ndarray) -> tuple[float, np.ndarray]:
    a, b = x
    return (1 - a) ** 2 + 100 * (b - a * a) ** 2, np.array([-2 * (1 - a) - 400 * a * (b - a * a), 200 * (b - a * a)])


def test_finds_the_bottom_of_the_valley():
    x, report = minimize(rosenbrock, np.array([-1.2, 1.0]), lambda g: g, iterations=200, tolerance=1e-9)
    np.testing.assert_allclose(x, 1, atol=1e-5)
    assert report.iterations < 100


def test_a_perfect_preconditioner_solves_a_quadratic_in_few_steps():
    H = np.diag([1.0, 1e4, 1e8])
    x, report = minimize(lambda x: (0.5 * x @ H @ x, H @ x), np.ones(3), lambda g: g / np.diag(H), tolerance=0.0)
    np.testing.assert_allclose(x, 0, atol=1e-12)
    assert report.iterations <= 2


def test_stays_inside_where_the_energy_is_finite():
    def barrier(x: np.ndarray) -> tuple[float, np.ndarray]:
        if x[0] <= 0:
            return np.inf, x
        return float(x[0] - np.log(x[0])), 1 - 1 / x

    for start in (1e-3, 50.0):
        x, _ = minimize(barrier, np.array([start]), lambda g: 100 * g, tolerance=1e-12)
        assert x[0] == pytest.approx(1, abs=1e-4)


def test_steps_cut_short_do_not_count_as_converged():
    """A wall stands close before each of the first ten accepted points; behind it the way to x = 5 is free."""
    reached = [0.0]

    def corridor(x: np.ndarray) -> tuple[float, np.ndarray]:
        if len(reached) <= 10 and x[0] > max(reached) + 1e-3:
            return np.inf, x
        reached.append(float(x[0]))
        return 1000 + 0.5 * float(x[0] - 5) ** 2, x - 5

    x, report = minimize(corridor, np.zeros(1), lambda g: g, tolerance=1e-4)
    assert x[0] == pytest.approx(5, abs=0.5)
    assert report.converged


def test_stops_when_the_caller_says_so():
    _, report = minimize(rosenbrock, np.array([-1.2, 1.0]), lambda g: g, stop=lambda value: value < 4.0)
    assert report.value < 4.0
    assert "condition" in report.reason
    _, report = minimize(lambda x: (0.0, 0 * x), np.ones(2), lambda g: g)
    assert report.reason == "the gradient vanishes"


def test_a_wrong_gradient_is_admitted():
    x, report = minimize(lambda x: (float(x @ x), -2 * x), np.ones(2), lambda g: g)
    assert not report.converged
    np.testing.assert_allclose(x, 1)
