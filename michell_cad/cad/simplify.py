"""Merge nodes and reroute members of a truss that is too tight to be built; every curve keeps its label.

A curve is read as the row of nodes that it visits. Merging two nodes renames one of them; rerouting a member (i, k)
through node j replaces the step i, k by i, j, k. Steps from a node to itself and steps to and fro then vanish (at an
end of the row one way remains), and a member is whatever two neighbours of a row span. Of members that become one, the
thicker gives the radii.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Int

from michell_cad.arrays import expand, frozen
from michell_cad.truss import Curve, SizedTruss, Truss


@dataclass(frozen=True)
class Joint:
    """A new node at a place (mm), of a kind (`NodeKind`), through which members are led."""

    place: tuple[float, float, float]
    kind: int
    members: tuple[int, ...]


def simplify_truss(
    sized: SizedTruss,
    merges: Sequence[tuple[int, int]],
    detours: Sequence[tuple[int, int]],
    joints: Sequence[Joint] = (),
) -> tuple[SizedTruss, Int[np.ndarray, " n"]]:
    """Merge pairs of nodes, lead members through nodes, and join members in new nodes.

    Parameters
    ----------
    sized : the truss.
    merges : pairs of nodes, no node in two pairs. The more constrained node (corner, feature, boundary, interior)
        keeps its place; two alike meet halfway.
    detours : pairs (member, node).
    joints : new nodes; they are numbered after all others. No member is in a detour and a joint, or in two.

    Returns
    -------
    The truss without unused nodes, and for every old node, and then every joint, its new number (-1: gone without
    successor).
    """
    truss = sized.truss
    nodes, kinds, target = _merge_nodes(truss, merges)
    detours = [*detours, *((m, len(nodes) + j) for j, joint in enumerate(joints) for m in joint.members)]
    nodes = np.concatenate([nodes, np.array([joint.place for joint in joints]).reshape(-1, 3)])
    kinds = np.concatenate([kinds, np.array([joint.kind for joint in joints], kinds.dtype)])
    target = np.r_[target, np.arange(len(target), len(nodes))]
    members = target[truss.members]
    near = _near_changes(truss, merges, detours)
    spans = _Spans(sized, members, near)
    via = {}
    for member, j in detours:
        a, b = (int(x) for x in members[member])
        via[frozenset((a, b))] = int(target[j])
        spans.inherit(member, via[frozenset((a, b))])
    curves, rows, closed = [], [], []
    for curve, touched in zip(truss.curves, _touched_curves(truss, near), strict=True):
        row, ring = curve.nodes, curve.closed
        if touched:
            row, ring = _tidy(_detour(target[row].tolist(), ring, via), ring)
        if len(row) > 1:
            curves.append(curve)
            rows.append(np.asarray(row))
            closed.append(ring)
    new, number = _rebuild(sized, nodes, kinds, curves, _Rows.of(rows, closed), spans)
    return new, number[target]


def _near_changes(truss: Truss, merges, detours) -> np.ndarray:
    """Members (as a mask) with an end at a node that a change concerns: no other can change, or become one with one."""
    hot = np.zeros(len(truss.nodes), bool)
    hot[[i for pair in merges for i in pair]] = True
    hot[truss.members[[m for m, _ in detours]]] = True
    hot[[j for _, j in detours if j < len(hot)]] = True
    return np.asarray(hot[truss.members].any(1))


def _touched_curves(truss: Truss, near: np.ndarray) -> np.ndarray:
    """Curves (as a mask) that run along some of the members."""
    counts = np.array([len(curve.members) for curve in truss.curves])
    along = near[np.concatenate([curve.members for curve in truss.curves])]
    return np.add.reduceat(along.astype(int), np.cumsum(counts) - counts) > 0


class _Spans:
    """Radii and waypoints of members near a change by their two nodes, read from the lower to the higher node."""

    def __init__(self, sized: SizedTruss, members: np.ndarray, near: np.ndarray) -> None:
        self._sized, self._members = sized, members
        self.radii: dict[tuple[int, int], np.ndarray] = {}
        self.waypoints: dict[tuple[int, int], np.ndarray] = {}
        chosen = np.flatnonzero(near & (members[:, 0] != members[:, 1]))
        for m, (a, b) in zip(chosen.tolist(), members[chosen].tolist(), strict=True):
            self._put(a, b, sized.radii[m], self._points(m))
        self.far = np.flatnonzero(~near)

    def _points(self, m: int) -> np.ndarray:
        truss = self._sized.truss
        offsets = np.asarray(truss.waypoint_offsets)
        return np.asarray(truss.waypoints)[offsets[m] : offsets[m + 1]]

    def _put(self, a: int, b: int, radii: np.ndarray, points: np.ndarray) -> None:
        if a > b:
            a, b, radii, points = b, a, radii[::-1], points[::-1]
        old = self.radii.get((a, b))
        if old is None:
            self.radii[a, b], self.waypoints[a, b] = radii, points
        else:
            self.radii[a, b] = np.maximum(old, radii)

    def inherit(self, m: int, j: int) -> None:
        """Give the spans from node j to both ends of member m its radii, unless they exist."""
        a, b = (int(x) for x in self._members[m])
        r = self._sized.radii[m]
        for end, at_end in ((a, r[0]), (b, r[2])):
            low, high = min(end, j), max(end, j)
            if low != high and (low, high) not in self.radii:
                towards_j = np.array([at_end, (at_end + r[1]) / 2, r[1]])
                self.radii[low, high] = towards_j if end == low else towards_j[::-1]
                self.waypoints[low, high] = np.zeros((0, 3))

    def table(self, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Radii (n, 3) of spans from the lower to the higher nodes, their waypoints, and where those of each begin."""
        truss, n = self._sized.truss, int(high.max(initial=0)) + 1
        ends = self._members[self.far]
        key = ends[:, 0] * n + ends[:, 1]
        order = np.argsort(key)
        place = order[np.minimum(np.searchsorted(key, low * n + high, sorter=order), len(order) - 1)] if len(key) else 0
        is_far = (key[place] == low * n + high) if len(key) else np.zeros(len(low), bool)
        member = np.where(is_far, self.far[place] if len(key) else 0, 0)
        radii = np.array(self._sized.radii[member])
        offsets = np.asarray(truss.waypoint_offsets)
        counts = np.where(is_far, np.diff(offsets)[member], 0)
        near = np.flatnonzero(~is_far)
        keys = list(zip(low[near].tolist(), high[near].tolist(), strict=True))
        if keys:
            radii[near] = [self.radii[k] for k in keys]
            counts[near] = [len(self.waypoints[k]) for k in keys]
        starts = np.concatenate([[0], np.cumsum(counts)]).astype(int)
        points = np.zeros((starts[-1], 3))
        owner, local = expand(np.where(is_far, counts, 0))
        points[starts[owner] + local] = np.asarray(truss.waypoints)[offsets[member[owner]] + local]
        for i, k in zip(near.tolist(), keys, strict=True):
            points[starts[i] : starts[i + 1]] = self.waypoints[k]
        return radii, points, starts


