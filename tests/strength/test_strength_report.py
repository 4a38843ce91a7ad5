import json
from dataclasses import replace

import numpy as np
import pytest
from frames import frame
from shapes import ABS, cantilever

from michell_cad.elasticity import solve_elasticity
from michell_cad.metrics import rms_shear, shear_residual
from michell_cad.parametrization import Parametrization
from michell_cad.strength import measure_strength, strength_block
from michell_cad.strength.strength_report import solid_compliance

PROBLEM = cantilever((4, 2, 2), load=-10.0)
FIELD = solve_elasticity(PROBLEM)
GRID = Parametrization(PROBLEM.mesh, PROBLEM.mesh.vertices)
ARM = [[0, 20, 20], [80, 20, 20]]
R, L = 3.0, 80.0


def test_a_single_arm_by_hand():
    report, notes = measure_strength(PROBLEM, FIELD, GRID, frame(ARM, [(0, 1)], R))
    bending = 10 * L / (np.pi * R**3 / 4)
    assert report.peak_stress_mpa == pytest.approx(bending, rel=1e-9)
    np.testing.assert_allclose(report.peak_stress.at_mm, ARM[0])
    assert report.peak_stress.case == "end"
    assert report.yield_factor == pytest.approx(48 / bending, rel=1e-9)
    assert report.first_yield_n == pytest.approx(480 / bending, rel=1e-9)
    assert report.first_yield_nmm is None
    assert report.buckling_factor is None
    assert report.displacement_mm == pytest.approx(10 * L**3 / (3 * ABS.youngs_modulus * np.pi * R**4 / 4), rel=0.01)
    np.testing.assert_allclose(report.displacement_at_mm, ARM[1])
    assert report.compliance_nmm == pytest.approx(10 * report.displacement_mm, rel=1e-9)
    assert report.compliance_over_solid == pytest.approx(report.compliance_nmm / solid_compliance(PROBLEM, FIELD))
    assert report.mass_share == pytest.approx(np.pi * R**2 / 1600, rel=1e-9)
    assert report.solid_mass_g == pytest.approx(80 * 40 * 40 * ABS.density, rel=1e-9)
    assert report.pin_joint_residual == pytest.approx(1, abs=1e-4)
    assert any("yields at" in note for note in notes) == (report.yield_factor < 1)


def test_twice_the_load_halves_the_factors_and_a_volume_sets_the_mass():
    strut = frame([[0, 20, 20], [80, 20, 20], [0, 20, 0]], [(0, 1), (1, 2)], R)
    one, _ = measure_strength(PROBLEM, FIELD, GRID, strut)
    double = replace(PROBLEM, load_cases=(replace(PROBLEM.load_cases[0], force=2 * PROBLEM.load_cases[0].force),))
    other, _ = measure_strength(double, FIELD, GRID, strut, volume=1000.0)
    assert one.buckling_factor == pytest.approx(2 * other.buckling_factor, rel=1e-9)
    assert one.yield_factor == pytest.approx(2 * other.yield_factor, rel=1e-9)
    assert one.first_yield_n == pytest.approx(other.first_yield_n, rel=1e-9)
    assert one.buckling.curve == strut.truss.curves[strut.truss.curve_of_member[1]].name
    assert other.mass_g == pytest.approx(1.04)


def test_balls_at_the_nodes_stiffen_members_and_leave_their_buckling():
    strut = frame([[0, 20, 20], [80, 20, 20], [0, 20, 0]], [(0, 1), (1, 2)], R)
    plain, _ = measure_strength(PROBLEM, FIELD, GRID, strut)
    balls, _ = measure_strength(PROBLEM, FIELD, GRID, strut, joints=np.full(3, 1.8 * R))
    assert 0.8 * plain.compliance_nmm < balls.compliance_nmm < 0.98 * plain.compliance_nmm
    assert balls.buckling_factor == pytest.approx(plain.buckling_factor, rel=0.02)
    assert balls.mass_g == pytest.approx(plain.mass_g)


def test_a_loose_part_is_left_out_and_named():
    loose = frame([*ARM, [40, 5, 5], [50, 5, 5]], [(0, 1), (2, 3)], R)
    report, notes = measure_strength(PROBLEM, FIELD, GRID, loose)
    alone, _ = measure_strength(PROBLEM, FIELD, GRID, frame(ARM, [(0, 1)], R))
    assert report.peak_stress_mpa == pytest.approx(alone.peak_stress_mpa, rel=1e-12)
    assert any("a loose part carries nothing: feature (*, *, *) #1, 1 member around (45, 5, 5) mm" in n for n in notes)


def test_a_truss_that_hangs_on_nothing_is_said_and_fails_nothing(monkeypatch):
    nothing = replace(PROBLEM, fixed=PROBLEM.fixed)
    monkeypatch.setattr("michell_cad.strength.mechanism.held_nodes", lambda problem, truss: np.zeros((2, 6), bool))
    block, notes = strength_block(nothing, FIELD, GRID, frame(ARM, [(0, 1)], R))
    assert block is None
    assert notes[-1].startswith("no strength report: no part of the truss is supported: feature (*, *, *) #0")


def test_the_block_is_plain_json_and_warns_of_shear():
    block, notes = strength_block(PROBLEM, FIELD, GRID, frame(ARM, [(0, 1)], R))
    assert json.loads(json.dumps(block, allow_nan=False))["peak_stress"]["case"] == "end"
    assert block["rms_frame_shear"] > 0.12
    assert any("by bending; above 0.12" in note for note in notes)


def test_rms_shear_of_uniform_stress():
    """Pure shear in the frame of the axes: all of it; at 45 degrees: none; half the part each: the root of a half."""
    mesh = PROBLEM.mesh
    stress = np.zeros((len(mesh.tets), 3, 3))
    stress[:, 0, 1] = stress[:, 1, 0] = 3.0
    axes = np.broadcast_to(np.eye(3), stress.shape)
    c = np.sqrt(0.5)
    diagonal = np.broadcast_to(np.array([[c, -c, 0], [c, c, 0], [0, 0, 1]]), stress.shape)
    assert rms_shear(mesh, stress, axes) == pytest.approx(1)
    assert rms_shear(mesh, stress, diagonal) == pytest.approx(0, abs=1e-12)
    left = (mesh.centroids[:, 0] < 40)[:, None, None]
    assert rms_shear(mesh, stress, np.where(left, axes, diagonal)) == pytest.approx(c)
    assert shear_residual(mesh, stress, np.where(left, axes, diagonal)) == pytest.approx(0.5)
