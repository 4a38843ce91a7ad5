"""From chains of segments to curves through nodes: one pass over all kinds of curves.

A chain alternates between its vertices (where a curve crosses a face or edge of the mesh) and the nodes inside its
segments. Some vertices are nodes themselves. Members run from node to node; the other vertices are the points of their
paths.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from michell_cad.isocurves.chains import Chains
from michell_cad.isocurves.interior import Segments
from michell_cad.isocurves.lattice import expand


@dataclass(frozen=True, eq=False)
class WovenCurves:
    """Curves through nodes; members are numbered along the curves, curve after curve.

    Parameters
    ----------
    chain : (n_c,) int, the chain of each curve. Chains without a node make no curve.
    closed : (n_c,) bool.
    nodes : nodes along the curves; those of curve c are ``nodes[node_offsets[c] : node_offsets[c + 1]]``. A closed
        curve does not repeat its first node.
    members : (n_m, 2) int, the nodes of each member, in the direction of its curve.
    member_offsets : (n_c + 1,) int.
    path : chain vertices along the members; those of member m are ``path[path_offsets[m] : path_offsets[m + 1]]``.
    """

    chain: Int[np.ndarray, " n_c"]
    closed: Bool[np.ndarray, " n_c"]
    nodes: Int[np.ndarray, " k"]
    node_offsets: Int[np.ndarray, " n_c1"]
    members: Int[np.ndarray, "n_m 2"]
    member_offsets: Int[np.ndarray, " n_c1"]
    path: Int[np.ndarray, " p"]
    path_offsets: Int[np.ndarray, " n_m1"]


def weave_curves(
    chains: Chains,
    segments: Segments,
    vertex_nodes: Int[np.ndarray, " n"],
    vertex_points: Float[np.ndarray, "n 3"],
    labels: Int[np.ndarray, "n_c k"],
    axes: Int[np.ndarray, " n_c"],
    levels: Float[np.ndarray, "n_n 3"],
) -> WovenCurves:
    """Join nodes by members along every chain, in an order and direction that do not depend on the mesh's numbering.

    Curves are sorted by their labels, then their nodes, then their place. An open curve runs towards growing level
    of its axis (a feature curve, of axis -1, from its lower to its higher end node), a closed one from its lowest node
    to the lower of the two neighbours.

    Parameters
    ----------
    vertex_nodes : node at each chain vertex, or -1.
    vertex_points : mm; they decide where the nodes do not (two curves through the same nodes, loops of two nodes).
    labels, axes : of each chain.
    levels : of each node.
    """
    items, nodes, offsets = _items(chains, segments, vertex_nodes)
    start, reverse, ends = _orient(nodes, offsets, chains.closed, axes, levels)
    # The neighbours of a node are the same on both sides of a closed curve with one or two nodes.
    for c in np.flatnonzero(chains.closed & (ends[:, 0] >= 0) & (ends[:, 1] == ends[:, 2])):
        ring = np.roll(items[offsets[c] : offsets[c + 1]], offsets[c] - start[c])[1:]
        passed = vertex_points[ring[ring >= 0]]
        reverse[c] = tuple(passed[-1]) < tuple(passed[0])
    used = np.flatnonzero(ends[:, 0] >= 0)
    keys = (labels[used], ends[used], _places(chains, vertex_points)[used])
    used = used[np.lexsort(np.concatenate([key.T[::-1] for key in reversed(keys)]))]
    # Walk every used chain from its first node on, in its direction.
    lengths = np.diff(offsets)[used]
    curve, local = expand(lengths)
    walk = start[used] - offsets[used]
    turned = (walk[curve] + np.where(reverse[used], -1, 1)[curve] * local) % lengths[curve]
    items, nodes = (array[offsets[used][curve] + turned] for array in (items, nodes))
    return _join(items, nodes, curve, used, chains.closed[used])


def _items(chains: Chains, segments: Segments, vertex_nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All points of all chains in order: the chain vertex (or -1), the node (or -1), and the offsets of the chains."""
    sizes = np.diff(segments.node_offsets)
    counts = np.where(chains.next_edge >= 0, sizes[chains.next_edge], 0) if len(sizes) else np.zeros_like(chains.order)
    first = np.cumsum(counts + 1) - (counts + 1)
    total = len(counts) + int(counts.sum())
    items, nodes = np.full(total, -1), np.full(total, -1)
    items[first] = chains.order
    nodes[first] = vertex_nodes[chains.order]
    place, local = expand(counts)
    edge = chains.next_edge[place]
    forward = segments.ends[edge, 0] == chains.order[place]
    position = np.where(forward, local, sizes[edge] - 1 - local)
    nodes[first[place] + 1 + local] = segments.nodes[segments.node_offsets[edge] + position]
    return items, nodes, np.append(first, total)[chains.offsets]


