import numpy as np
import pytest
from frames import STEEL, cube_frame, frame

from michell_cad.errors import InvalidInputError
from michell_cad.strength.beam_model import build_beam_model, circle_shear_coefficient, lobatto_rule
from michell_cad.truss import member_radius


@pytest.mark.parametrize("count", [3, 5, 17])
def test_lobatto_rule_is_exact_to_its_degree_and_no_further(count):
    x, w = lobatto_rule(count)
    assert x[0] == 0
    assert x[-1] == 1
    for degree in range(2 * count - 2):
        assert w @ x**degree == pytest.approx(1 / (degree + 1), rel=1e-12)
    if count < 10:  # beyond, the error is below rounding
        assert abs(w @ x ** (2 * count - 2) - 1 / (2 * count - 1)) > 1e-6


def test_shear_coefficient_of_a_circle():
    # Cowper's table for nu = 0, 0.3 and 0.5.
    np.testing.assert_allclose([circle_shear_coefficient(nu) for nu in (0, 0.3, 0.5)], [0.857, 0.886, 0.900], atol=5e-4)


def test_pieces_share_the_member():
    radii = np.array([[0.2, 0.3, 0.1]])
    sized = frame([[0, 0, 0], [3, 4, 0]], [(0, 1)], radii)
    model = build_beam_model(sized, STEEL, pieces=4)
    np.testing.assert_allclose(model.nodes[2:], [[0.75, 1, 0], [1.5, 2, 0], [2.25, 3, 0]], rtol=1e-14)
    np.testing.assert_array_equal(model.elements, [[0, 2], [2, 3], [3, 4], [4, 1]])
    np.testing.assert_allclose(model.lengths, 1.25, rtol=1e-14)
    np.testing.assert_allclose(model.radii[:, 0], member_radius(radii[0], np.arange(4) / 4), rtol=1e-14)
    np.testing.assert_array_equal(model.radii[1:, 0], model.radii[:-1, -1])


def test_volume_of_cylinders():
    sized = cube_frame(0.1)
    assert build_beam_model(sized, STEEL).volume == pytest.approx(np.pi * 0.01 * sized.truss.lengths.sum(), rel=1e-14)


def test_members_follow_their_curves_on_request():
    # Five nodes on a quarter circle make one curve; its middle members bulge beyond their chords.
    from michell_cad.curves import Curve, CurveKind
    from michell_cad.truss import SizedTruss, Truss

    angle = np.linspace(0, np.pi / 2, 5)
    nodes = 10 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    members = np.stack([np.arange(4), np.arange(1, 5)], axis=1)
    curve = Curve(CurveKind.INTERIOR, "tension", 0, (None, 1, 1), 0, np.arange(5), np.arange(4), closed=False)
    truss = Truss(nodes, np.zeros(5, int), members, (curve,), 4.0)
    model = build_beam_model(SizedTruss(truss, np.ones((4, 3))), STEEL, straight=False)
    assert np.linalg.norm(model.points, axis=2) == pytest.approx(10, rel=3e-3)
    assert model.lengths.sum() == pytest.approx(5 * np.pi, rel=2e-3)
    assert model.lengths.sum() > truss.lengths.sum() * 1.004


def test_refusals():
    sized = frame([[0, 0, 0], [1, 0, 0]], [(0, 1)])
    with pytest.raises(InvalidInputError, match="pieces must be at least 1, found 0"):
        build_beam_model(sized, STEEL, pieces=0)
    with pytest.raises(InvalidInputError, match="shear_coefficient must be positive"):
        build_beam_model(sized, STEEL, shear_coefficient=0.0)
