"""Quadratic tets against patch tests, closed forms, their order of convergence and a NAFEMS benchmark."""

import numpy as np
import pytest
from frames import STEEL
from quadratic_shapes import block, faces_where, pressure_forces
from shapes import box_mesh

from michell_cad.errors import InvalidInputError
from michell_cad.linear_solver import factorise
from michell_cad.rigid_motions import rigid_motions
from michell_cad.strength.solid.quadratic_mesh import QuadraticMesh, quadratic_mesh
from michell_cad.strength.solid.quadratic_tets import gauss_stress, nodal_stress, stiffness_matrix, von_mises
from michell_cad.tet_mesh import TetMesh

E, NU = STEEL.youngs_modulus, STEEL.poisson_ratio


def crooked() -> QuadraticMesh:
    """A box whose inner vertices are moved at random: straight tets of all shapes."""
    mesh = box_mesh((3, 3, 3), (3.0, 3.0, 3.0))
    X = mesh.vertices
    inner = ((X > 0) & (X < 3)).all(1)
    moved = X + 0.25 * inner[:, None] * np.random.default_rng(1).uniform(-1, 1, X.shape)
    return quadratic_mesh(TetMesh(moved, mesh.tets))


def solve(mesh: QuadraticMesh, fixed: np.ndarray, forces: np.ndarray) -> np.ndarray:
    K = stiffness_matrix(mesh, STEEL, fixed)
    return factorise(K).solve(np.where(fixed, 0, forces).ravel()).reshape(-1, 3)


def test_constant_stress_is_exact():
    mesh = crooked()
    x = mesh.nodes
    H = np.random.default_rng(0).normal(size=(3, 3)) * 1e-3
    u = x @ H.T
    lmbda, mu = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
    sigma = lmbda * np.trace(H) * np.eye(3) + mu * (H + H.T)
    found = gauss_stress(mesh, STEEL, u)
    np.testing.assert_allclose(found, np.broadcast_to(sigma, found.shape), atol=1e-12 * np.abs(sigma).max() * 10)
    np.testing.assert_allclose(nodal_stress(mesh, found) - sigma, 0, atol=1e-11 * np.abs(sigma).max())
    residual = (stiffness_matrix(mesh, STEEL) @ u.ravel()).reshape(-1, 3)
    inner = ((x > 1e-9) & (x < 3 - 1e-9)).all(1)
    assert np.abs(residual[inner]).max() < 1e-12 * np.abs(residual).max()


def test_pure_bending_is_exact():
    """The field of a bent beam, a quadratic polynomial without body force: sigma_xx = E k y and nothing else."""
    mesh, k = crooked(), 1e-3
    x, y, z = mesh.nodes.T
    u = k * np.stack([x * y, -(x**2) / 2 - NU / 2 * (y**2 - z**2), -NU * y * z], axis=1)
    residual = (stiffness_matrix(mesh, STEEL) @ u.ravel()).reshape(-1, 3)
    inner = ((mesh.nodes > 1e-9) & (mesh.nodes < 3 - 1e-9)).all(1)
    assert np.abs(residual[inner]).max() < 1e-11 * np.abs(residual).max()
    stress = nodal_stress(mesh, gauss_stress(mesh, STEEL, u))
    expected = np.zeros_like(stress)
    expected[:, 0, 0] = E * k * y
    np.testing.assert_allclose(stress, expected, atol=1e-9 * E * k)
    np.testing.assert_allclose(von_mises(stress), np.abs(expected[:, 0, 0]), atol=1e-9 * E * k)


def test_rigid_motions_cost_nothing_and_nothing_else_is_free():
    mesh = block((1, 1, 1), lambda x: x + 0.1 * np.sin(3 * x[:, [1, 2, 0]]))
    K = stiffness_matrix(mesh, STEEL).toarray()
    values = np.linalg.eigvalsh(K)
    rigid = rigid_motions(mesh.nodes).reshape(-1, 6)
    assert np.abs(K @ rigid).max() < 1e-12 * np.abs(K).max()
    assert (values[:6] < 1e-10 * values[-1]).all()
    assert values[6] > 1e-4 * values[-1]


def test_von_mises_of_shear():
    tau = np.zeros((3, 3))
    tau[0, 1] = tau[1, 0] = 2.0
    assert von_mises((tau + 7 * np.eye(3))[None])[0] == pytest.approx(2 * np.sqrt(3))


