"""Merge nodes and reroute members of a truss that is too tight to be built; every curve keeps its label.

A curve is read as the row of nodes that it visits. Merging two nodes renames one of them; rerouting a member (i, k)
through node j replaces the step i, k by i, j, k. Steps from a node to itself and steps to and fro then vanish (at an
end of the row one way remains), and a member is whatever two neighbours of a row span. Of members that become one, the
thicker gives the radii.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from michell_cad.truss import SizedTruss, Truss


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
    spans = _Spans(sized, members)
    via = {}
    for member, j in detours:
        a, b = (int(x) for x in members[member])
        via[frozenset((a, b))] = int(target[j])
        spans.inherit(member, via[frozenset((a, b))])
    rows, curves = [], []
    for curve in truss.curves:
        row, closed = _tidy(_detour(target[curve.nodes].tolist(), curve.closed, via), curve.closed)
        if len(row) > 1:
            rows.append(row)
            curves.append((curve, closed))
    return _rebuild(truss, nodes, kinds, target, rows, curves, spans)


class _Spans:
    """Radii and waypoints of the members by their two nodes, read from the lower to the higher node."""

    def __init__(self, sized: SizedTruss, members: np.ndarray) -> None:
        self._sized, self._members = sized, members
        self.radii: dict[tuple[int, int], np.ndarray] = {}
        self.waypoints: dict[tuple[int, int], np.ndarray] = {}
        for m, (a, b) in enumerate(members.tolist()):
            if a != b:
                self._put(a, b, sized.radii[m], self._points(m))

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


def _rebuild(truss, nodes, kinds, target, rows, curves, spans) -> tuple[SizedTruss, np.ndarray]:
    steps = []
    for row, (_, closed) in zip(rows, curves, strict=True):
        a = np.array(row)
        b = np.roll(a, -1) if closed else a[1:]
        steps.append(np.sort(np.stack([a[: len(b)], b], axis=1), axis=1))
    pairs = np.concatenate(steps) if steps else np.zeros((0, 2), int)
    used, compact = np.unique(pairs, return_inverse=True)
    members, of_step = np.unique(compact.reshape(-1, 2), axis=0, return_inverse=True)
    number = np.full(len(nodes), -1)
    number[used] = np.arange(len(used))
    of_step = of_step.ravel()
    new_curves, start = [], 0
    for row, (curve, closed), step in zip(rows, curves, steps, strict=True):
        mine = of_step[start : start + len(step)]
        start += len(step)
        new_curves.append(replace(curve, nodes=number[np.array(row)], members=mine, closed=closed))
    keys = [(int(used[a]), int(used[b])) for a, b in members]
    points = [spans.waypoints[key] for key in keys]
    offsets = np.concatenate([[0], np.cumsum([len(p) for p in points])]).astype(int)
    new = replace(
        truss,
        nodes=nodes[used],
        node_kinds=kinds[used],
        members=members,
        curves=tuple(new_curves),
        waypoints=np.concatenate([np.zeros((0, 3)), *points]),
        waypoint_offsets=offsets,
    )
    radii: Float[np.ndarray, "n_m 3"] = np.array([spans.radii[key] for key in keys]).reshape(-1, 3)
    return SizedTruss(new, radii), number[target]
