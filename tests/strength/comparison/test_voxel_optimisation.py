"""The stiffest densities: bounds that hold, closed forms, and sensitivities by differences."""

from dataclasses import replace

import numpy as np
import pytest
from shapes import ABS, cantilever, tension_bar

from michell_cad.errors import ConvergenceError, InvalidInputError
from michell_cad.problem import DesignProblem, LoadCase
from michell_cad.strength.comparison import (
    Candidate,
    VoxelOptions,
    compare_trusses,
    optimise_voxels,
    regular_grid,
    voxel_rows,
)
from michell_cad.strength.comparison.rivals import equal_members
from michell_cad.strength.comparison.voxel_model import build_voxel_model
from michell_cad.strength.comparison.voxel_optimisation import (
    compliance_bound,
    full_or_empty,
    moduli,
    sensitivity,
    stiffest_sheet,
    update_density,
)
from michell_cad.strength.comparison.voxel_stiffness import VoxelStiffness

PROBLEM = cantilever((16, 8, 8))
SHARE = 0.15


@pytest.fixture(scope="module")
def stiffness():
    return VoxelStiffness(build_voxel_model(PROBLEM, 128), ABS)


@pytest.mark.parametrize("p", [1.0, 3.0])
def test_sensitivity_by_differences(stiffness, p):
    rng = np.random.default_rng(4)
    density = rng.uniform(0.1, 0.9, 128)
    compliance, gain = sensitivity(stiffness, density, p)
    assert (gain > 0).all()
    h = 1e-5
    for e in rng.choice(128, 5, replace=False):
        step = h * (np.arange(128) == e)
        ahead, behind = (sensitivity(stiffness, density + sign * step, p)[0] for sign in (1, -1))
        assert -gain[e] == pytest.approx((ahead - behind) / (2 * h), rel=1e-5, abs=1e-8 * compliance)


def test_all_full_is_the_plain_part(stiffness):
    sheet = stiffest_sheet(stiffness, 1.0, 1e-6, 1)
    assert (sheet.density == 1).all()
    assert sheet.compliance == pytest.approx(stiffness.work(stiffness.solve(np.ones(128))))
    assert sheet.bound == pytest.approx(sheet.compliance)
    by_points = compliance_bound(sheet.compliance, stiffness.point_energies(sheet.displacements), 1.0)
    assert by_points == pytest.approx(sheet.compliance)


def test_a_bar_in_tension_is_bound_by_its_volume():
    """No structure of volume V carries F over the length L with less than F^2 L^2 / (E V), since every section has to
    carry F: with the whole load on one corner the densities of the sheet come near it, and never below."""
    problem = tension_bar()
    mesh = problem.mesh
    force = np.where((mesh.vertices == [80, 0, 0]).all(1)[:, None], [[50.0, 0, 0]], 0.0)
    model = build_voxel_model(DesignProblem(mesh, ABS, problem.fixed, (LoadCase("corner", force),)), 16)
    material = replace(ABS, poisson_ratio=0.0)
    stiffness = VoxelStiffness(model, material)
    _, _, compliance, bound = stiffest_sheet(stiffness, 0.2, 0.01, 200)
    exact = 50.0**2 * 80**2 / (ABS.youngs_modulus * 0.2 * model.volume)
    assert bound <= compliance
    assert exact * 0.99 <= compliance
    even = stiffness.work(stiffness.solve(moduli(np.full(len(model.corners), 0.2), 1.0)))
    assert compliance < even


def test_the_bound_holds_for_all_densities_from_any_displacements(stiffness):
    """From every displacement a bound below every compliance: 20 random densities against 20 others."""
    rng = np.random.default_rng(5)
    compliances, bounds = [], []
    for _ in range(20):
        density = update_density(np.full(128, SHARE), rng.uniform(0.1, 10, 128), SHARE, 1.0, 1.0)
        assert density.mean() == pytest.approx(SHARE, rel=1e-9)
        u = stiffness.solve(moduli(density, 1.0))
        compliances.append(stiffness.work(u))
        bounds.append(compliance_bound(stiffness.work(u), stiffness.energies(u), SHARE))
    assert max(bounds) < min(compliances)
    _, _, best, bound = stiffest_sheet(stiffness, SHARE, 0.01, 200)
    assert max(bounds) <= best < min(compliances)
    assert 0.99 * best <= bound <= best


