"""Chains against paths and loops made by hand and shuffled."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from michell_cad.isocurves.chains import order_chains


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.integers(1, 9), st.booleans()), max_size=12), st.integers(0, 2**32 - 1))
def test_shuffled_paths_and_loops_come_back_in_order(shapes: list[tuple[int, bool]], seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = sum(size for size, _ in shapes)
    names = rng.permutation(n)
    edges, expected, first = [], [], 0
    for size, closed in shapes:
        ring = names[first : first + size]
        edges += list(pairwise(ring)) + ([(ring[-1], ring[0])] if closed else [])
        expected.append((sorted(ring.tolist()), closed))
        first += size
    ends = np.array(edges, int).reshape(-1, 2)[rng.permutation(len(edges))]
    flip = rng.random(len(ends)) < 0.5
    ends[flip] = ends[flip, ::-1]
    chains = order_chains(n, ends)
    parts = [chains.order[a:b] for a, b in zip(chains.offsets[:-1], chains.offsets[1:], strict=True)]
    assert sorted(expected) == sorted(
        (sorted(part.tolist()), bool(c)) for part, c in zip(parts, chains.closed, strict=True)
    )
    used = []
    for part, closed, a in zip(parts, chains.closed, chains.offsets, strict=False):
        for step, vertex in enumerate(part):
            edge = chains.next_edge[a + step]
            if step == len(part) - 1 and not closed:
                assert edge == -1
                continue
            assert sorted(ends[edge]) == sorted((vertex, part[(step + 1) % len(part)]))
            used.append(edge)
    assert sorted(used) == list(range(len(ends)))


def test_a_branch_is_no_chain() -> None:
    with pytest.raises(AssertionError, match="more than two"):
        order_chains(4, np.array([[0, 1], [0, 2], [0, 3]]))
