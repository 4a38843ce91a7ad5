"""The brick with eight nodes, against what any element must do."""

import numpy as np
import pytest
from shapes import ABS

from michell_cad.elasticity import lame_parameters
from michell_cad.rigid_motions import rigid_motions
from michell_cad.strength.comparison.voxel_elements import CORNERS, brick_stiffness, shape_functions, shape_gradients

EDGES = np.array([2.0, 3.0, 0.5])
NODES = (CORNERS + 1) / 2 * EDGES


def test_functions_reproduce_linear_fields_also_outside():
    x = np.random.default_rng(0).uniform(-2, 2, (5, 3))
    N = shape_functions(x)
    np.testing.assert_allclose(N.sum(1), 1)
    np.testing.assert_allclose(N @ NODES, (x + 1) / 2 * EDGES, atol=1e-12)
    np.testing.assert_allclose(shape_functions(CORNERS), np.eye(8), atol=1e-15)
    h = 1e-6
    for d in range(3):
        step = h * np.eye(3)[d]
        slope = (shape_functions(x + step) - shape_functions(x - step)) / (2 * h) * 2 / EDGES[d]
        np.testing.assert_allclose(shape_gradients(x, EDGES)[:, :, d], slope, atol=1e-8)


def test_only_rigid_motions_cost_nothing():
    K = brick_stiffness(EDGES, ABS)
    np.testing.assert_allclose(K, K.T, atol=1e-12 * np.abs(K).max())
    values = np.linalg.eigvalsh(K)
    assert (np.abs(values[:6]) < 1e-12 * values[-1]).all()
    assert values[6] > 1e-4 * values[-1]
    np.testing.assert_allclose(K @ rigid_motions(NODES).reshape(24, 6), 0, atol=1e-10 * values[-1])


@pytest.mark.parametrize("component", [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)])
def test_energy_of_a_constant_strain(component):
    i, j = component
    H = np.zeros((3, 3))
    H[i, j] = 1e-3
    strain = (H + H.T) / 2
    lmbda, mu = lame_parameters(ABS)
    density = lmbda * np.trace(strain) ** 2 + 2 * mu * (strain**2).sum()
    u = (NODES @ H.T).ravel()
    assert u @ brick_stiffness(EDGES, ABS) @ u == pytest.approx(density * EDGES.prod(), rel=1e-12)


def test_bending_by_hand():
    """u_x = x y over the brick [-a, a] x ..., u_y = 0: strains eps_x = y, gamma_xy = x, so that the energy is
    (lambda + 2 mu) int y^2 + mu int x^2 = ((lambda + 2 mu) b^2 + mu a^2) V / 3 with half edges a and b."""
    lmbda, mu = lame_parameters(ABS)
    X = CORNERS * EDGES / 2
    u = np.stack([X[:, 0] * X[:, 1], 0 * X[:, 0], 0 * X[:, 0]], axis=1).ravel()
    a, b, _ = EDGES / 2
    exact = ((lmbda + 2 * mu) * b**2 + mu * a**2) * EDGES.prod() / 3
    assert u @ brick_stiffness(EDGES, ABS) @ u == pytest.approx(exact, rel=1e-12)
