"""Choosing some of the curves of a truss: the others go, and so do the crossings with them.

Keeping every n-th curve is the density knob of Arora et al. 2019 (Section 6). The reference leaves the crossing nodes
in place as nodes of two members; here they are dissolved into the curves that run through them and live on as
waypoints, so that a member runs from one real node to the next.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Int

from michell_cad.arrays import expand, require
from michell_cad.curves import Curve, NodeKind
from michell_cad.isocurves.chains import Chains, order_chains
from michell_cad.truss.values import Truss, curve_steps


def keep_curves(truss: Truss, mask: Bool[np.ndarray, " n_curves"]) -> Truss:
    """Keep the curves in `mask`: drop the others, the members that only they cover, and the nodes no longer needed.

    A node is dissolved when it has two members left, both on the same curves, unless it is a corner or the end of one
    of these curves. Its position becomes a waypoint of the member that replaces the two. Nodes are kept where a member
    would otherwise join a node with itself, or the same two nodes as another one. Labels do not change.

    Parameters
    ----------
    truss : Truss
    mask : (n_curves,) bool.

    Raises
    ------
    InvalidInputError
        If `mask` has another length than the curves, or keeps none.
    """
    require(len(mask) == len(truss.curves), f"mask must have {len(truss.curves)} entries, found {len(mask)}")
    require(mask.any(), "mask must keep at least one curve")
    curves = tuple(curve for curve, keep in zip(truss.curves, mask, strict=True) if keep)
    used = np.unique(curve_steps(curves)[2])
    passing = _passing_nodes(truss, curves, used)
    while True:
        chains = _chain_members(truss, used, passing)
        needed = _nodes_for_simple_members(truss, used, chains)
        if not len(needed):
            return _dissolve(truss, curves, used, chains)
        passing[needed] = False


def _passing_nodes(truss: Truss, curves: tuple[Curve, ...], used: np.ndarray) -> np.ndarray:
    """Nodes (as a mask) with exactly two used members, on the same curves, none of which ends there."""
    n_n, n_m = len(truss.nodes), len(truss.members)
    ends = truss.members[used]
    passing = (np.bincount(ends.ravel(), minlength=n_n) == 2) & (truss.node_kinds != NodeKind.CORNER)
    tips = [curve.nodes[[0, -1]] for curve in curves if not curve.closed]
    passing[np.concatenate([np.zeros(0, np.int64), *tips])] = False
    # Members on the same curves: number the sets of curves (a curve that runs twice along a member counts once).
    sets: list[list[int]] = [[] for _ in range(n_m)]
    for number, curve in enumerate(curves):
        for member in set(curve.members.tolist()):
            sets[member].append(number)
    names: dict[tuple[int, ...], int] = {}
    name = np.array([names.setdefault(tuple(members), len(names)) for members in sets])
    lowest, highest = np.full(n_n, len(names)), np.full(n_n, -1)
    for column in range(2):
        np.minimum.at(lowest, ends[:, column], name[used])
        np.maximum.at(highest, ends[:, column], name[used])
    return passing & (lowest == highest)


def _chain_members(truss: Truss, used: np.ndarray, passing: np.ndarray) -> tuple[Chains, np.ndarray]:
    """Chains of used members through passing nodes, and the node at every chain vertex.

    Every end of a member at another node is a chain vertex of its own, so that chains end there.
    """
    ends = truss.members[used]
    through = passing[ends]
    nodes, vertex = np.unique(ends[through], return_inverse=True)
    chain_ends = np.empty_like(ends)
    chain_ends[through] = vertex
    chain_ends[~through] = len(nodes) + np.arange(np.count_nonzero(~through))
    return order_chains(len(nodes) + int(np.count_nonzero(~through)), chain_ends), np.concatenate(
        [nodes, ends[~through]]
    )


def _nodes_for_simple_members(truss: Truss, used: np.ndarray, made: tuple[Chains, np.ndarray]) -> np.ndarray:
    """Passing nodes to keep so that merged members join different nodes, and no two the same; empty if none is."""
    chains, node = made
    order = node[chains.order]
    first, last = chains.offsets[:-1], chains.offsets[1:] - 1
    a, b = order[first], order[last]
    loop = chains.closed | (a == b)
    needed = [order[_inner(chains, c)] for c in np.flatnonzero(loop).tolist()]
    pair = np.sort(np.stack([a, b], axis=1), axis=1)[~loop]
    simple = np.flatnonzero(~loop)
    _, inverse, counts = np.unique(pair[:, 0] * len(truss.nodes) + pair[:, 1], return_inverse=True, return_counts=True)
    # Of several members between two nodes the one with the fewest nodes stays as it is.
    sizes = (last - first)[simple]
    by_size = np.lexsort((sizes, inverse))
    place = np.arange(len(by_size)) - (np.cumsum(counts) - counts)[inverse[by_size]]
    for c in simple[by_size[place > 0]]:
        between = order[first[c] + 1 : last[c]]
        needed.append(between[[len(between) // 2]])
    return np.unique(np.concatenate([np.zeros(0, np.int64), *needed]))


def _inner(chains: Chains, c: int) -> np.ndarray:
    """Entries of two (of a closed chain: three) nodes that divide a loop in three."""
    first, n = chains.offsets[c], chains.offsets[c + 1] - chains.offsets[c]
    if chains.closed[c]:
        return first + np.array([0, n // 3, (2 * n) // 3])
    return first + np.array([(n - 1) // 3, (2 * (n - 1)) // 3])


def _dissolve(truss: Truss, curves: tuple[Curve, ...], used: np.ndarray, made: tuple[Chains, np.ndarray]) -> Truss:
    """Replace every chain of members by one member."""
    chains, node = made
    order = node[chains.order]
    a, b = order[chains.offsets[:-1]], order[chains.offsets[1:] - 1]
    members = np.sort(np.stack([a, b], axis=1), axis=1)
    kept_nodes = np.unique(members)
    sorting = np.lexsort((members[:, 1], members[:, 0]))
    number = np.empty(len(sorting), np.int64)
    number[sorting] = np.arange(len(sorting))
    merged = np.full(len(truss.members), -1)
    walked = chains.next_edge >= 0
    merged[used[chains.next_edge[walked]]] = number[chains.chain[walked]]
    points, counts = _waypoints(truss, used, chains, order, a > b)
    first = np.cumsum(counts) - counts
    owner, local = expand(counts[sorting])
    waypoints = points[first[sorting][owner] + local]
    renamed = np.full(len(truss.nodes), -1)
    renamed[kept_nodes] = np.arange(len(kept_nodes))
    return Truss(
        truss.nodes[kept_nodes],
        truss.node_kinds[kept_nodes],
        renamed[members[sorting]],
        tuple(_follow(curve, renamed, merged) for curve in curves),
        truss.spacing,
        waypoints,
        np.concatenate([[0], np.cumsum(counts[sorting])]),
    )


def _waypoints(
    truss: Truss, used: np.ndarray, chains: Chains, order: np.ndarray, reverse: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Waypoints of the merged members, in order from their lower to their higher node, and how many each has."""
    walked = np.flatnonzero(chains.next_edge >= 0)
    member = used[chains.next_edge[walked]]
    start = order[walked]
    offsets = np.asarray(truss.waypoint_offsets)
    counts = np.diff(offsets)[member]
    # Every step gives the waypoints of its member, and then its end node, which is dropped at the end of the chain.
    step, local = expand(counts + 1)
    is_node = local == counts[step]
    position = np.where(truss.members[member[step], 0] == start[step], local, counts[step] - 1 - local)
    points = np.empty((len(step), 3))
    waypoints = np.asarray(truss.waypoints)
    points[~is_node] = waypoints[(offsets[member[step]] + position)[~is_node]]
    points[is_node] = truss.nodes[order[walked[step[is_node]] + 1]]
    chain = chains.chain[walked[step]]
    last = np.append(chain[1:] != chain[:-1], True)
    points, chain = points[~last], chain[~last]
    sizes = np.bincount(chain, minlength=len(chains.closed))
    first = np.cumsum(sizes) - sizes
    place = np.arange(len(chain)) - first[chain]
    return points[first[chain] + np.where(reverse[chain], sizes[chain] - 1 - place, place)], sizes


def _follow(curve: Curve, renamed: Int[np.ndarray, " n"], merged: Int[np.ndarray, " m"]) -> Curve:
    """The curve through the nodes that are left, along the merged members."""
    stays = renamed[curve.nodes] >= 0
    nodes, members = curve.nodes, curve.members
    if curve.closed:
        head = int(np.argmax(stays))
        nodes, members, stays = np.roll(nodes, -head), np.roll(members, -head), np.roll(stays, -head)
    return replace(curve, nodes=renamed[nodes[stays]], members=merged[members[stays[: len(members)]]])
