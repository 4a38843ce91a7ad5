import numpy as np
from scipy.linalg import expm

from michell_cad.rotations import rotation_matrix


def test_rotation_matrix_is_the_matrix_exponential():
    w = np.concatenate([np.random.default_rng(0).normal(size=(20, 3)) * 2, np.zeros((1, 3)), np.full((1, 3), 1e-9)])
    generators = np.array([[[0, -z, y], [z, 0, -x], [-y, x, 0]] for x, y, z in w])
    np.testing.assert_allclose(rotation_matrix(w), np.array([expm(W) for W in generators]), atol=1e-12)
