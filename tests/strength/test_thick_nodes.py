import numpy as np
import pytest
from frames import STEEL, frame, loading, tower

from michell_cad.errors import InvalidInputError
from michell_cad.strength.beam_model import build_beam_model
from michell_cad.strength.beam_solver import solve_beams
from michell_cad.strength.thick_nodes import ThickNodes
from michell_cad.truss import SizedTruss, member_radius


def test_sections_by_hand():
    """A bar of length 10, radius 1, balls 3 and 0: at distance d from the first node the ball is (9 - d^2)^(1/2)."""
    sized = frame([[0, 0, 0], [10, 0, 0]], [(0, 1)], 1.0)
    nodes = ThickNodes(build_beam_model(sized, STEEL, even_sections=11), np.array([3.0, 0.0]))
    expected = np.ones(11)
    expected[:3] = np.sqrt([9, 8, 5])
    np.testing.assert_allclose(nodes.with_radii(sized.radii).radii[0], expected)
    np.testing.assert_allclose(nodes.members(sized.radii).radii[0], 1.0)
    np.testing.assert_allclose(nodes.widest(sized.radii), 1.0)
    # Each half belongs to its own ball, however large; the middle never does.
    hidden = ThickNodes(nodes.model, np.array([20.0, 0.0])).with_radii(sized.radii).radii[0]
    np.testing.assert_allclose(hidden[[4, 5, 6]], [np.sqrt(400 - 16), 1.0, 1.0])


def test_the_basis_is_the_radius_of_members():
    radii = np.array([[1.0, 1.4, 0.7]])
    model = build_beam_model(frame([[0, 0, 0], [9, 0, 0]], [(0, 1)], 1.0), STEEL, even_sections=9)
    expected = member_radius(radii[:, None], model.stations)
    np.testing.assert_allclose(ThickNodes(model, np.zeros(2)).members(radii).radii, expected, rtol=1e-12)


def test_compliance_is_that_of_the_model_with_joints():
    """The same balls at the sections of Lobatto's rule, which follow their rims."""
    sized = tower()
    load = loading(12, range(3), {9: (3, 5, -40, 0, 0, 0)})
    ratios = np.linspace(1.2, 2.2, 12)
    widest = np.zeros(12)
    np.maximum.at(widest, sized.truss.members, sized.radii[:, [0, 2]])
    exact = solve_beams(build_beam_model(sized, STEEL, joints=ratios * widest), load).compliances[0]
    bare = solve_beams(build_beam_model(sized, STEEL), load).compliances[0]
    even = ThickNodes(build_beam_model(sized, STEEL, even_sections=201), ratios).with_radii(sized.radii)
    assert solve_beams(even, load).compliances[0] == pytest.approx(exact, rel=2e-3)
    assert exact < 0.9 * bare


def test_an_even_number_of_sections_is_refused():
    sized = SizedTruss(tower().truss, tower().radii)
    with pytest.raises(InvalidInputError, match="the middle of a member needs a section"):
        ThickNodes(build_beam_model(sized, STEEL, even_sections=10), np.zeros(12))
