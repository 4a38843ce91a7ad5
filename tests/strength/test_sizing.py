from dataclasses import replace

import numpy as np
import pytest
from frames import STEEL, cube_frame, frame, loading

from michell_cad.errors import ConvergenceError, InvalidInputError
from michell_cad.strength import SizingOptions, build_beam_model, size_members, solve_beams

FINE = SizingOptions(tolerance=1e-9, smallest_radius=1e-4, largest_radius=10.0)


def areas_of(sized) -> np.ndarray:
    return np.pi * sized.radii[:, 0] ** 2


def stepped_bar():
    """Four bars in a line with different lengths and axial forces 5, 4, 2, -1, and nothing else."""
    sized = frame(np.cumsum([0, 10, 30, 20, 40])[:, None] * np.eye(3)[[0]], [(0, 1), (1, 2), (2, 3), (3, 4)])
    case = {node: (force, 0, 0, 0, 0, 0) for node, force in zip((1, 2, 3, 4), (1, 2, 3, -1), strict=True)}
    return sized.truss, loading(5, [0], case), np.array([5.0, 4, 2, 1])


@pytest.mark.parametrize("criterion", ["compliance", "stress"])
def test_known_optimum_of_a_stepped_bar(criterion):
    """Least sum of N^2 L / (E A) at sum A L = V: A proportional to |N|, C = (sum |N| L)^2 / (E V); one stress."""
    truss, load, N = stepped_bar()
    sized, report = size_members(truss, STEEL, load, 50.0, replace(FINE, criterion=criterion))
    np.testing.assert_allclose(areas_of(sized), N * 50 / (N @ truss.lengths), rtol=1e-8)
    assert report.compliances[-1] == pytest.approx((N @ truss.lengths) ** 2 / (210000 * 50), rel=1e-9)


def test_known_optimum_of_a_determinate_truss():
    """A slender triangle on two supports: members forces by the method of joints, bending below (r / L)^2."""
    nodes = [[0, 0, 0], [1000, 0, 0], [300, 0, 400]]
    sized = frame(nodes, [(0, 1), (1, 2), (0, 2)])
    load = loading(3, {0: (0, 1, 2, 3, 5), 1: (1, 2, 3, 5), 2: (1, 3, 5)}, {2: (0, 0, -1000, 0, 0, 0)})
    sized, _ = size_members(sized.truss, STEEL, load, 2000.0, FINE)
    left, right = 500 / 400 * 700, np.hypot(700, 400) / 400 * 300
    N = np.array([300 / 500 * left, left, right])[np.lexsort(np.array([(0, 1), (0, 2), (1, 2)]).T[::-1])]
    expected = dict(zip([(0, 1), (0, 2), (1, 2)], N, strict=True))
    forces = np.array([expected[tuple(member)] for member in sized.truss.members.tolist()])
    np.testing.assert_allclose(areas_of(sized) / forces, (areas_of(sized) / forces)[0], rtol=1e-4)


@pytest.mark.parametrize("criterion", ["compliance", "stress"])
def test_volume_is_kept_and_bounds_hold(criterion):
    truss = cube_frame().truss
    load = loading(8, range(4), {6: (10, 20, -30, 0, 0, 0)}, {5: (0, 0, 5, 0, 0, 0)})
    options = SizingOptions(criterion, 0.08, 0.14)
    sized, report = size_members(truss, STEEL, load, 0.9, options)
    assert build_beam_model(sized, STEEL).volume == pytest.approx(0.9, rel=1e-12)
    assert sized.radii.min() == pytest.approx(0.08, rel=1e-12)
    assert sized.radii.max() == pytest.approx(0.14, rel=1e-12)
    again, _ = size_members(truss, STEEL, load, 0.9, options)
    np.testing.assert_array_equal(again.radii, sized.radii)
    solution = solve_beams(build_beam_model(sized, STEEL), load)
    assert report.compliances[-1] == pytest.approx(solution.compliances.sum(), rel=1e-12)


def test_the_optimum_of_a_frame_is_stationary():
    """Moving a little volume between two members changes the compliance in second order only."""
    truss = cube_frame().truss
    load = loading(8, range(4), {6: (10, 20, -30, 0, 0, 0)})
    sized, report = size_members(truss, STEEL, load, 0.9, SizingOptions("compliance", 0.02, 0.4, tolerance=1e-8))
    assert report.compliances[-1] < 0.7 * report.compliances[0]
    free = np.flatnonzero((sized.radii[:, 0] > 0.021) & (sized.radii[:, 0] < 0.39))
    assert len(free) >= 4

    def compliance(share: float, a: int, b: int) -> float:
        volumes = areas_of(sized) * truss.lengths
        volumes[[a, b]] += share * volumes[a] * np.array([1, -1])
        radii = np.repeat(np.sqrt(volumes / truss.lengths / np.pi)[:, None], 3, axis=1)
        return solve_beams(build_beam_model(replace(sized, radii=radii), STEEL), load).compliances[0]

    for a, b in zip(free[:-1].tolist(), free[1:].tolist(), strict=True):
        slope = (compliance(1e-4, a, b) - compliance(-1e-4, a, b)) / 2e-4
        assert abs(slope) < 1e-5 * report.compliances[-1]


def test_weights_of_load_cases_decide():
    """Two cantilevers, each loaded by one case: e2 + 2 e4 per volume is one where the weighted energies are."""
    sized = frame([[0, 0, 0], [10, 0, 0], [0, 5, 0], [10, 5, 0]], [(0, 1), (2, 3)])
    load = loading(4, [0, 2], {1: (1, 0, 0, 0, 0, 0)}, {3: (1, 0, 0, 0, 0, 0)})
    load = replace(load, weights=np.array([1.0, 4.0]))
    sized, _ = size_members(sized.truss, STEEL, load, 30.0, FINE)
    np.testing.assert_allclose(areas_of(sized), [1.0, 2.0], rtol=1e-8)


def test_refusals():
    truss, load, _ = stepped_bar()
    with pytest.raises(InvalidInputError, match=r"volume must be positive, in mm\^3, found -1"):
        size_members(truss, STEEL, load, -1.0)
    with pytest.raises(InvalidInputError, match=r"needs a mean radius of 0.3989 mm, but members may have 1 to 2 mm"):
        size_members(truss, STEEL, load, 50.0, SizingOptions(smallest_radius=1.0, largest_radius=2.0))
    for wrong in ({"tolerance": 0.0}, {"steps": 0}, {"smallest_radius": -1.0}, {"largest_radius": np.inf}):
        with pytest.raises(InvalidInputError, match=f"{next(iter(wrong))} must"):
            SizingOptions(**wrong)
    with pytest.raises(ConvergenceError, match="after 1 steps"):
        size_members(truss, STEEL, load, 50.0, replace(FINE, steps=1))
    sized, report = size_members(truss, STEEL, load, 50.0, replace(FINE, steps=1), strict=False)
    assert not report.converged
    assert areas_of(sized) @ truss.lengths == pytest.approx(50.0, rel=1e-12)
