"""Chains: paths and loops of a graph whose vertices have at most two edges, each in order from end to end."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Int
from scipy.sparse.csgraph import breadth_first_order, connected_components


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

    Every loop is cut at one of its edges and the chains are tied end to start: the graph becomes one path, which a
    single breadth-first search walks from end to end.

    Parameters
    ----------
    n : number of vertices.
    ends : (m, 2) int, the two vertices of each edge. No vertex has more than two; double edges and edges from a vertex
        to itself are loops of two and one vertices.
    """
    if n == 0:
        empty = np.zeros(0, np.int64)
        return Chains(empty, np.zeros(1, np.int64), empty, np.zeros(0, bool))
    degree = np.bincount(ends.ravel(), minlength=n)
    assert degree.max(initial=0) <= 2, "a vertex of a chain has more than two edges"
    n_c, label = connected_components(_graph(n, ends), directed=False)
    loose = np.flatnonzero(degree < 2)
    start, finish, cut = (np.full(n_c, -1) for _ in range(3))
    start[label[loose[::-1]]] = loose[::-1]
    finish[label[loose]] = loose
    closed = start < 0
    cut[label[ends[::-1, 0]]] = np.arange(len(ends))[::-1]
    cut = cut[closed]
    start[closed], finish[closed] = ends[cut].T
    kept = np.ones(len(ends), bool)
    kept[cut] = False
    ties = np.stack([finish[:-1], start[1:]], axis=1)
    path = _graph(n, np.concatenate([ends[kept], ties]))
    order = breadth_first_order(path, start[0], directed=False, return_predecessors=False).astype(np.int64)
    place = np.empty(n, np.int64)
    place[order] = np.arange(n)
    next_edge = np.full(n, -1)
    next_edge[place[ends[kept]].min(1)] = np.flatnonzero(kept)
    offsets = np.concatenate([[0], np.cumsum(np.bincount(label, minlength=n_c))])
    next_edge[offsets[1:][closed] - 1] = cut
    return Chains(order, offsets, next_edge, closed)


def _graph(n: int, ends: np.ndarray) -> sp.csr_matrix:
    return sp.csr_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(n, n))