def test_bound_by_hand():
    """Energies 4, 3, 2, 1 and a mean of 3/8, one and a half voxels: M = 4 + 3/2; F = 11 gives 121 / 5.5."""
    assert compliance_bound(11.0, np.array([1.0, 4.0, 2.0, 3.0]), 3 / 8) == pytest.approx(22.0)
    assert compliance_bound(10.0, np.array([1.0, 4.0, 2.0, 3.0]), 1.0) == pytest.approx(10.0)


def test_full_or_empty_is_above_the_bound_and_nearly_so(stiffness):
    sheet = stiffest_sheet(stiffness, SHARE, 0.01, 200)
    density, found = full_or_empty(stiffness, sheet.density, SHARE)
    assert sheet.bound <= sheet.compliance < found
    assert density.mean() == pytest.approx(SHARE, rel=1e-6)
    assert found == pytest.approx(sensitivity(stiffness, density, 3.0)[0])
    assert found < 0.5 * sensitivity(stiffness, sheet.density, 3.0)[0]
    assert (density * (1 - density)).sum() < 0.75 * (sheet.density * (1 - sheet.density)).sum()


def test_finer_voxels_close_the_bracket():
    """Finer voxels place material better, and their displacements prove more: both ends converge."""
    found = []
    for count in (16, 128, 1024):
        stiffness = VoxelStiffness(build_voxel_model(PROBLEM, count), ABS)
        sheet = stiffest_sheet(stiffness, SHARE, 0.005, 300)
        bound = compliance_bound(sheet.compliance, stiffness.point_energies(sheet.displacements), SHARE)
        found.append((bound, sheet.compliance))
    (low, high), (low2, high2), (low4, high4) = found
    assert low < low2 < low4 < high4 < high2 < high
    assert high4 - low4 < 0.6 * (high2 - low2) < 0.5 * (high - low)
    assert abs(high4 - high2) < 0.8 * abs(high2 - high)


def test_no_truss_of_as_much_material_is_stiffer():
    volume = SHARE * PROBLEM.mesh.volumes.sum()
    design = optimise_voxels(PROBLEM, volume, VoxelOptions(count=432))
    rows = voxel_rows(PROBLEM, design, volume)
    trusses = [
        regular_grid(PROBLEM.mesh, (4, 2, 2), diagonals="zigzag"),
        regular_grid(PROBLEM.mesh, (2, 1, 1), diagonals="parallel"),
    ]
    candidates = [Candidate("grid", equal_members(PROBLEM, truss)) for truss in trusses]
    for row in compare_trusses(PROBLEM, candidates, volume):
        # Densities within voxels may change: that costs the bound more than the gap of those that may not.
        assert rows[0].compliance < 0.9 * design.sheet_compliance
        assert design.sheet_compliance < row.compliance
        assert rows[0].mass_g == pytest.approx(row.mass_g)
    assert rows[0].compliance < rows[1].compliance < rows[2].compliance
    assert rows[0].yield_factor is rows[0].member_buckling is rows[0].members is None
    assert 0 < design.grey < 4


def test_several_cases_cost_more_than_each():
    (case,) = PROBLEM.load_cases
    side = LoadCase("side", case.force[:, [0, 2, 1]])
    one = optimise_sheet_of(PROBLEM)
    both = optimise_sheet_of(replace(PROBLEM, load_cases=(case, side), combination="envelope"))
    # The part is as wide as high: alone the cases would cost the same.
    assert 2.05 * one < both < 4 * one


def optimise_sheet_of(problem):
    return stiffest_sheet(VoxelStiffness(build_voxel_model(problem, 128), ABS), SHARE, 0.005, 300).compliance


def test_refusals(stiffness):
    with pytest.raises(
        InvalidInputError, match=r"at most that of the voxels, 1.28e\+05 mm3, found 1.29e\+05 mm3: a vol"
    ):
        optimise_voxels(PROBLEM, 129000.0, VoxelOptions(count=128))
    with pytest.raises(InvalidInputError, match="volume of the material must be positive"):
        optimise_voxels(PROBLEM, 0.0, VoxelOptions(count=128))
    with pytest.raises(InvalidInputError, match="number of voxels must be at least 1, found 0"):
        VoxelOptions(count=0)
    with pytest.raises(InvalidInputError, match="gap must lie between 0 and 1, found 1"):
        VoxelOptions(gap=1.0)
    with pytest.raises(ConvergenceError, match=r"below the best densities after 2 steps, wanted 0.1%: allow more"):
        stiffest_sheet(stiffness, SHARE, 1e-3, 2)
