import numpy as np
import pytest
from frames import STEEL, frame, in_proportion, loading, tower

from michell_cad.strength import beam_model
from michell_cad.strength.beam_solver import factorise_beams, solve_system
from michell_cad.strength.member_buckling import critical_force_slopes, critical_forces
from michell_cad.strength.stress_norm import failure_norm
from michell_cad.strength.thick_nodes import ThickNodes


def tower_case():
    sized = tower()
    load = loading(12, range(3), {9: (3, 5, -40, 1, 2, 0)}, {11: (-10, 0, 4, 0, 0, 7)})
    return sized, load


def norm_of(nodes, radii, load, power, buckling):
    model = nodes.with_balls(radii)
    system = factorise_beams(model, load.held)
    columns = nodes.members(radii)
    norm = failure_norm(system, solve_system(system, load), power, critical_forces(columns) if buckling else None)
    by_area = nodes.gradient(model, radii, norm.by_section)
    if buckling:
        slopes = critical_force_slopes(columns)
        by_area = by_area + nodes.gradient(columns, radii, norm.by_column[:, None] * slopes)
    return norm, by_area


def test_a_bar_by_hand():
    """One bar in tension: every section has s = N / (A sigma), so J = s for any power, and dJ / d log A = -s."""
    sized = frame([[0, 0, 0], [0, 30, 0]], [(0, 1)], 2.0)
    load = loading(2, [0], {1: (0, 500, 0, 0, 0, 0)})
    nodes = ThickNodes(sized.truss, STEEL, True)
    norm, by_area = norm_of(nodes, sized.radii, load, 7.0, True)
    s = 500 / (np.pi * 4) / 235
    assert norm.value == pytest.approx(s, rel=1e-12)
    assert norm.largest == pytest.approx(s, rel=1e-12)
    assert by_area.sum() == pytest.approx(-s, rel=1e-9)
    pushed = loading(2, [0], {1: (0, -500, 0, 0, 0, 0)})
    norm, by_area = norm_of(nodes, sized.radii, pushed, 7.0, True)
    # Euler's column of length 30 and radius 2 holds more than it yields at: both are in the norm.
    b = 500 / (np.pi**3 * 210000 * 16 / 4 / 900)
    assert norm.value == pytest.approx((s**7 + b**7) ** (1 / 7), rel=1e-9)
    assert by_area.sum() == pytest.approx(-(s**7 + 2 * b**7) * norm.value**-6, rel=1e-9)


def test_the_norm_tends_to_the_largest_index():
    sized, load = tower_case()
    nodes = ThickNodes(sized.truss, STEEL, True)
    solution = solve_system(factorise_beams(nodes.members(sized.radii), load.held), load)
    largest = solution.von_mises.max() / 235
    values = [norm_of(nodes, sized.radii, load, power, False)[0] for power in (4.0, 16.0, 64.0, 1024.0)]
    assert all(norm.largest == pytest.approx(largest, rel=1e-12) for norm in values)
    errors = [abs(norm.value / largest - 1) for norm in values]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 0.01


@pytest.mark.parametrize(("ratio", "sections", "error"), [(0.0, 9, 2e-6), (1.6, 9, 3e-2), (1.6, 65, 1e-3)])
@pytest.mark.parametrize("buckling", [False, True])
def test_derivatives_by_differences(monkeypatch, ratio, sections, error, buckling):
    """Tapered members, with and without balls: central differences of J by all three areas of several members.

    Derivatives are those of the integral, as for members without taper. That of the rule for it is another, since s^8
    is steep near the rims of balls: the more sections there, the less.
    """
    monkeypatch.setattr(beam_model, "JOINT_SECTIONS", sections)
    sized, load = tower_case()
    rng = np.random.default_rng(3)
    radii = sized.radii * rng.uniform(0.8, 1.2, sized.radii.shape)
    nodes = ThickNodes(sized.truss, STEEL, True, in_proportion(sized.truss.members, np.full(12, ratio)))
    _, by_area = norm_of(nodes, radii, load, 8.0, buckling)
    scale = np.abs(by_area).max()
    for member in range(0, len(radii), 3):
        for place in range(3):
            sides = []
            for step in (1e-6, -1e-6):
                moved = radii.copy()
                moved[member, place] *= np.exp(step / 2)
                sides.append(norm_of(nodes, moved, load, 8.0, buckling)[0].value)
            assert by_area[member, place] == pytest.approx((sides[0] - sides[1]) / 2e-6, abs=error * scale)
