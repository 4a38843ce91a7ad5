from dataclasses import replace

import numpy as np
import pytest
from frames import STEEL, frame, loading
from shapes import cantilever

from michell_cad.errors import InvalidInputError
from michell_cad.strength import build_beam_model, keep_supported, solve_beams
from michell_cad.strength.mechanism import find_loose_parts

NODES = [[0, 0, 0], [80, 20, 20], [40, 30, 30], [60, 30, 30], [60, 10, 30], [10, 5, 5]]
MEMBERS = [(0, 1), (2, 3), (3, 4), (1, 5)]


def test_a_loose_part_is_found_with_its_motions():
    held = loading(6, [0], {1: np.ones(6)}).held
    (part,) = find_loose_parts(frame(NODES, MEMBERS).truss, held)
    np.testing.assert_array_equal(part.members, [1, 2])
    assert len(part.motions) == 6


def test_a_bar_on_a_pin_and_a_slide_turns_about_itself():
    held = loading(2, {0: (0, 1, 2), 1: (1, 2)}, {1: np.ones(6)}).held
    (part,) = find_loose_parts(frame([[0, 0, 0], [5, 0, 0]], [(0, 1)]).truss, held)
    assert part.motions == ("it can turn about x",)


def test_the_message_names_the_loose_part():
    model = build_beam_model(frame(NODES, MEMBERS), STEEL)
    with pytest.raises(InvalidInputError) as error:
        solve_beams(model, loading(6, [0], {1: np.ones(6)}))
    assert "mechanism, 1 of its connected parts can move" in str(error.value)
    assert r"feature (*, *, *) #1 and 1 more, 2 members around (55, 25, 30) mm: it can move along" in str(error.value)


def test_loose_parts_are_left_out_on_request():
    truss = frame(NODES, MEMBERS).truss
    kept = keep_supported(cantilever((4, 2, 2)), truss)
    np.testing.assert_array_equal(kept.nodes, truss.nodes[[0, 1, 5]])
    assert [curve.component for curve in kept.curves] == [0, 3]


def test_a_truss_that_hangs_on_nothing_is_refused():
    """Held at three vertices, with a bar between two of them, which can turn about itself."""
    problem = cantilever((4, 2, 2))
    V = problem.mesh.vertices
    corners = np.array([[0, 0, 0], [80, 0, 0], [0, 40, 40]])
    fixed = np.repeat((V[:, None] == corners).all(2).any(1)[:, None], 3, axis=1)
    problem = replace(problem, fixed=fixed)
    with pytest.raises(InvalidInputError, match=r"no part of the truss is supported: .* it can turn about x"):
        keep_supported(problem, frame(corners[:2], [(0, 1)]).truss)
