"""Closed forms, hand calculations, invariances and an independent program."""

from dataclasses import replace

import numpy as np
import pytest
from frames import STEEL, THREE_FRAMES, cube_frame, frame, loading
from scipy.integrate import quad

from michell_cad.errors import InvalidInputError
from michell_cad.rotations import rotation_matrix
from michell_cad.strength import build_beam_model, solve_beams
from michell_cad.strength.beam_model import BeamModel, lobatto_rule
from michell_cad.strength.beam_solver import element_stiffness
from michell_cad.truss import SizedTruss, member_radius

E, NU = STEEL.youngs_modulus, STEEL.poisson_ratio
G = E / (2 * (1 + NU))
KAPPA = 6 * (1 + NU) / (7 + 6 * NU)
L, R = 50.0, 2.0
A, I = np.pi * R**2, np.pi * R**4 / 4
EXACT = 1e-9


def bar(radii=R, along=(1.0, 0.0, 0.0)) -> SizedTruss:
    return frame([np.zeros(3), L * np.asarray(along)], [(0, 1)], radii)


@pytest.mark.parametrize("pieces", [1, 3])
def test_cantilever(pieces):
    P = 7.0
    model = build_beam_model(bar(), STEEL, pieces=pieces)
    cases = ({1: np.eye(6)[d] * P} for d in range(6))
    u = solve_beams(model, loading(2, [0], *cases)).displacements[:, 1]
    expected = np.zeros((6, 6))
    expected[0, 0] = P * L / (E * A)
    expected[1, 1] = expected[2, 2] = P * L**3 / (3 * E * I) + P * L / (KAPPA * G * A)
    expected[1, 5] = expected[5, 1] = P * L**2 / (2 * E * I)
    expected[2, 4] = expected[4, 2] = -P * L**2 / (2 * E * I)
    expected[3, 3] = P * L / (G * 2 * I)
    expected[4, 4] = expected[5, 5] = P * L / (E * I)
    np.testing.assert_allclose(u, expected, rtol=EXACT, atol=EXACT * P * L / (E * A) / L)


