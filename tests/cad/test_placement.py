"""Radii along members between ends of very different thickness."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from michell_cad.cad import build_solid
from michell_cad.cad.placement import without_waist
from michell_cad.knobs import Knobs
from michell_cad.truss import SizedTruss, member_radius
from tests.cad.layouts import star

S = np.linspace(0, 1, 401)


def test_a_waist_is_filled_and_an_entasis_is_left_alone() -> None:
    radii = np.array([[1.0, 1.4, 1.0], [1.0, 1.5, 2.0], [2.0, 1.2, 2.0], [10.0, 1.0, 1.0]])
    found = without_waist(radii)
    np.testing.assert_allclose(found[:3], radii[:3], rtol=1e-12)
    assert member_radius(radii[3], S).min() < 0
    # |middle - mean| <= 3/16 |difference of the ends| is where the slope of the quartic changes its sign at the end.
    assert found[3, 1] == pytest.approx(5.5 - 3 / 16 * 9, rel=0.03)


@given(st.lists(st.floats(0.1, 10.0), min_size=3, max_size=3))
def test_no_tube_is_thinner_than_its_radii(three) -> None:
    radii = np.array([three])
    found = without_waist(radii)
    assert (found[:, [0, 2]] == radii[:, [0, 2]]).all()
    assert (found[:, 1] >= radii[:, 1]).all()
    assert member_radius(found[0], S).min() >= 0.995 * min(three)


def test_a_thin_member_at_an_acute_angle_to_a_thick_one_has_its_radius() -> None:
    thick_and_thin = star([[1, 0, 0], [np.cos(0.5), np.sin(0.5), 0]], length=60.0)
    radii = np.array([[3.0] * 3, [0.3] * 3])
    solid = build_solid(SizedTruss(thick_and_thin.truss, radii), Knobs())
    tubes = solid.prepared.tubes
    assert tubes.radii[1].max() > 2.0  # the crease makes its end as thick as its rival
    assert tubes.radii_at(S).min(1) == pytest.approx([3.0, 0.3], rel=0.02)
    assert solid.report.valid