def spherical(x: np.ndarray) -> np.ndarray:
    """The unit cube on what a square through the pole sees of a shell between the radii 1 and 2."""
    direction = np.column_stack([np.tan(np.pi / 4 * x[:, :2]), np.ones(len(x))])
    return (1 + x[:, 2:]) * direction / np.linalg.norm(direction, axis=1, keepdims=True)


def test_lames_sphere_and_the_order_of_convergence():
    """A shell under inner pressure: u_r = A r + B / r^2, which is prescribed where the piece is cut out."""
    p, low, high = 100.0, 1.0, 2.0
    c = p * low**3 / (high**3 - low**3)
    A, B = c * (1 - 2 * NU) / E, c * high**3 * (1 + NU) / (2 * E)
    errors = []
    for n in (3, 6):
        mesh = block((n, n, n), spherical)
        unit = quadratic_mesh(box_mesh((n, n, n), (1.0, 1.0, 1.0))).nodes
        r = np.linalg.norm(mesh.nodes, axis=1)
        exact = mesh.nodes * (A + B / r**3)[:, None]
        sides = ((unit[:, :2] < 1e-9) | (unit[:, :2] > 1 - 1e-9)).any(1)
        fixed = np.repeat(sides[:, None], 3, axis=1)
        forces = pressure_forces(mesh, faces_where(mesh, r < low + 1e-9), p)
        prescribed = np.where(fixed, exact, 0)
        forces -= (stiffness_matrix(mesh, STEEL) @ prescribed.ravel()).reshape(-1, 3)
        u = solve(mesh, fixed, forces) + prescribed
        errors.append(np.sqrt(((u - exact) ** 2).sum(1).mean()) / (A + B))
    assert errors[1] < 5e-4
    assert errors[1] < errors[0] / 7  # third order


def thick_plate(unit: np.ndarray) -> np.ndarray:
    """Points (from inner to outer ellipse, angle, height) of the unit cube in the plate of LE10, mm; finer near D."""
    out, angle = unit[:, 0] ** 1.2, np.pi / 2 * unit[:, 1] ** 1.1
    inner = np.stack([2000 * np.cos(angle), 1000 * np.sin(angle)], axis=1)
    outer = np.stack([3250 * np.cos(angle), 2750 * np.sin(angle)], axis=1)
    return np.column_stack([inner + out[:, None] * (outer - inner), 600 * unit[:, 2]])


def test_nafems_le10():
    """Thick plate under pressure (NAFEMS, The Standard NAFEMS Benchmarks, 1990, LE10): sigma_yy = -5.38 MPa at D.

    Two tets meet there. Their mean on coarser and finer meshes of even and graded cells lies on both sides of it: -5.26
    and -5.54 with 12 x 20 x 8 cells, -5.33 and -5.46 with 24 x 36 x 12.
    """
    cells = (8, 12, 6)
    mesh, (out, a, z) = block(cells, thick_plate), block(cells).nodes.T
    near = 1e-9
    fixed = np.zeros(mesh.nodes.shape, bool)
    fixed[a < near, 1] = True
    fixed[a > 1 - near, 0] = True
    fixed[out > 1 - near, :2] = True
    fixed[(out > 1 - near) & (abs(z - 0.5) < near), 2] = True
    forces = pressure_forces(mesh, faces_where(mesh, z > 1 - near), 1.0)
    stress = nodal_stress(mesh, gauss_stress(mesh, STEEL, solve(mesh, fixed, forces)))
    D = np.flatnonzero((a < near) & (out < near) & (z > 1 - near))
    np.testing.assert_allclose(mesh.nodes[D], [[2000, 0, 600]], atol=1e-9)
    assert stress[D[0], 1, 1] == pytest.approx(-5.38, rel=0.01)


def test_refusals():
    mesh = block((1, 1, 1))
    with pytest.raises(InvalidInputError, match="tets must index the 27 nodes"):
        QuadraticMesh(mesh.nodes, mesh.tets + 1)
    inverted = np.array(mesh.tets)
    inverted[2] = inverted[2, [0, 1, 3, 2, 4, 8, 7, 6, 5, 9]]
    with pytest.raises(InvalidInputError, match=r"1 of 6 quadratic tets turn inside out, first \[2\]"):
        QuadraticMesh(mesh.nodes, inverted)
