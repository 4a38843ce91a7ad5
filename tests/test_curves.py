"""Curves as arrays: the same curves as one by one, and refusal of arrays that do not fit together."""

from dataclasses import replace

import numpy as np
import pytest

from michell_cad.curves import Curve, CurveKind, Curves
from michell_cad.errors import InvalidInputError

LINE = Curve(CurveKind.INTERIOR, "third", 1, (4, None, -7), 2, np.array([5, 0, 3]), np.array([1, 0]), False)
RING = Curve(CurveKind.BOUNDARY, "tension", 0, (None, 0, None), 0, np.array([2, 1, 4]), np.array([2, 4, 3]), True)
EDGE = Curve(CurveKind.FEATURE, "feature", -1, (None,) * 3, 1, np.array([3, 6]), np.array([5]), False)


def as_tuple(curve: Curve) -> tuple:
    label = (curve.kind, curve.family, curve.axis, curve.isovalues, curve.component, curve.closed)
    return *label, curve.nodes.tolist(), curve.members.tolist()


def test_curves_as_arrays_are_the_same_curves() -> None:
    given = [LINE, RING, EDGE, LINE]
    curves = Curves.of(given)
    assert len(curves) == 4
    assert [as_tuple(curve) for curve in curves] == [as_tuple(curve) for curve in given]
    assert as_tuple(curves[-1]) == as_tuple(LINE)
    assert [as_tuple(curve) for curve in curves[1:3]] == [as_tuple(RING), as_tuple(EDGE)]
    assert curves[0].nodes.base is curves.nodes
    assert curves.index(curves[2]) == 2
    with pytest.raises(ValueError, match="read-only"):
        curves[0].nodes[0] = 1


def test_there_may_be_no_curves() -> None:
    curves = Curves.of([])
    assert list(curves) == []
    assert curves.nodes.shape == (0,)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("closed", [False, False], "first curve 1"),
        ("node_offsets", [0, 3, 5], "from 0 to 6"),
        ("kinds", [0, 3], "numbers of"),
    ],
)
def test_arrays_that_do_not_fit_together_are_refused(field: str, value: list, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        replace(Curves.of([LINE, RING]), **{field: np.array(value)})
