import numpy as np
import pytest
from frames import STEEL, frame, in_proportion, loading, tower

from michell_cad.strength import beam_model
from michell_cad.strength.beam_model import build_beam_model
from michell_cad.strength.beam_solver import solve_beams
from michell_cad.strength.thick_nodes import ThickNodes, section_basis
from michell_cad.truss import member_radius


def test_sections_by_hand():
    """A bar of length 10, radius 1, balls 3 and 0: at distance d from the first node the ball is (9 - d^2)^(1/2)."""
    sized = frame([[0, 0, 0], [10, 0, 0]], [(0, 1)], 1.0)
    nodes = ThickNodes(sized.truss, STEEL, True, lambda radii: (np.array([3.0, 0.0]), np.ones((1, 2))))
    model = nodes.with_balls(sized.radii)
    d = 10 * model.stations[0]
    np.testing.assert_allclose(model.radii[0], np.maximum(1, np.sqrt(np.maximum(9 - d**2, 0))), rtol=1e-12)
    assert np.isclose(d, np.sqrt(8)).any()  # the rim
    np.testing.assert_allclose(nodes.members(sized.radii).radii[0], 1.0)


def test_the_basis_is_the_radius_of_members():
    radii, s = np.array([[1.0, 1.4, 0.7]]), np.linspace(0, 1, 9)[None]
    np.testing.assert_allclose(section_basis(s) @ radii[0], member_radius(radii[:, None], s), rtol=1e-12)


def test_it_is_the_model_with_joints():
    sized = tower()
    load = loading(12, range(3), {9: (3, 5, -40, 0, 0, 0)})
    balls = in_proportion(sized.truss.members, np.linspace(1.2, 2.2, 12))
    exact = solve_beams(build_beam_model(sized, STEEL, joints=balls(sized.radii[:, [0, 2]])[0]), load).compliances[0]
    bare = solve_beams(build_beam_model(sized, STEEL), load).compliances[0]
    nodes = ThickNodes(sized.truss, STEEL, True, balls)
    assert solve_beams(nodes.with_balls(sized.radii), load).compliances[0] == pytest.approx(exact, rel=1e-12)
    assert exact < 0.9 * bare


def test_volume_by_differences(monkeypatch):
    """The gradient of any integral over sections, here of the volume: sum w A, by section w A; many sections in balls,
    so that the derivative of the rule is that of the integral."""
    monkeypatch.setattr(beam_model, "JOINT_SECTIONS", 65)
    sized = tower()
    nodes = ThickNodes(sized.truss, STEEL, True, in_proportion(sized.truss.members, np.linspace(1.2, 2.2, 12)))
    radii = sized.radii * np.random.default_rng(2).uniform(0.9, 1.1, (len(sized.radii), 1))
    model = nodes.with_balls(radii)
    by_area = nodes.gradient(model, radii, model.weights * np.pi * model.radii**2)
    for member in range(len(radii)):
        sides = []
        for step in (1e-5, -1e-5):
            moved = radii.copy()
            moved[member] *= np.exp(step / 2)
            sides.append(nodes.with_balls(moved).volume)
        assert by_area[member].sum() == pytest.approx((sides[0] - sides[1]) / 2e-5, rel=1e-3)
