"""The solid of a bar under the loads of its truss: resultants, closed forms, CalculiX."""

import re
import shutil
import subprocess

import numpy as np
import pytest
from frames import STEEL, frame, loading
from quadratic_shapes import capsule

from michell_cad.closed_mesh import ClosedMesh
from michell_cad.errors import ConvergenceError, InvalidInputError
from michell_cad.rotations import rotation_matrix
from michell_cad.strength import build_beam_model, solve_beams
from michell_cad.strength.solid import (
    SolidLoading,
    carry_to_solid,
    mesh_solid,
    solve_solid,
    write_solid_deck,
)
from michell_cad.strength.solid.solid_loading import spread
from michell_cad.strength.solid.solid_mesh import COARSEST

R, L = 1.0, 16.0
TURN = rotation_matrix(np.array([[0.3, -0.7, 0.4]]))[0]
CASES = ({1: (30.0, 0, 0, 0, 0, 0)}, {1: (0, 3.0, 0, 0, 0, 0)}, {1: (0, 0, 0, 9.0, 0, 0)}, {1: (0, 0, 0, 0, 9.0, 0)})


def bar():
    """A round bar with round ends, in an oblique direction, as beam and as solid."""
    sized = frame(np.array([[0, 0, 0], [L, 0, 0]]) @ TURN.T, [(0, 1)], R)
    cases = [{1: np.concatenate([TURN @ f[1][:3], TURN @ f[1][3:]])} for f in CASES]
    load = loading(2, [0], *cases)
    vertices, triangles = capsule(R, L)
    return sized, load, ClosedMesh(vertices @ TURN.T, triangles)


def test_forces_have_the_resultants_of_the_load():
    rng = np.random.default_rng(3)
    points, weights = rng.normal(size=(20, 3)), rng.uniform(0.5, 1, 20)
    at, force, moment = rng.normal(size=3), rng.normal(size=(2, 3)), rng.normal(size=(2, 3))
    f = spread(points, weights / weights.sum(), at, force, moment)
    np.testing.assert_allclose(f.sum(1), force, atol=1e-12)
    np.testing.assert_allclose(np.cross(points - at, f).sum(1), moment, atol=1e-12)


def test_a_bar_pulled_bent_and_twisted():
    """Stresses and curvature of a cantilever; it is stiffer than from node to node, as its cores are clamped."""
    sized, load, surface = bar()
    mesh = mesh_solid(surface, R)
    carried = carry_to_solid(mesh, sized, load)
    np.testing.assert_allclose(carried.forces.sum(1), load.forces[:, 1, :3], atol=1e-10)
    moments = np.cross(mesh.nodes - sized.truss.nodes[1], carried.forces).sum(1)
    np.testing.assert_allclose(moments, load.forces[:, 1, 3:], atol=1e-9)
    solid = solve_solid(mesh, STEEL, carried)
    beams = solve_beams(build_beam_model(sized, STEEL), load)
    assert (solid.compliances < beams.compliances).all()
    assert (solid.compliances > 0.88 * beams.compliances).all()
    x = (mesh.nodes @ TURN)[:, 0]
    middle = (x > 6) & (x < 10)
    assert np.median(solid.von_mises[0, middle]) == pytest.approx(30 / np.pi, rel=0.002)
    assert solid.von_mises[2, middle].max() == pytest.approx(np.sqrt(3) * 9 * 2 / np.pi, rel=0.04)
    assert solid.von_mises[3, middle].max() == pytest.approx(9 * 4 / np.pi, rel=0.04)
    assert solid.peak_stress[3] == pytest.approx(9 * 4 / np.pi, rel=0.05)
    # Away from the clamp the curvature is that of the beam: the turn between two sections of constant moment.
    along, up = TURN[:, 0], TURN[:, 2]
    u = solid.displacements[3] @ up
    near = [(np.abs((mesh.nodes - s * along) @ along) < 0.5) for s in (5.0, 8.0, 11.0)]
    first, second, third = (u[n].mean() for n in near)
    curvature = (first - 2 * second + third) / 9
    assert abs(curvature) == pytest.approx(9 / (STEEL.youngs_modulus * np.pi / 4), rel=0.02)


def test_an_empty_core_has_the_nearest_nodes():
    """A node beyond the end of its bar: the resultants are exact all the same."""
    _, load, surface = bar()
    mesh = mesh_solid(surface, R, COARSEST * R)
    beyond = frame(np.array([[0, 0, 0], [L + 2.5, 0, 0]]) @ TURN.T, [(0, 1)], R)
    carried = carry_to_solid(mesh, beyond, load)
    assert ((carried.forces != 0).any((0, 2))).sum() == 8
    np.testing.assert_allclose(carried.forces.sum(1), load.forces[:, 1, :3], atol=1e-10)
    moments = np.cross(mesh.nodes - beyond.truss.nodes[1], carried.forces).sum(1)
    np.testing.assert_allclose(moments, load.forces[:, 1, 3:], atol=1e-9)


@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed")
def test_against_calculix(tmp_path):
    """Its C3D10 has the same nodes and the same four points: displacements agree to the digits that it prints."""
    sized, load, surface = bar()
    mesh = mesh_solid(surface, R, COARSEST * R)
    carried = carry_to_solid(mesh, sized, load)
    write_solid_deck(tmp_path / "solid.inp", mesh, STEEL, carried)
    subprocess.run(["ccx", "solid"], cwd=tmp_path, check=True, capture_output=True, timeout=60)
    tables = re.findall(r"displacements.*\n\s*\n((?:\s+\d+.*\n)+)", (tmp_path / "solid.dat").read_text())
    expected = solve_solid(mesh, STEEL, carried).displacements
    assert len(tables) == len(CASES)
    for table, u in zip(tables, expected, strict=True):
        found = np.array([[float(x) for x in row.split()[1:4]] for row in table.strip().split("\n")])
        np.testing.assert_allclose(found, u, rtol=0, atol=1e-6 * np.abs(u).max())


def test_refusals():
    sized, load, surface = bar()
    mesh = mesh_solid(surface, R, COARSEST * R)
    with pytest.raises(InvalidInputError, match="nothing holds the solid"):
        SolidLoading(np.zeros((4, 3), bool), np.ones((1, 4, 3)), ("a",), np.ones(4, bool))
    carried = carry_to_solid(mesh, sized, load)
    point = np.zeros_like(carried.fixed)
    point[np.flatnonzero(carried.fixed.all(1))[0]] = True
    loose = SolidLoading(point, carried.forces, carried.names, carried.counted)
    with pytest.raises(ConvergenceError, match="not positive definite"):
        solve_solid(mesh, STEEL, loose)
