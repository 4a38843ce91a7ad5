"""How balls change with radii: by hand, against layouts, and derivatives by differences."""

import numpy as np
import pytest

from michell_cad.cad.ball_rule import rule_as_built, rule_at_rest
from michell_cad.cad.prepare import prepare_truss
from michell_cad.knobs import Knobs
from michell_cad.truss import SizedTruss
from tests.cad.layouts import grid_truss, star

KNOBS = Knobs(node_ratio=1.3)


def ends_of(s: SizedTruss) -> np.ndarray:
    return np.asarray(s.radii)[:, [0, 2]]


def test_two_members_at_a_right_angle_by_hand() -> None:
    """Without fillets asin(r_1 / R) + asin(r_2 / R) = a where R^2 sin^2 a = r_1^2 + r_2^2 + 2 r_1 r_2 cos a."""
    pair = star([[1, 0, 0], [0, 1, 0]], length=20.0, radius=1.0)
    R, slopes = rule_at_rest(pair.truss, Knobs(node_ratio=1.2, fillet_ratio=0.0))(np.array([[1.0, 1.0], [1.5, 1.5]]))
    a = np.pi / 2 - np.radians(1.0)  # the margin between two caps
    expected = np.sqrt(1 + 1.5**2 + 3 * np.cos(a)) / np.sin(a)
    assert R[0] == pytest.approx(expected, rel=1e-8)
    # d log R: (r_i^2 + r_1 r_2 cos a) / (R sin a)^2, which add up to one.
    top = np.array([1 + 1.5 * np.cos(a), 1.5**2 + 1.5 * np.cos(a)])
    np.testing.assert_allclose(slopes[:, 0], top / (expected * np.sin(a)) ** 2, rtol=1e-7)
    # At the far ends there is one member each: the least ball.
    np.testing.assert_allclose(R[1:], 1.2 * np.array([1.0, 1.5]))
    np.testing.assert_allclose(slopes[:, 1], 1.0)


def test_members_at_an_acute_angle_are_creased_and_ask_for_no_ball_of_their_own() -> None:
    half = np.radians(8.0)
    acute = star([[np.cos(half), np.sin(half), 0], [np.cos(half), -np.sin(half), 0]], length=40.0, radius=1.0)
    R, slopes = rule_at_rest(acute.truss, KNOBS)(np.array([[1.0, 1.0], [0.5, 0.5]]))
    assert R[0] == pytest.approx(1.3)
    np.testing.assert_allclose(slopes[:, 0], [1.0, 0.0], atol=1e-12)


@pytest.fixture(scope="module")
def lattice() -> SizedTruss:
    truss = grid_truss((3, 2, 2), warp=0.25)
    radii = np.random.default_rng(5).uniform(0.03, 0.07, (len(truss.members), 3)) * truss.spacing
    return SizedTruss(truss, radii)


def test_it_is_what_layouts_give(lattice: SizedTruss) -> None:
    prepared = prepare_truss(lattice, KNOBS)
    assert prepared.changes.merged_nodes == 0
    R, _ = rule_as_built(prepared)(ends_of(prepared.sized))
    np.testing.assert_allclose(R, prepared.sizes.radius, rtol=1e-12)
    # All as large as wanted: nothing that building adds.
    np.testing.assert_allclose(rule_at_rest(lattice.truss, KNOBS)(ends_of(lattice))[0], R, rtol=0.02)
    # Radii a little apart come out as foretold.
    other = SizedTruss(lattice.truss, lattice.radii * np.random.default_rng(6).uniform(0.95, 1.05, lattice.radii.shape))
    again = prepare_truss(other, KNOBS)
    foretold, _ = rule_as_built(prepared)(ends_of(other))
    assert np.abs(foretold / again.sizes.radius - 1).max() < 0.02


def test_derivatives_by_differences(lattice: SizedTruss) -> None:
    rule, ends, step = rule_at_rest(lattice.truss, KNOBS), ends_of(lattice), 1e-6
    _, slopes = rule(ends)
    for member in range(0, len(ends), 5):
        for end in range(2):
            sides = []
            for sign in (1, -1):
                moved = ends.copy()
                moved[member, end] *= np.exp(sign * step)
                sides.append(np.log(rule(moved)[0]))
            node = lattice.truss.members[member, end]
            assert (sides[0] - sides[1])[node] / (2 * step) == pytest.approx(slopes[member, end], abs=1e-5)
    # The balls of thicker members are as much larger.
    total = np.zeros(len(lattice.truss.nodes))
    np.add.at(total, lattice.truss.members, slopes)
    np.testing.assert_allclose(total, 1.0, rtol=1e-9)


def test_equal_members_have_equal_parts() -> None:
    cross = star([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]], length=20.0, radius=1.0)
    _, slopes = rule_at_rest(cross.truss, KNOBS)(ends_of(cross))
    np.testing.assert_allclose(slopes[:, 0], 0.25, rtol=1e-9)