def test_forces_and_stresses_of_a_cantilever():
    force = np.array([5.0, 0.0, -3.0, 40.0, 0.0, 0.0])
    solution = solve_beams(build_beam_model(bar(), STEEL), loading(2, [0], {1: force}))
    np.testing.assert_allclose(solution.axial_force[0, 0], 5.0, rtol=EXACT)
    np.testing.assert_allclose(solution.shear_force[0, 0], 3.0, rtol=EXACT)
    np.testing.assert_allclose(solution.torque[0, 0], 40.0, rtol=EXACT)
    np.testing.assert_allclose(solution.bending_moment[0, 0], [3 * L, 1.5 * L, 0], rtol=EXACT, atol=1e-8)
    sigma, tau = 5 / A + 3 * L * R / I, 40 * R / (2 * I)
    assert solution.peak_stress[0, 0] == pytest.approx(np.sqrt(sigma**2 + 3 * tau**2), rel=EXACT)
    # Local y is global y cross x = -z, local z is global y.
    np.testing.assert_allclose(solution.local_axes[0], [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=1e-15)
    np.testing.assert_allclose(solution.local_end_forces[0, 0, 1], [5, 3, 0, 40, 0, 0], rtol=EXACT, atol=1e-8)
    np.testing.assert_allclose(solution.local_end_forces[0, 0, 0], [-5, -3, 0, -40, 0, -3 * L], rtol=EXACT, atol=1e-8)


@pytest.mark.parametrize("pieces", [1, 2])
def test_tapered_bar_by_integrals(pieces):
    radii = np.array([2.0, 3.0, 1.5])
    model = build_beam_model(bar(radii), STEEL, pieces=pieces)
    u = solve_beams(model, loading(2, [0], *({1: np.eye(6)[d]} for d in (0, 2, 3)))).displacements[:, 1]

    def integral(f) -> float:
        return L * quad(lambda s: f(s, float(member_radius(radii, np.array([s]))[0])), 0, 1, epsabs=0, epsrel=1e-13)[0]

    stretch = integral(lambda s, r: 1 / (E * np.pi * r**2))
    bend = integral(lambda s, r: (L * (1 - s)) ** 2 / (E * np.pi * r**4 / 4) + 1 / (KAPPA * G * np.pi * r**2))
    twist = integral(lambda s, r: 1 / (G * np.pi * r**4 / 2))
    np.testing.assert_allclose([u[0, 0], u[1, 2], u[2, 3]], [stretch, bend, twist], rtol=EXACT)


def test_members_are_as_thick_as_the_balls_at_their_nodes():
    """A cantilever between two balls, by integrals; and balls that overlap leave next to nothing of the member."""
    balls = np.array([3.5, 5.0])
    model = build_beam_model(bar(), STEEL, joints=balls)
    u = solve_beams(model, loading(2, [0], *({1: np.eye(6)[d]} for d in (0, 2, 3)))).displacements[:, 1]

    def integral(f) -> float:
        hidden = np.sqrt(balls**2 - R**2)
        parts = [
            quad(lambda x: f(x, np.sqrt(balls[0] ** 2 - x**2)), 0, hidden[0]),
            quad(lambda x: f(x, R), hidden[0], L - hidden[1]),
            quad(lambda x: f(x, np.sqrt(balls[1] ** 2 - (L - x) ** 2)), L - hidden[1], L),
        ]
        return sum(part[0] for part in parts)

    stretch = integral(lambda x, r: 1 / (E * np.pi * r**2))
    bend = integral(lambda x, r: (L - x) ** 2 / (E * np.pi * r**4 / 4) + 1 / (KAPPA * G * np.pi * r**2))
    twist = integral(lambda x, r: 1 / (G * np.pi * r**4 / 2))
    np.testing.assert_allclose([u[0, 0], u[1, 2], u[2, 3]], [stretch, bend, twist], rtol=5e-5)
    assert model.lengths == pytest.approx(L)
    plain = solve_beams(build_beam_model(bar(), STEEL), loading(2, [0], {1: np.eye(6)[0]}))
    no_balls = solve_beams(build_beam_model(bar(), STEEL, joints=np.zeros(2)), loading(2, [0], {1: np.eye(6)[0]}))
    np.testing.assert_allclose(no_balls.displacements, plain.displacements, rtol=EXACT, atol=1e-18)
    large = build_beam_model(bar(), STEEL, joints=np.array([60.0, 60.0]))
    assert large.lengths == pytest.approx(L)
    assert large.radii[:, :9].max() > 50
    assert (large.radii >= R).all()
    with pytest.raises(InvalidInputError, match="joints belong to whole members"):
        build_beam_model(bar(), STEEL, pieces=2, joints=balls)


def test_quarter_circle():
    """Clamped at angle 0, radial load H at angle pi/2: Castigliano with N = H sin, V = H cos, M = H R sin."""
    radius, H = 30.0, 11.0
    s, w = lobatto_rule(17)
    angle = s * np.pi / 2
    points = radius * np.stack([np.cos(angle), np.sin(angle), 0 * s], axis=1)[None]
    tangents = np.stack([-np.sin(angle), np.cos(angle), 0 * s], axis=1)[None]
    truss = frame(points[0, [0, -1]], [(0, 1)]).truss
    model = BeamModel(
        truss, STEEL, truss.nodes, truss.members, np.array([0]), points, tangents, s[None], np.full((1, 17), R),
        w[None] * radius * np.pi / 2, KAPPA,
    )  # fmt: skip
    solution = solve_beams(model, loading(2, [0], {1: (0, H, 0, 0, 0, 0)}))
    # At the angle a the load H along y at (0, R) has the normal part H cos a, the transverse part H sin a and the
    # moment H R cos a.
    expected = H * np.pi / 4 * (radius / (E * A) + radius / (KAPPA * G * A) + radius**3 / (E * I))
    assert solution.displacements[0, 1, 1] == pytest.approx(expected, rel=EXACT)
    np.testing.assert_allclose(solution.axial_force[0, 0], H * np.cos(angle), atol=1e-9 * H)
    np.testing.assert_allclose(solution.bending_moment[0, 0], H * radius * np.cos(angle), atol=1e-8 * H)


def test_portal_frame_by_hand():
    """Sway of a clamped portal under P at one top corner, half of it antisymmetric, by slope deflection.

    Unknowns at the left top corner: sway u, vertical v, rotation t (clockwise with the sway); the beam's middle is a
    point of inflection. The symmetric half of the load, a squeeze of the beam, moves the corners by +-w.
    """
    h, b, P = 40.0, 60.0, 9.0
    sized = frame([[0, 0, 0], [0, 0, h], [b, 0, h], [b, 0, 0]], [(0, 1), (1, 2), (2, 3)], R)
    model = build_beam_model(sized, STEEL, shear_coefficient=np.inf)
    u = solve_beams(model, loading(4, [0, 3], {1: (P, 0, 0, 0, 0, 0)})).displacements[0]
    EI, EA, half = E * I, E * A, b / 2
    # Antisymmetric: P/2 at both corners. Forces on the corner (sway, vertical, moment); positive rotation about +y
    # turns z towards x, so the column head follows the sway and the beam's left end goes down to the right.
    K = np.array(
        [
            [12 * EI / h**3, 0, -6 * EI / h**2],
            [0, EA / h + 3 * EI / half**3, -3 * EI / half**2],
            [-6 * EI / h**2, -3 * EI / half**2, 4 * EI / h + 3 * EI / half],
        ]
    )
    sway = np.linalg.solve(K, [P / 2, 0, 0])
    # Symmetric: P/2 inwards on both corners: the beam shortens, the corners turn, nothing moves at its middle.
    S = np.array([[12 * EI / h**3 + EA / half, -6 * EI / h**2], [-6 * EI / h**2, 4 * EI / h + EI / half]])
    squeeze = np.linalg.solve(S, [P / 2, 0])
    np.testing.assert_allclose(u[1, [0, 2, 4]], sway + [squeeze[0], 0, squeeze[1]], rtol=EXACT)
    np.testing.assert_allclose(u[2, [0, 2, 4]], sway * [1, -1, 1] - [squeeze[0], 0, squeeze[1]], rtol=EXACT)


def test_rotated_frame_gives_the_rotated_answer():
    sized = cube_frame()
    Q = rotation_matrix(np.array([[0.4, -1.1, 0.7]]))[0]
    turned = SizedTruss(replace(sized.truss, nodes=sized.truss.nodes @ Q.T), sized.radii)
    force, moment = np.array([1.0, 2, -3]), np.array([0.5, 0, 0.2])
    one = solve_beams(build_beam_model(sized, STEEL), loading(8, range(4), {6: np.append(force, moment)}))
    other = solve_beams(build_beam_model(turned, STEEL), loading(8, range(4), {6: np.append(Q @ force, Q @ moment)}))
    u = one.displacements.reshape(-1, 2, 3) @ Q.T
    np.testing.assert_allclose(other.displacements.reshape(-1, 2, 3), u, rtol=EXACT, atol=EXACT * np.abs(u).max())
    np.testing.assert_allclose(other.von_mises, one.von_mises, rtol=EXACT)
    np.testing.assert_allclose(other.compliances, one.compliances, rtol=EXACT)


def test_rigid_motion_gives_no_force():
    model = build_beam_model(SizedTruss(cube_frame().truss, np.tile([0.1, 0.15, 0.2], (13, 1))), STEEL)
    v, w = np.array([0.3, -0.2, 0.5]), np.array([0.1, 0.4, -0.3])
    u = np.concatenate([v + np.cross(w, model.nodes), np.broadcast_to(w, model.nodes.shape)], axis=1)
    K = element_stiffness(model)
    forces = np.einsum("eij,ej->ei", K, u[model.elements].reshape(-1, 12))
    assert np.abs(forces).max() < 1e-12 * np.abs(K).max()


def test_forces_balance_at_every_node_and_energies_add_up():
    model = build_beam_model(cube_frame(), STEEL, pieces=2)
    load = loading(8, range(4), {6: (1, 2, -3, 0.5, 0, 0.2), 4: (0, 0, 4, 0, 0, 0)}, {5: (0, 1, 0, 0, 0, 0)})
    solution = solve_beams(model, load)
    total = np.zeros((2, len(model.nodes), 6))
    np.add.at(total, (slice(None), model.elements), solution.end_forces)
    np.testing.assert_allclose(total[:, 4:8], load.forces[:, 4:], atol=1e-8)
    np.testing.assert_allclose(total[:, 8:], 0, atol=1e-8)
    np.testing.assert_allclose(total[:, :, :3].sum(1), 0, atol=1e-8)
    np.testing.assert_allclose(solution.energies.sum((1, 2)), solution.compliances, rtol=EXACT)
    one_piece = solve_beams(build_beam_model(cube_frame(), STEEL), load)
    np.testing.assert_allclose(one_piece.compliances, solution.compliances, rtol=EXACT)
    np.testing.assert_allclose(one_piece.peak_stress, solution.peak_stress, rtol=EXACT)


@pytest.mark.parametrize("name", THREE_FRAMES)
def test_against_pynite(name):
    """Euler-Bernoulli members of an independent program."""
    from Pynite import FEModel3D

    sized, load = THREE_FRAMES[name]
    other = FEModel3D()
    other.add_material("steel", E, G, NU, 0.0)
    for number, (x, y, z) in enumerate(sized.truss.nodes):
        other.add_node(f"N{number}", x, y, z)
    for number, (a, b) in enumerate(sized.truss.members):
        r = float(sized.radii[number, 0])
        inertia = np.pi * r**4 / 4
        other.add_section(f"rod {number}", np.pi * r**2, inertia, inertia, 2 * inertia)
        other.add_member(f"M{number}", f"N{a}", f"N{b}", "steel", f"rod {number}")
    for number in np.flatnonzero(load.held.all(1)):
        other.def_support(f"N{number}", *[True] * 6)
    for case, node, way in np.argwhere(load.forces):
        kind = ("FX", "FY", "FZ", "MX", "MY", "MZ")[way]
        other.add_node_load(f"N{node}", kind, load.forces[case, node, way], case=f"case {case}")
    for case in range(len(load.names)):
        other.add_load_combo(f"combo {case}", {f"case {case}": 1.0})
    other.analyze()
    solution = solve_beams(build_beam_model(sized, STEEL, shear_coefficient=np.inf), load)
    for case in range(len(load.names)):
        combo, nodes = f"combo {case}", other.nodes.values()
        u = np.array([[getattr(n, f"{kind}{axis}")[combo] for kind in "DR" for axis in "XYZ"] for n in nodes])
        np.testing.assert_allclose(solution.displacements[case], u, atol=1e-6 * np.abs(u).max())
        axial = np.array([-member.f(combo)[0, 0] for member in other.members.values()])
        np.testing.assert_allclose(solution.axial_force[case, :, 0], axial, atol=1e-6 * np.abs(axial).max())


def test_refusals():
    sized = frame([[0, 0, 0], [1, 0, 0], [2, 2, 2]], [(0, 1)])
    model = build_beam_model(sized, STEEL)
    with pytest.raises(InvalidInputError, match="loading is for 2 nodes, the truss has 3"):
        solve_beams(model, loading(2, [0], {1: np.ones(6)}))
    with pytest.raises(InvalidInputError, match="a load acts on 1 nodes without members, first node 2"):
        solve_beams(model, loading(3, [0], {1: np.ones(6), 2: np.ones(6)}))
    with pytest.raises(InvalidInputError, match="the truss is a mechanism"):
        solve_beams(model, loading(3, {0: (0, 1, 2)}, {1: np.ones(6)}))
