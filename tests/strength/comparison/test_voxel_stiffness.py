"""Voxels under load, against closed forms and the tets of the part."""

from dataclasses import replace

import numpy as np
import pytest
from shapes import ABS, cantilever, refined, tension_bar

from michell_cad.elasticity import solve_elasticity
from michell_cad.errors import InvalidInputError
from michell_cad.problem import DesignProblem, LoadCase
from michell_cad.strength.comparison import require_voxels
from michell_cad.strength.comparison.voxel_model import build_voxel_model
from michell_cad.strength.comparison.voxel_stiffness import VoxelStiffness, voxel_memory
from michell_cad.strength.strength_report import solid_compliance


def test_a_bar_in_tension():
    """c = F^2 L / (E A), and every voxel has its share of it; half the modulus doubles it."""
    F = 50.0
    model = build_voxel_model(tension_bar(F), 32)
    x, n_e = model.nodes[:, 0], len(model.corners)
    # The consistent forces of the bricks' own faces: a quarter of each to its corners.
    at_end = np.sort(model.corners[model.centres[:, 0] == model.centres[:, 0].max()][:, 4:].ravel())
    force = np.zeros_like(model.forces)
    force[0, :, 0] = np.bincount(at_end, minlength=len(x)) * F / len(at_end)
    assert np.abs(model.forces.sum(1) - force.sum(1)).max() < 1e-12 * F
    stiffness = VoxelStiffness(replace(model, forces=force), ABS)
    u = stiffness.solve(np.ones(n_e))
    exact = F**2 * 80 / (ABS.youngs_modulus * 200)
    assert stiffness.work(u) == pytest.approx(exact, rel=1e-10)
    np.testing.assert_allclose(stiffness.energies(u), exact / n_e, rtol=1e-9)
    np.testing.assert_allclose(u[0, :, 0], x / 80 * exact / F, atol=1e-12)
    np.testing.assert_allclose(u[0, :, 1], -ABS.poisson_ratio * model.nodes[:, 1] * exact / F / 80, atol=1e-12)
    assert stiffness.work(stiffness.solve(np.full(n_e, 0.5))) == pytest.approx(2 * exact, rel=1e-10)


def test_energies_add_up_to_the_work_of_all_cases():
    problem = cantilever((8, 4, 4))
    (case,) = problem.load_cases
    side = LoadCase("side", case.force[:, [1, 2, 0]], 3.0)
    both = DesignProblem(problem.mesh, ABS, problem.fixed, (case, side), "envelope")
    stiffness = VoxelStiffness(build_voxel_model(both, 128), ABS)
    rho = np.random.default_rng(2).uniform(0.1, 1, 128)
    u = stiffness.solve(rho)
    assert rho @ stiffness.energies(u) == pytest.approx(stiffness.work(u), rel=1e-10)
    np.testing.assert_allclose(stiffness.point_energies(u).sum(0), stiffness.energies(u), rtol=1e-9)
    one, other = (stiffness.work(np.where(np.arange(2)[:, None, None] == k, u, 0)) for k in range(2))
    alone = VoxelStiffness(build_voxel_model(problem, 128), ABS)
    assert one == pytest.approx(alone.work(alone.solve(rho)), rel=1e-10)
    assert other > one


def test_tets_and_voxels_come_together():
    """Both are too stiff, and less so when they are refined; trilinear bricks bend far better than linear tets."""
    coarse = cantilever((8, 4, 4))
    fine = refined(coarse)
    exact = 1.02 * _voxels(fine, 8192)
    found = {count: _voxels(coarse if count <= 128 else fine, count) for count in (16, 128, 1024)}
    assert found[16] < found[128] < found[1024] < exact
    tets = solid_compliance(fine, solve_elasticity(fine))
    assert 0.9 * exact < tets < exact


def _voxels(problem, count):
    stiffness = VoxelStiffness(build_voxel_model(problem, count), ABS)
    return stiffness.work(stiffness.solve(np.ones(len(stiffness.model.corners))))


def test_what_does_not_fit_in_memory_is_refused(monkeypatch):
    monkeypatch.setattr("michell_cad.strength.comparison.voxel_stiffness.free_memory", lambda: int(1e9))
    with pytest.raises(
        InvalidInputError, match=r"100,000 voxels would take about \d+\.\d GB of the 1\.0 GB that are free: use at most"
    ) as refusal:
        require_voxels(cantilever((8, 4, 4)), 100_000)
    # The number that it names does fit, and is not far from the largest.
    fits = int(str(refusal.value).rsplit(" ", 1)[1].replace(",", ""))
    assert 0.2e9 < voxel_memory(fits) <= 0.5e9
    require_voxels(cantilever((8, 4, 4)), fits)
