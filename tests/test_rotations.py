import numpy as np
from scipy.linalg import expm

from michell_cad.rotations import rotate_back, rotation_matrix


def test_rotation_matrix_is_the_matrix_exponential():
    w = np.concatenate([np.random.default_rng(0).normal(size=(20, 3)) * 2, np.zeros((1, 3)), np.full((1, 3), 1e-9)])
    generators = np.array([[[0, -z, y], [z, 0, -x], [-y, x, 0]] for x, y, z in w])
    np.testing.assert_allclose(rotation_matrix(w), np.array([expm(W) for W in generators]), atol=1e-12)


def test_rotate_back_gives_the_gradient_of_a_function_of_the_rotation():
    rng = np.random.default_rng(3)
    A, w = rng.normal(size=(3, 3)), rng.normal(size=(4, 3))
    w[0] *= 1e-5  # where series take the place of quotients
    R = rotation_matrix(w)
    # f = A : R changes under R -> R exp [d]_x by A : R [d]_x, and (R' A) : [e_k]_x is the difference of two entries.
    B = np.swapaxes(R, 1, 2) @ A
    v = np.stack([B[:, 2, 1] - B[:, 1, 2], B[:, 0, 2] - B[:, 2, 0], B[:, 1, 0] - B[:, 0, 1]], axis=1)
    h = 1e-6
    for k in range(3):
        ahead, behind = (np.einsum("ij,nij->n", A, rotation_matrix(w + sign * h * np.eye(3)[k])) for sign in (1, -1))
        np.testing.assert_allclose(rotate_back(w, v)[:, k], (ahead - behind) / (2 * h), atol=1e-8)
