import numpy as np
from scipy.linalg import subspace_angles

from michell_cad.rigid_motions import free_motions, name_motions, rigid_motions


def test_motions_are_translations_and_rotations():
    rng = np.random.default_rng(0)
    x, v, w = rng.normal(size=(5, 3)), rng.normal(size=3), rng.normal(size=3)
    np.testing.assert_allclose(rigid_motions(x) @ np.append(v, w), v + np.cross(w, x), atol=1e-14)


def test_the_transpose_gives_resultant_force_and_moment():
    rng = np.random.default_rng(1)
    x, f = rng.normal(size=(2, 5, 3))
    resultant = np.einsum("ndk,nd->k", rigid_motions(x), f)
    np.testing.assert_allclose(resultant, np.append(f.sum(0), np.cross(x, f).sum(0)), atol=1e-14)


def test_a_hinge_leaves_the_turn_about_its_line():
    held = rigid_motions(np.array([[0, 0, 0.5], [0, 0, -0.5]])).reshape(-1, 6)
    free = free_motions(held)
    assert subspace_angles(free, np.eye(6)[:, [5]]).max() < 1e-7
    assert name_motions(free) == ["it can turn about z"]
    assert name_motions(np.eye(6)[:, :2]) == ["it can move along x", "it can move along y"]
    assert free_motions(np.eye(6)).shape == (6, 0)
