import numpy as np
import pytest
from frames import cube_frame, frame, loading

from michell_cad.strength.pin_joints import equilibrium_matrix, pin_joint_residual


def test_forces_of_a_triangle_by_the_method_of_joints():
    truss = frame([[0, 0, 0], [6, 0, 0], [3, 0, 4]], [(0, 1), (0, 2), (1, 2)]).truss
    # 8 N down on the top: each leg carries 4 N / sin, 5 N in compression, the bar 3 N in tension.
    forces = {(0, 1): 3.0, (0, 2): -5.0, (1, 2): -5.0}
    q = np.array([forces[tuple(member)] for member in truss.members.tolist()])
    held_up = (equilibrium_matrix(truss.nodes, truss.members) @ q).reshape(-1, 3)
    np.testing.assert_allclose(held_up, [[0, 0, 4], [0, 0, 4], [0, 0, -8]], atol=1e-14)
    load = loading(3, {0: (0, 1, 2), 1: (1, 2), 2: (1,)}, {2: (0, 0, -8, 0, 0, 0)})
    assert pin_joint_residual(truss, load)[0] < 1e-5


def test_what_pins_cannot_carry():
    """A square without a diagonal under shear: half of a force on one corner squeezes the bar, half shears."""
    truss = frame([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], [(0, 1), (1, 2), (2, 3), (3, 0)]).truss
    held = {0: (0, 1, 2), 1: (0, 1, 2), 2: (1,), 3: (1,)}
    load = loading(4, held, {2: (1, 0, 0, 0, 0, 0)}, {2: (0, 0, 1, 0, 0, 0)})
    np.testing.assert_allclose(pin_joint_residual(truss, load), [np.sqrt(0.5), 0], atol=1e-5)


def test_it_does_not_depend_on_the_size_of_load_and_truss():
    one = loading(8, range(4), {6: (10, 20, -30, 0, 0, 0)})
    other = loading(8, range(4), {6: (1e6, 2e6, -3e6, 0, 0, 0)})
    truss = cube_frame().truss
    large = frame(1e3 * truss.nodes, truss.members).truss
    assert pin_joint_residual(truss, one)[0] == pytest.approx(pin_joint_residual(large, other)[0], rel=1e-9)
    assert 0.1 < pin_joint_residual(truss, one)[0] < 1
