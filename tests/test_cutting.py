import numpy as np
import pytest
from layouts import grid_truss

from michell_cad.curves import Curve, CurveKind
from michell_cad.errors import InvalidInputError
from michell_cad.truss import Truss, keep_members, open_ends, without_loose
from michell_cad.truss.cutting import cut_curves

GRID = grid_truss((5, 3, 3), warp=0.0)


def test_a_curve_without_its_middle_is_two_with_labels_of_their_own():
    curve = next(c for c in GRID.curves if len(c.members) == 4)
    kept = np.ones(len(GRID.members), bool)
    kept[curve.members[1:3]] = False
    truss = keep_members(GRID, kept)
    pieces = [c for c in truss.curves if c.isovalues == curve.isovalues]
    assert [c.component for c in pieces] == [0, 1]
    assert [len(c.members) for c in pieces] == [1, 1]
    assert len(truss.members) == len(GRID.members) - 2


def test_a_ring_that_is_cut_opens_behind_the_cut():
    ring = Curve(CurveKind.INTERIOR, "tension", 0, (None, 1, 1), 0, np.arange(5), np.arange(5), True)
    kept = np.array([True, True, False, True, True])
    (piece,) = cut_curves([ring], kept)
    assert not piece.closed
    assert piece.nodes.tolist() == [3, 4, 0, 1, 2]
    assert piece.members.tolist() == [3, 4, 0, 1]


def test_what_hangs_loose_goes_up_to_the_next_node_that_is_held():
    nodes = np.arange(6)[:, None] * np.array([1.0, 0, 0])
    nodes = np.concatenate([nodes, [[2.0, 1, 0], [3.0, 1, 0]]])
    members = np.array([(0, 1), (1, 2), (2, 3), (2, 6), (3, 4), (3, 7), (4, 5), (6, 7)])
    rows = [(np.arange(6), [0, 1, 2, 4, 6]), (np.array([2, 6, 7, 3]), [3, 7, 5])]
    curves = tuple(
        Curve(CurveKind.INTERIOR, "tension", 0, (None, k, 0), 0, row, np.array(m), False)
        for k, (row, m) in enumerate(rows)
    )
    truss = Truss(nodes, np.zeros(8, int), members, curves, 1.0)
    assert open_ends(truss).tolist() == [0, 5]
    everything, nothing = np.ones(8, bool), np.zeros(8, bool)
    assert without_loose(truss, everything, nothing).tolist() == [False, False, True, True, False, True, False, True]
    assert without_loose(truss, everything, stays=np.arange(8) == 5).tolist()[4:7] == [True, True, True]


def test_nothing_left_is_refused():
    with pytest.raises(InvalidInputError, match="nothing would be left"):
        keep_members(GRID, np.zeros(len(GRID.members), bool))
