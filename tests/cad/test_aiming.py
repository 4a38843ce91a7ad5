"""Aims: members leave into their curves, and tubes begin where they aim."""

import numpy as np
import pytest

from michell_cad.cad.aiming import AIM_ENOUGH, nudge, point_end
from michell_cad.cad.layout import settle, start_layout
from michell_cad.knobs import Knobs
from tests.cad.layouts import grid_truss, sized


def test_both_ends_aim_into_their_member() -> None:
    points = np.stack([np.linspace(1, 3, 17), np.zeros(17), np.zeros(17)], axis=1)
    d = np.empty(3)
    for end, expected in ((4, 1.0), (5, -1.0)):
        point_end(points, 2.0, end, 0.3, 0, d)
        assert d == pytest.approx([expected, 0, 0])


@pytest.mark.parametrize("angle", [0.01, 0.2])
def test_a_nudge_turns_by_its_angle(angle) -> None:
    before = np.array([0.6, 0.0, 0.8])
    d = before.copy()
    nudge(d, angle)
    assert np.arccos(d @ before) == pytest.approx(angle, rel=1e-6)


def test_tubes_begin_where_members_aim() -> None:
    layout = start_layout(sized(grid_truss((3, 3, 3), warp=0.15, missing=0.0, seed=1), 1.0, 0.0), Knobs())
    assert not settle(layout)
    near = layout.sizes["reach"] < 0.5 * layout.lengths.repeat(2)
    assert near.any()
    assert (layout.sizes["reach"] <= AIM_ENOUGH * layout.aim)[near].all()
