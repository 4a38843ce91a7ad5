import numpy as np

from michell_cad.strength.asymptotes import MovingAsymptotes


def test_known_least_value_under_one_constraint():
    """sum c exp(-x) at sum exp(x) = 1 is least where exp(x) goes with c^(1/2) (Lagrange)."""
    c = np.array([1.0, 4.0, 9.0, 100.0])
    x, method = np.full(4, np.log(0.25)), MovingAsymptotes(0.5)
    bounds = np.full(4, -10.0), np.zeros(4)
    for _ in range(60):
        x = method.step(x, -c * np.exp(-x), np.exp(x), bounds)
        x = x - np.log(np.exp(x).sum())
    np.testing.assert_allclose(np.exp(x), np.sqrt(c) / np.sqrt(c).sum(), rtol=1e-6)


def test_bounds_and_steps_hold():
    c = np.array([1.0, 4.0, 9.0, 100.0])
    x, method = np.full(4, np.log(0.25)), MovingAsymptotes(0.1)
    bounds = np.full(4, np.log(0.15)), np.full(4, np.log(0.5))
    for _ in range(30):
        new = method.step(x, -c * np.exp(-x), np.exp(x), bounds)
        assert np.abs(new - x).max() <= 0.1 + 1e-12
        assert (new >= bounds[0] - 1e-12).all()
        assert (new <= bounds[1] + 1e-12).all()
        x = new
    assert x[3] > x[2] > x[0]


def test_what_makes_the_function_rise_shrinks():
    """Gradients of both signs: no use for a variable that only harms."""
    x, method = np.zeros(3), MovingAsymptotes(0.3)
    bounds = np.full(3, -2.0), np.full(3, 2.0)
    for _ in range(40):
        gradient = np.array([np.exp(x[0]), -np.exp(-x[1]), -2 * np.exp(-x[2])])
        x = method.step(x, gradient, np.exp(x), bounds)
    assert x[0] == -2.0
    assert x[2] > x[1] > 0
