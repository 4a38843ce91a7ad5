import numpy as np
import pytest
import scipy.linalg
from frames import STEEL, frame, loading

from michell_cad.strength import build_beam_model, solve_beams
from michell_cad.strength.member_buckling import critical_forces, member_buckling_factors
from michell_cad.truss import member_radius

E, L, R = STEEL.youngs_modulus, 50.0, 2.0
BAR = [[0, 0, 0], [L, 0, 0]]


@pytest.mark.parametrize(("straight", "pieces"), [(True, 1), (True, 3), (False, 1)])
def test_prismatic_columns_buckle_at_eulers_force(straight, pieces):
    model = build_beam_model(frame(BAR, [(0, 1)], R), STEEL, straight, pieces)
    np.testing.assert_allclose(critical_forces(model), np.pi**3 * E * R**4 / 4 / L**2, rtol=1e-9)


@pytest.mark.parametrize("radii", [(2.0, 2.6, 2.0), (2.0, 1.7, 2.0), (2.0, 2.2, 2.5)])
def test_tapered_columns_by_finite_differences(radii):
    """v'' = -P v / (E I) with pinned ends, and the same for the moment with guided ends (M' = 0 there)."""
    n = 600
    s = (np.arange(n) + 0.5) / n
    EI = E * np.pi * member_radius(np.array(radii), s) ** 4 / 4
    second = (np.diag(-2 * np.ones(n)) + np.diag(np.ones(n - 1), 1) + np.diag(np.ones(n - 1), -1)) * (n / L) ** 2
    guided, pinned = second.copy(), second.copy()
    guided[0, 0] = guided[-1, -1] = -((n / L) ** 2)
    pinned[0, 0] = pinned[-1, -1] = -3 * (n / L) ** 2
    lowest = min(
        scipy.linalg.eigh(-pinned, np.diag(1 / EI), eigvals_only=True)[0],
        scipy.linalg.eigh(-guided, np.diag(1 / EI), eigvals_only=True)[1],
    )
    found = critical_forces(build_beam_model(frame(BAR, [(0, 1)], np.array([radii])), STEEL))[0]
    assert lowest * 0.9999 < found < 1.04 * lowest


def test_only_compression_buckles():
    model = build_beam_model(frame(BAR, [(0, 1)], R), STEEL)
    solution = solve_beams(model, loading(2, [0], {1: (-3.0, 0, 0, 0, 0, 0)}, {1: (5.0, 0, 0, 0, 0, 0)}))
    factors = member_buckling_factors(solution)
    assert factors[0, 0] == pytest.approx(np.pi**3 * E * R**4 / 4 / L**2 / 3, rel=1e-9)
    assert factors[1, 0] == np.inf
