import numpy as np
from scipy.linalg import expm

from michell_cad.rotations import pull_back, rotation_matrix


def test_rotation_matrix_is_the_matrix_exponential():
    w = np.concatenate([np.random.default_rng(0).normal(size=(20, 3)) * 2, np.zeros((1, 3)), np.full((1, 3), 1e-9)])
    generators = np.array([[[0, -z, y], [z, 0, -x], [-y, x, 0]] for x, y, z in w])
    np.testing.assert_allclose(rotation_matrix(w), np.array([expm(W) for W in generators]), atol=1e-12)


def test_pull_back_is_the_derivative():
    rng = np.random.default_rng(1)
    A = rng.normal(size=(3, 3))
    for w in (rng.normal(size=3), 1e-6 * rng.normal(size=3), np.zeros(3)):
        R = rotation_matrix(w)
        # f = <A, R>; under R -> R exp [d]_x the derivative along d is <R'A, [d]_x>.
        M = R.T @ A
        v = np.array([M[2, 1] - M[1, 2], M[0, 2] - M[2, 0], M[1, 0] - M[0, 1]])
        steps = 1e-6 * np.eye(3)
        numeric = [np.vdot(A, rotation_matrix(w + d) - rotation_matrix(w - d)) / 2e-6 for d in steps]
        np.testing.assert_allclose(pull_back(w, v), numeric, atol=1e-8)
