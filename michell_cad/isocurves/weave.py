"""From chains of segments to curves through nodes: one pass over all kinds of curves.

A chain alternates between its vertices (where a curve crosses a face or edge of the mesh) and the nodes inside its
segments. Some vertices are nodes themselves. Members run from node to node; the other vertices are the points of their
paths.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from michell_cad.arrays import same_as_previous
from michell_cad.compiled import compiled
from michell_cad.curves import NO_ISOVALUE
from michell_cad.isocurves.chains import Chains
from michell_cad.isocurves.interior import Segments
from michell_cad.isocurves.lattice import lexicographic_order


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
    n_c = len(chains.closed)
    size = len(chains.order) + len(segments.nodes)
    items, nodes, offsets = np.empty(size, np.int64), np.empty(size, np.int64), np.empty(n_c + 1, np.int64)
    parts = (segments.ends, segments.node_offsets, segments.nodes)
    lay_out(chains.order, chains.offsets, chains.next_edge, *parts, vertex_nodes, items, nodes, offsets)
    start, reverse, counts = np.zeros(n_c, np.int64), np.zeros(n_c, bool), np.empty(n_c, np.int64)
    ends = np.full((n_c, 3), -1)
    orient_chains(nodes, offsets, chains.closed, axes, levels, start, reverse, counts, ends)
    # The neighbours of a node are the same on both sides of a closed curve with one or two nodes.
    for c in np.flatnonzero(chains.closed & (counts > 0) & (ends[:, 1] == ends[:, 2])):
        ring = np.roll(items[offsets[c] : offsets[c + 1]], offsets[c] - start[c])[1:]
        passed = vertex_points[ring[ring >= 0]]
        reverse[c] = tuple(passed[-1]) < tuple(passed[0])
    used = np.flatnonzero(counts)
    used = used[_order_curves(chains, used, np.column_stack([labels[used], ends[used]]), vertex_points)]
    closed, counts = chains.closed[used], counts[used]
    n_m, n_n = int((counts - ~closed).sum()), int(counts.sum())
    sequence, members = np.empty(n_n, np.int64), np.empty((n_m, 2), np.int64)
    path, path_offsets = np.empty(size - n_n, np.int64), np.zeros(n_m + 1, np.int64)
    walk_curves(items, nodes, offsets, used, start, reverse, closed, sequence, members, path, path_offsets)
    node_offsets = np.concatenate([[0], np.cumsum(counts)])
    member_offsets = np.concatenate([[0], np.cumsum(counts - ~closed)])
    path = path[: path_offsets[-1]]
    return WovenCurves(used, closed, sequence, node_offsets, members, member_offsets, path, path_offsets)


def _order_curves(
    chains: Chains, used: Int[np.ndarray, " u"], keys: Int[np.ndarray, "u k"], vertex_points: Float[np.ndarray, "n 3"]
) -> Int[np.ndarray, " u"]:
    """Order of chains by their keys, and where these are equal by the mean of their vertices.

    The mean is relative to the size of the part and rounded beyond the noise.
    """
    # Kind, isovalues and first node nearly always decide, and fit in one number.
    first, given = keys[:, :5], keys[:, :5] != NO_ISOVALUE
    order = lexicographic_order(np.where(given, first, first.max(initial=0, where=given) + 1))
    if same_as_previous(first[order]).any():
        order = np.lexsort(keys.T[::-1])
    same = same_as_previous(keys[order])
    tied = np.union1d(order[1:][same], order[:-1][same])
    if not len(tied):
        return order
    size = max(*(np.ptp(column) for column in vertex_points.T), np.finfo(float).tiny)
    places = np.zeros((len(used), 3))
    for c in tied:
        vertices = chains.order[chains.offsets[used[c]] : chains.offsets[used[c] + 1]]
        places[c] = np.round(vertex_points[vertices].mean(0) / size, 9)
    return np.lexsort((*places.T[::-1], *keys.T[::-1]))


def _lay_out(
    order: Any,
    chain_offsets: Any,
    next_edge: Any,
    segment_ends: Any,
    node_offsets: Any,
    segment_nodes: Any,
    vertex_nodes: Any,
    items: Any,
    nodes: Any,
    offsets: Any,
) -> None:
    """All points of all chains in order: the chain vertex (or -1), the node (or -1), and the offsets of the chains."""
    at = 0
    for c in range(len(chain_offsets) - 1):
        offsets[c] = at
        for place in range(chain_offsets[c], chain_offsets[c + 1]):
            vertex, edge = order[place], next_edge[place]
            items[at], nodes[at] = vertex, vertex_nodes[vertex]
            at += 1
            if edge < 0:
                continue
            low, high = node_offsets[edge], node_offsets[edge + 1]
            forward = segment_ends[edge, 0] == vertex
            for local in range(high - low):
                items[at] = -1
                nodes[at] = segment_nodes[low + local if forward else high - 1 - local]
                at += 1
    offsets[len(chain_offsets) - 1] = at


def _orient_chains(
    nodes: Any,
    offsets: Any,
    closed: Any,
    axes: Any,
    levels: Any,
    start: Any,
    reverse: Any,
    counts: Any,
    ends: Any,
) -> None:
    """First point and reversal of every chain, its number of nodes, and its first, second and last in that direction.

    The last node of a closed chain is the one before its first. Chains without nodes are left as they are.
    """
    places = np.empty(len(nodes), np.int64)  # of the nodes of one chain
    for c in range(len(closed)):
        n, lowest = 0, 0
        for place in range(offsets[c], offsets[c + 1]):
            if nodes[place] >= 0:
                places[n] = place
                if nodes[place] < nodes[places[lowest]]:
                    lowest = n
                n += 1
        counts[c] = n
        if n == 0:
            continue
        first = lowest if closed[c] else 0
        begin, after = nodes[places[first]], nodes[places[(first + 1) % n]]
        end = nodes[places[(first - 1) % n]]
        before = end if closed[c] else nodes[places[(n - 2) % n]]
        if closed[c] or begin == end:
            reverse[c] = before < after
        else:
            rise = levels[end, axes[c]] - levels[begin, axes[c]] if axes[c] >= 0 else 0.0
            reverse[c] = rise < 0 if rise != 0 else end < begin
        if not reverse[c]:
            start[c] = places[first]
            ends[c, 0], ends[c, 1], ends[c, 2] = begin, after, end
        elif closed[c]:
            start[c] = places[first]
            ends[c, 0], ends[c, 1], ends[c, 2] = begin, before, after
        else:
            start[c] = places[n - 1]
            ends[c, 0], ends[c, 1], ends[c, 2] = end, before, begin


def _walk_curves(
    items: Any,
    nodes: Any,
    offsets: Any,
    used: Any,
    start: Any,
    reverse: Any,
    closed: Any,
    sequence: Any,
    members: Any,
    path: Any,
    path_offsets: Any,
) -> None:
    """Walk each used chain from its first node on, in its direction; fill the arrays of `WovenCurves`.

    Every curve begins, and if it is open ends, with a node.
    """
    n, m, at = 0, 0, 0
    for number in range(len(used)):
        c = used[number]
        size = offsets[c + 1] - offsets[c]
        place, first = start[c], n
        for _ in range(size):
            if nodes[place] < 0:
                path[at] = items[place]
                at += 1
            else:
                sequence[n] = nodes[place]
                if n > first:
                    members[m, 0], members[m, 1] = sequence[n - 1], sequence[n]
                    m += 1
                    path_offsets[m] = at
                n += 1
            if reverse[c]:
                place = place - 1 if place > offsets[c] else offsets[c + 1] - 1
            else:
                place = place + 1 if place + 1 < offsets[c + 1] else offsets[c]
        if closed[number]:
            members[m, 0], members[m, 1] = sequence[n - 1], sequence[first]
            m += 1
            path_offsets[m] = at


lay_out = compiled(_lay_out)
orient_chains = compiled(_orient_chains)
walk_curves = compiled(_walk_curves)
