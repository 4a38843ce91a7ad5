"""Chains: paths and loops of a graph whose vertices have at most two edges, each in order from end to end."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Int

from michell_cad.compiled import compiled


@dataclass(frozen=True, eq=False)
class Chains:
    """Vertices of a graph in the order of its chains.

    Parameters
    ----------
    order : (n,) int, all vertices, chain after chain; those of chain c are ``offsets[c] : offsets[c + 1]``.
    offsets : (n_c + 1,) int.
    next_edge : (n,) int, edge from each entry of `order` to the following one; at the end of a chain the edge back to
        its first vertex if it is closed, else -1.
    closed : (n_c,) bool.
    """

    order: Int[np.ndarray, " n"]
    offsets: Int[np.ndarray, " n_c1"]
    next_edge: Int[np.ndarray, " n"]
    closed: Bool[np.ndarray, " n_c"]

    @property
    def chain(self) -> Int[np.ndarray, " n"]:
        """Chain of each entry of `order`."""
        return np.repeat(np.arange(len(self.closed)), np.diff(self.offsets))


def order_chains(n: int, ends: Int[np.ndarray, "m 2"]) -> Chains:
    """Put the vertices of a graph of paths and loops in order, in time linear in its size.

    Chains are in the order of their lowest vertices. A path begins at its lower end, a loop with its lowest edge last.

    Parameters
    ----------
    n : number of vertices.
    ends : (m, 2) int, the two vertices of each edge. No vertex has more than two; double edges and edges from a vertex
        to itself are loops of two and one vertices.
    """
    order, next_edge = np.empty(n, np.int32), np.empty(n, np.int32)
    offsets, closed = np.zeros(n + 1, np.int64), np.empty(n, bool)
    n_c = walk_chains(ends, order, next_edge, offsets, closed)
    assert n_c >= 0, "a vertex of a chain has more than two edges"
    return Chains(order, offsets[: n_c + 1].copy(), next_edge, closed[:n_c].copy())


def _walk_chains(ends: Any, order: Any, next_edge: Any, offsets: Any, closed: Any) -> int:
    """Fill the arrays of `Chains`; return the number of chains, -1 if a vertex has more than two edges."""
    n = len(order)
    edges = np.full((n, 2), -1, np.int32)
    for e in range(len(ends)):
        for side in range(2):
            v = ends[e, side]
            if edges[v, 1] >= 0:
                return -1
            edges[v, 1 if edges[v, 0] >= 0 else 0] = e
    placed = np.zeros(n, np.bool_)
    n_c, place = 0, 0
    for lowest in range(n):
        if placed[lowest]:
            continue
        # Look both ways for an end of the path, or all round the loop for its lowest edge.
        start, edge, is_loop = find_start(ends, edges, lowest)
        closed[n_c] = is_loop
        v = start
        while True:
            order[place], next_edge[place] = v, edge
            placed[v] = True
            place += 1
            if edge < 0:
                break
            v = ends[edge, 0] + ends[edge, 1] - v
            if v == start:
                break
            edge = edges[v, 1] if edges[v, 0] == edge else edges[v, 0]
        n_c += 1
        offsets[n_c] = place
    return n_c


def _find_start(ends: Any, edges: Any, lowest: int) -> tuple[int, int, bool]:
    """First vertex and edge of the chain of a vertex, and whether it is a loop."""
    tips = np.empty(2, np.int64)
    for way in range(2):
        v, edge, lowest_edge = lowest, edges[lowest, way], len(ends)
        while edge >= 0:
            lowest_edge = min(lowest_edge, edge)
            v = ends[edge, 0] + ends[edge, 1] - v
            if v == lowest:
                start = ends[lowest_edge, 0]
                return start, edges[start, 1] if edges[start, 0] == lowest_edge else edges[start, 0], True
            edge = edges[v, 1] if edges[v, 0] == edge else edges[v, 0]
        tips[way] = v
    start = min(tips[0], tips[1])
    return start, edges[start, 0], False


find_start = compiled(_find_start)
walk_chains = compiled(_walk_chains)
