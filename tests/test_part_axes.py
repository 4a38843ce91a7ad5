"""Axes of parts of known symmetry, and that they turn with the part."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from networks import tube_mesh
from scipy.spatial.transform import Rotation
from shapes import box_mesh

from michell_cad.part_axes import NAMINGS, part_axes
from michell_cad.tet_mesh import TetMesh

BOXES = {
    "cube": box_mesh((2, 2, 2)),
    "square bar": box_mesh((4, 2, 2), (2.0, 1.0, 1.0)),
    "slab": box_mesh((3, 3, 1), (2.0, 2.0, 0.5)),
    "box": box_mesh((3, 2, 1), (3.0, 2.0, 1.0)),
    "nearly a cube": box_mesh((2, 2, 2), (1.0, 1.003, 1.001)),
}


def apart(A: np.ndarray, B: np.ndarray) -> float:
    """Largest entry by which two sets of axes differ, whatever they are called."""
    return min(float(np.abs(A @ N - B).max()) for N in NAMINGS)


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(sorted(BOXES)))
def test_axes_of_boxes_are_normal_to_their_sides_however_they_lie(seed: int, name: str) -> None:
    rng = np.random.default_rng(seed)
    mesh = BOXES[name]
    Q = Rotation.random(random_state=seed % 2**31).as_matrix()
    order = rng.permutation(len(mesh.vertices))
    moved = TetMesh(10 * mesh.vertices[order] @ Q.T + rng.normal(size=3), np.argsort(order)[mesh.tets])
    axes = part_axes(moved)
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1)
    assert apart(axes, Q) < 1e-9


def test_they_do_not_depend_on_the_mesh() -> None:
    """A sheared box, meshed coarse and fine: the moments are integrals over the part."""
    coarse, fine = (box_mesh(cells, (3.0, 2.0, 1.0)) for cells in ((1, 1, 1), (4, 3, 2)))
    sheared = [TetMesh(m.vertices + 0.3 * m.vertices[:, [1]] * [1.0, 0, 0], m.tets) for m in (coarse, fine)]
    assert apart(*(part_axes(mesh) for mesh in sheared)) < 1e-9


def test_a_round_part_has_its_axis() -> None:
    axes = part_axes(tube_mesh(12, 1, 2))
    assert np.abs(axes[2]).max() == pytest.approx(1)


def test_namings_are_a_group_of_rotations() -> None:
    assert len(np.unique(NAMINGS.reshape(24, 9), axis=0)) == 24
    np.testing.assert_allclose(np.linalg.det(NAMINGS), 1)
    products = np.einsum("aij,bjk->abik", NAMINGS, NAMINGS).reshape(-1, 9)
    assert len(np.unique(products, axis=0)) == 24