def _orient(
    nodes: np.ndarray, offsets: np.ndarray, closed: np.ndarray, axes: np.ndarray, levels: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First item and reversal of every chain, and its first, second and last node in that direction (-1: no node).

    The last node of a closed chain is the one before its first.
    """
    n_c = len(closed)
    chain = np.repeat(np.arange(n_c), np.diff(offsets))
    place = np.flatnonzero(nodes >= 0)
    chain_of_node = chain[place]
    counts = np.bincount(chain_of_node, minlength=n_c)
    first = np.cumsum(counts) - counts
    some = np.flatnonzero(counts)
    # Position of the lowest node among the nodes of each chain.
    lowest = np.zeros(n_c, np.int64)
    by_node = np.lexsort((nodes[place], chain_of_node))
    lowest[some] = by_node[first[some]] - first[some]

    def node(position: np.ndarray) -> np.ndarray:
        """The node at a (cyclic) position along each chain that has nodes."""
        return nodes[place[first[some] + position % counts[some]]]

    is_closed = closed[some]
    low = lowest[some]
    head = np.where(is_closed, low, 0)
    after = np.where(is_closed, node(low + 1), node(np.zeros_like(low) + 1))
    before = np.where(is_closed, node(low - 1), node(np.zeros_like(low) - 2))
    begin, end = node(head), np.where(is_closed, before, node(np.zeros_like(low) - 1))
    along = np.where(axes[some] >= 0, levels[end, axes[some]] - levels[begin, axes[some]], 0.0)
    by_ends = np.where(along != 0, along < 0, end < begin)
    backward = np.where(is_closed | (begin == end), before < after, by_ends)
    start, reverse, ends = np.zeros(n_c, np.int64), np.zeros(n_c, bool), np.full((n_c, 3), -1)
    start[some] = place[first[some] + np.where(is_closed, low, np.where(backward, counts[some] - 1, 0))]
    reverse[some] = backward
    forward_ends = np.stack([begin, after, end], axis=1)
    backward_ends = np.stack([np.where(is_closed, begin, end), before, np.where(is_closed, after, begin)], axis=1)
    ends[some] = np.where(backward[:, None], backward_ends, forward_ends)
    return start, reverse, ends


def _places(chains: Chains, vertex_points: np.ndarray) -> np.ndarray:
    """Mean of the vertices of each chain, relative to the size of the part and rounded beyond the noise."""
    size = np.ptp(vertex_points, axis=0).max() if len(vertex_points) else 1.0
    places = np.zeros((len(chains.closed), 3))
    np.add.at(places, chains.chain, vertex_points[chains.order])
    return np.round(places / np.diff(chains.offsets)[:, None] / max(size, np.finfo(float).tiny), 9)


def _join(
    items: np.ndarray, nodes: np.ndarray, curve: np.ndarray, chain: np.ndarray, closed: np.ndarray
) -> WovenCurves:
    """Members between the nodes of curves that all begin (and, if open, end) with a node."""
    n_c = len(chain)
    place = np.flatnonzero(nodes >= 0)
    node_counts = np.bincount(curve[place], minlength=n_c)
    node_offsets = np.concatenate([[0], np.cumsum(node_counts)])
    sequence = nodes[place]
    following = np.arange(1, len(sequence) + 1)
    following[node_offsets[1:] - 1] = node_offsets[:-1]
    begins = np.ones(len(sequence), bool)
    begins[node_offsets[1:][~closed] - 1] = False
    members = np.stack([sequence, sequence[following % max(len(sequence), 1)]], axis=1)[begins]
    member_offsets = np.concatenate([[0], np.cumsum(node_counts - ~closed)])
    member_of_node = np.cumsum(begins) - 1
    inner = np.flatnonzero(nodes < 0)
    member = member_of_node[np.searchsorted(place, inner) - 1]
    path_offsets = np.concatenate([[0], np.cumsum(np.bincount(member, minlength=len(members)))])
    return WovenCurves(chain, closed, sequence, node_offsets, members, member_offsets, items[inner], path_offsets)
