import numpy as np
import pytest
from frames import STEEL, cube_frame, frame, loading

from michell_cad.errors import InvalidInputError
from michell_cad.rotations import rotation_matrix
from michell_cad.strength import build_beam_model, solve_beams
from michell_cad.strength.frame_buckling import frame_buckling

E, L, R = STEEL.youngs_modulus, 400.0, 2.0
EI = E * np.pi * R**4 / 4
PINNED = {0: (0, 1, 2, 3), 1: (1, 2)}
CLAMPED = {0: range(6), 1: (1, 2, 3, 4, 5)}
GUIDED = {0: range(6), 1: (3, 4, 5)}
PROPPED = {0: range(6), 1: (1, 2)}
FREE = {0: range(6)}


def column(held, axial=-1.0, pieces=16, Q=None, count=1):
    Q = np.eye(3) if Q is None else Q
    sized = frame(np.array([[0, 0, 0], [L, 0, 0]]) @ Q.T, [(0, 1)], R)
    model = build_beam_model(sized, STEEL, pieces=pieces, shear_coefficient=np.inf)
    load = loading(2, {n: tuple(d) for n, d in held.items()}, {1: (*(axial * Q[:, 0]), 0, 0, 0)})
    return frame_buckling(solve_beams(model, load), load, count=count)


@pytest.mark.parametrize(
    ("held", "length"),
    [(PINNED, 1.0), (CLAMPED, 0.5), (GUIDED, 1.0), (FREE, 2.0), (PROPPED, np.pi / 4.493409457909064)],
)
def test_euler_columns(held, length):
    """pi^2 E I / (k L)^2; for the propped column tan x = x at x = 4.4934."""
    factors, _ = column(held)
    np.testing.assert_allclose(factors, np.pi**2 * EI / (length * L) ** 2, rtol=1e-4)


def test_higher_modes_and_convergence():
    factors, modes = column(PINNED, count=4)
    np.testing.assert_allclose(factors, np.pi**2 * EI / L**2 * np.array([1, 1, 4, 4]), rtol=1e-3)
    assert np.abs(modes[:, :, :3]).max() == pytest.approx(1)
    euler = np.pi**2 * EI / L**2
    coarse, fine = (column(PINNED, pieces=n)[0][0] / euler - 1 for n in (2, 4))
    assert 12 < coarse / fine < 20  # fourth order
    assert fine > 0


def test_tension_does_not_buckle_and_a_turned_frame_does_alike():
    assert len(column(PINNED, axial=1.0)[0]) == 0
    Q = rotation_matrix(np.array([[0.4, -1.1, 0.7]]))[0]
    np.testing.assert_allclose(column(FREE, Q=Q)[0], column(FREE)[0], rtol=1e-6)


def test_a_portal_sways():
    """Clamped columns under P each, with a beam of the same section and length between their heads.

    Sway mode by slope deflection: k h / tan(k h) = -6 (I_b / b) / (I_c / h) (Timoshenko and Gere, Section 2.5).
    """
    h = 400.0
    sized = frame([[0, 0, 0], [0, 0, h], [h, 0, h], [h, 0, 0]], [(0, 1), (1, 2), (2, 3)], R)
    out = (1, 3, 5)  # stays in its plane
    load = loading(4, {0: range(6), 1: out, 2: out, 3: range(6)}, {n: (0, 0, -1.0, 0, 0, 0) for n in (1, 2)})
    model = build_beam_model(sized, STEEL, pieces=6, shear_coefficient=np.inf)
    from scipy.optimize import brentq

    x = brentq(lambda x: x / np.tan(x) + 6, np.pi / 2 + 1e-6, np.pi - 1e-6)
    factors, modes = frame_buckling(solve_beams(model, load), load)
    assert factors[0] == pytest.approx(x**2 * EI / h**2, rel=1e-3)
    np.testing.assert_allclose(modes[0, 1, 0], modes[0, 2, 0], rtol=1e-3)


def test_factors_scale_with_the_load_and_refuse_nonsense():
    one = loading(8, range(4), {6: (10, 20, -30, 0, 0, 0)})
    ten = loading(8, range(4), {6: (100, 200, -300, 0, 0, 0)})
    model = build_beam_model(cube_frame(), STEEL, pieces=2)
    a, b = (frame_buckling(solve_beams(model, load), load)[0] for load in (one, ten))
    np.testing.assert_allclose(a, 10 * b, rtol=1e-6)
    with pytest.raises(InvalidInputError, match="count must lie between 1"):
        frame_buckling(solve_beams(model, one), one, count=0)
