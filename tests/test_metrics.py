import numpy as np
import pytest
from shapes import box_mesh

from michell_cad.metrics import (
    distinct_directions,
    misalignment,
    name_families,
    octahedral_group,
    shear_residual,
    uncarried_stress,
)
from michell_cad.rotations import rotation_matrix

MESH = box_mesh((2, 2, 2))
N = len(MESH.tets)


def everywhere(matrix: np.ndarray) -> np.ndarray:
    return np.broadcast_to(matrix, (N, 3, 3))


def about_z(angle: float) -> np.ndarray:
    return rotation_matrix(np.array([0.0, 0.0, angle]))


def test_shear_residual_of_a_turned_frame_by_hand():
    """For diag(1, -1, 0) turned by t the shear is sin 2t of the deviator, whose two entries have the norm sqrt 2."""
    stress = everywhere(np.diag([1.0, -1.0, 0.0]))
    for t in (0.0, 0.2, np.pi / 4):
        assert shear_residual(MESH, stress, everywhere(about_z(t))) == pytest.approx(np.sin(2 * t), abs=1e-12)


def test_pressure_is_no_shear():
    stress = everywhere(np.diag([1.0, -1.0, 0.0]) + 7 * np.eye(3))
    oblique = np.eye(3)
    oblique[:, 1] = [0.6, 0.8, 0.0]
    without = shear_residual(MESH, everywhere(np.diag([1.0, -1.0, 0.0])), everywhere(oblique))
    assert shear_residual(MESH, stress, everywhere(oblique)) == pytest.approx(without)
    assert shear_residual(MESH, everywhere(-3 * np.eye(3)), everywhere(oblique)) == 0


def test_uncarried_stress_by_hand():
    """Bars along the axes carry the diagonal and nothing of a shear; oblique bars carry what they span."""
    axes = everywhere(np.eye(3))
    assert uncarried_stress(MESH, everywhere(np.diag([3.0, -1.0, 2.0])), axes) == pytest.approx(0, abs=1e-12)
    shear = np.zeros((3, 3))
    shear[0, 1] = shear[1, 0] = 2.0
    assert uncarried_stress(MESH, everywhere(shear), axes) == pytest.approx(1)
    mixed = shear + np.diag([1.0, 2.0, 2.0])
    assert uncarried_stress(MESH, everywhere(mixed), axes) == pytest.approx(np.sqrt(8 / 17))
    B = np.array([[1.0, 0.6, 0.0], [0.0, 0.8, 0.0], [0.0, 0.0, 1.0]])
    spanned = 2 * np.outer(B[:, 0], B[:, 0]) - 3 * np.outer(B[:, 1], B[:, 1])
    assert uncarried_stress(MESH, everywhere(spanned), everywhere(B)) == pytest.approx(0, abs=1e-12)


def test_misalignment_knows_the_octahedral_symmetries():
    group = octahedral_group()
    assert len(group) == 24
    np.testing.assert_allclose(np.linalg.det(group), 1)
    Q = rotation_matrix(np.array([0.3, 1.0, -0.5]))
    stress = everywhere(Q @ np.diag([5.0, 1.0, -2.0]) @ Q.T)
    for O in group[::5]:
        np.testing.assert_allclose(misalignment(stress, everywhere(Q @ O)), 0, atol=1e-5)
        np.testing.assert_allclose(misalignment(stress, everywhere(Q @ O @ about_z(0.1))), np.degrees(0.1), atol=1e-5)


def test_distinct_directions():
    assert distinct_directions(everywhere(np.diag([3.0, 1.0, -1.0]))).all()
    assert not distinct_directions(everywhere(np.diag([3.0, 1.0, 1.01]))).any()


def test_families_are_named_by_their_mean_axial_stress():
    assert name_families(MESH, everywhere(np.diag([1.0, -4.0, 9.0])), everywhere(np.eye(3))) == (
        "third",
        "compression",
        "tension",
    )
    assert sorted(name_families(MESH, everywhere(np.zeros((3, 3))), everywhere(np.eye(3)))) == [
        "compression",
        "tension",
        "third",
    ]
