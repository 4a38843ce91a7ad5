"""Random stress fields whose principal stresses coincide, through frames, parametrization and isocurves."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from networks import check_network
from scipy.spatial.transform import Rotation
from shapes import box_mesh

from michell_cad.elasticity import StressField
from michell_cad.frame_field import fit_frame_field
from michell_cad.isocurves import trace_isocurves
from michell_cad.metrics import name_families, shear_residual, uncarried_stress
from michell_cad.parametrization import ParametrizationOptions, count_double_wound_edges, parametrize
from michell_cad.tet_mesh import TetMesh
from michell_cad.truss import clean_network

MESH = box_mesh((4, 3, 3), (4.0, 3.0, 3.0))
N = len(MESH.tets)

EIGENVALUES = {
    "two equal, the largest": lambda rng: np.repeat(rng.normal(size=(N, 2)), (2, 1), axis=1),
    "two equal, the smallest": lambda rng: np.abs(rng.normal(size=(N, 1))) * [1.0, 0.0, 0.0],
    "three equal": lambda rng: np.repeat(rng.normal(size=(N, 1)), 3, axis=1),
    "three equal and constant": lambda rng: np.full((N, 3), -2.0),
    "some zero": lambda rng: rng.normal(size=(N, 3)) * (rng.random((N, 1)) < 0.3),
    "one tet only": lambda rng: (np.arange(N) == rng.integers(N))[:, None] * [3.0, 1.0, -2.0],
    "zero": lambda rng: np.zeros((N, 3)),
    "distinct": lambda rng: rng.normal(size=(N, 3)),
}


def random_stress(kind: str, seed: int, noise: float, smooth: bool, scale: float = 1.0) -> np.ndarray:
    """sigma = Q diag(s) Q' with s of the given kind; Q random in each tet, or turning slowly through the part."""
    rng = np.random.default_rng(seed)
    if smooth:
        Q = Rotation.from_rotvec(MESH.centroids @ rng.normal(size=(3, 3)) * 0.5).as_matrix()
    else:
        Q = Rotation.random(N, random_state=seed % 2**31).as_matrix()
    values = EIGENVALUES[kind](rng) + noise * rng.normal(size=(N, 3))
    return scale * np.einsum("tik,tk,tjk->tij", Q, values, Q)


@settings(max_examples=20, deadline=None)
@given(
    kind=st.sampled_from(sorted(EIGENVALUES)),
    seed=st.integers(0, 2**32 - 1),
    noise=st.sampled_from([0.0, 1e-12]),
    smooth=st.booleans(),
    scale=st.sampled_from([1e-20, 1.0, 1e20]),
    beta=st.sampled_from([0.1, 1.0]),
    follow=st.booleans(),
)
def test_any_stress_gives_sound_curves(
    kind: str, seed: int, noise: float, smooth: bool, scale: float, beta: float, follow: bool
) -> None:
    """No inverted tet, no doubly wound edge, interior degree 6, no repeated member, and no figure that is no number."""
    stress = random_stress(kind, seed, noise, smooth, scale)
    field = StressField(stress, np.zeros((1, len(MESH.vertices), 3)), (0,), (0.0,), 0.0)
    frames = fit_frame_field(MESH, field)
    np.testing.assert_allclose(np.linalg.det(frames.frames), 1)
    p = parametrize(MESH, field, frames, ParametrizationOptions(beta, follow))
    assert p.determinants.min() > 0
    assert count_double_wound_edges(MESH, p.phi) == 0
    levels, spacing = p.levels(7.0)
    network = trace_isocurves(MESH, levels, name_families(MESH, stress, p.tangents))
    check_network(network)
    truss, _ = clean_network(network, spacing)
    assert len(np.unique(truss.members, axis=0)) == len(truss.members)
    for residual in (shear_residual, uncarried_stress):
        assert 0 <= residual(MESH, stress, p.tangents) < 2


@pytest.mark.parametrize("follow", [False, True])
@pytest.mark.parametrize("kind", ["two equal, the largest", "two equal, the smallest"])
def test_two_equal_stresses_leave_one_direction_to_follow(kind, follow):
    """With axial symmetry about a constant axis one family runs along it, whatever the rounding in the other two."""
    axis = np.array([1.0, 2.0, -2.0]) / 3
    values = (2.0, -1.0) if "smallest" in kind else (-1.0, 2.0)
    stress = values[0] * np.outer(axis, axis) + values[1] * (np.eye(3) - np.outer(axis, axis))
    noise = 1e-12 * np.random.default_rng(0).normal(size=(N, 3, 3))
    field = StressField(stress + noise + noise.swapaxes(1, 2), np.zeros((1, len(MESH.vertices), 3)), (0,), (0.0,), 0.0)
    p = parametrize(MESH, field, fit_frame_field(MESH, field), ParametrizationOptions(follow_stress=follow))
    assert np.abs(np.einsum("tdi,d->ti", p.tangents, axis)).max(1).min() > np.cos(np.deg2rad(3))


def test_one_tet_without_stress_has_a_straight_grid():
    """The map is a rotation."""
    mesh = TetMesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), np.array([[0, 1, 2, 3]]))
    field = StressField(np.zeros((1, 3, 3)), np.zeros((1, 4, 3)), (0,), (0.0,), 0.0)
    p = parametrize(mesh, field, fit_frame_field(mesh, field))
    np.testing.assert_allclose(p.jacobians[0] @ p.jacobians[0].T, np.eye(3), atol=1e-3)