@dataclass(frozen=True, eq=False)
class _Rows:
    """The nodes along all curves, one curve after the other, and whether each is closed."""

    nodes: np.ndarray
    offsets: np.ndarray
    closed: np.ndarray

    @staticmethod
    def of(rows: Sequence[np.ndarray], closed: Sequence[bool]) -> "_Rows":
        offsets = np.concatenate([[0], np.cumsum([len(row) for row in rows])]).astype(int)
        return _Rows(np.concatenate([np.zeros(0, int), *rows]), offsets, np.array(closed, bool))

    def steps(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Nodes at the start and the end of every step, and where the steps of each curve begin."""
        following = np.arange(1, len(self.nodes) + 1)
        last = self.offsets[1:] - 1
        following[last] = self.offsets[:-1]
        is_step = np.ones(len(self.nodes), bool)
        is_step[last[~self.closed]] = False
        starts = np.concatenate([[0], np.cumsum(np.diff(self.offsets) - ~self.closed)]).astype(int)
        return self.nodes[is_step], self.nodes[following[is_step]], starts


def _merge_nodes(truss: Truss, merges: Iterable[tuple[int, int]]):
    nodes, kinds = np.array(truss.nodes), np.array(truss.node_kinds)
    target = np.arange(len(nodes))
    for a, b in merges:
        keep, drop = (a, b) if (kinds[a], -a) >= (kinds[b], -b) else (b, a)
        if kinds[a] == kinds[b]:
            nodes[keep] = (nodes[a] + nodes[b]) / 2
        target[drop] = keep
    return nodes, kinds, target


def _detour(row: list[int], closed: bool, via: dict[frozenset, int]) -> list[int]:
    if not via:
        return row
    result = []
    following = row[1:] + (row[:1] if closed else [])
    for i, a in enumerate(row):
        result.append(a)
        if i < len(following):
            j = via.get(frozenset((a, following[i])))
            if j is not None:
                result.append(j)
    return result


def _tidy(row: list[int], closed: bool) -> tuple[list[int], bool]:
    """Drop steps that stay, and steps to and fro; of those at an end of the row, or of a flat ring, keep one way."""
    stays = [node for i, node in enumerate(row) if i == 0 or row[i - 1] != node]
    while closed and len(stays) > 1 and stays[0] == stays[-1]:
        stays.pop()
    if closed and len(set(stays)) <= 2:
        return stays[:2], False
    if not closed:
        while len(stays) > 2 and stays[0] == stays[2]:
            stays.pop(0)
        while len(stays) > 2 and stays[-1] == stays[-3]:
            stays.pop()
    result: list[int] = []
    for node in stays:
        if len(result) > 1 and result[-2] == node:
            result.pop()
        else:
            result.append(node)
    while closed and len(result) > 2 and (result[-1] == result[1] or result[-2] == result[0]):
        # To and fro across the place where the row begins.
        result = result[1:-1] if result[-1] == result[1] else result[:-1]
        while len(result) > 1 and result[0] == result[-1]:
            result.pop()
    return result, closed and len(result) > 2


def _rebuild(
    sized: SizedTruss, nodes: np.ndarray, kinds: np.ndarray, curves: Sequence[Curve], rows: _Rows, spans: _Spans
) -> tuple[SizedTruss, np.ndarray]:
    """The truss of these rows without unused nodes, and the new number of every node (-1: gone)."""
    a, b, starts = rows.steps()
    key, of_step = np.unique(np.minimum(a, b) * len(nodes) + np.maximum(a, b), return_inverse=True)
    low, high = np.divmod(key, len(nodes))
    used = np.unique(np.concatenate([low, high]))
    number = np.full(len(nodes), -1)
    number[used] = np.arange(len(used))
    radii, waypoints, offsets = spans.table(low, high)
    along, members = frozen(number[rows.nodes], np.int64), frozen(of_step.ravel(), np.int64)
    new_curves = tuple(
        Curve(
            curve.kind,
            curve.family,
            curve.axis,
            curve.isovalues,
            curve.component,
            along[rows.offsets[c] : rows.offsets[c + 1]],
            members[starts[c] : starts[c + 1]],
            bool(rows.closed[c]),
            curve.part,
        )
        for c, curve in enumerate(curves)
    )
    new = replace(
        sized.truss,
        nodes=nodes[used],
        node_kinds=kinds[used],
        members=np.stack([number[low], number[high]], axis=1),
        curves=new_curves,
        waypoints=waypoints,
        waypoint_offsets=offsets,
    )
    return SizedTruss(new, radii), number
