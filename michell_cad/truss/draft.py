"""The truss while it is being cleaned: nodes, and every curve as a sequence of nodes.

Members are implied: two nodes that follow each other on a curve are joined by one. So members cannot repeat, labels
cannot be lost, and merging two nodes is a renaming.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from michell_cad.curves import KINDS, Curve, CurveKind, Curves, NodeKind
from michell_cad.isocurves.network import CurveNetwork
from michell_cad.truss.values import Truss

RANKS = {
    CurveKind.INTERIOR: NodeKind.INTERIOR,
    CurveKind.BOUNDARY: NodeKind.BOUNDARY,
    CurveKind.FEATURE: NodeKind.FEATURE,
}
"""The lowest kind of node through which a curve may run."""

_RANK_OF_KIND = np.array([RANKS[kind] for kind in KINDS])


BOWED = 0.15
"""A member whose traced middle is farther from its chord gets it as a waypoint (relative to the spacing), if cleaning
did not move its ends. The spline through the nodes alone comes within 0.05 spacing of it on nine members of ten."""

HAIRPIN = 0.75
"""No waypoint where the middle is farther from the chord than this (relative to the chord; half a circle has 0.5)."""


@dataclass(frozen=True, eq=False)
class Draft:
    """Nodes, and curves as sequences of nodes.

    Parameters
    ----------
    nodes : (n, 3) float, mm.
    kinds : (n,) int, values of `NodeKind`.
    weights : (n,) int, traced nodes that were merged in each node.
    sequence : (k,) int, nodes along all curves, curve after curve.
    curve : (k,) int, the curve of each entry, ascending.
    middles : (k, 3) float, mm, the point half way along the traced curve from each entry to the next one. The last
        entry of a closed curve leads to its first; that of an open curve leads nowhere.
    closed : (n_c,) bool.
    ranks : (n_c,) int, see `RANKS`.
    lens : mm, length of the shortest member. Two steps of boundary or feature curves between the same nodes are one
        member if their middles are closer than this; otherwise something lies between them (a hole, another face).
    """

    nodes: Float[np.ndarray, "n 3"]
    kinds: Int[np.ndarray, " n"]
    weights: Int[np.ndarray, " n"]
    sequence: Int[np.ndarray, " k"]
    curve: Int[np.ndarray, " k"]
    middles: Float[np.ndarray, "k 3"]
    closed: Bool[np.ndarray, " n_c"]
    ranks: Int[np.ndarray, " n_c"]
    lens: float

    @property
    def bounds(self) -> Int[np.ndarray, " n_c1"]:
        """Where each curve begins in `sequence`, and the end."""
        return np.searchsorted(self.curve, np.arange(len(self.closed) + 1))

    @property
    def following(self) -> Int[np.ndarray, " k"]:
        """The next node after each entry of `sequence`, -1 after the last one of an open curve."""
        following = np.roll(self.sequence, -1)
        bounds = self.bounds
        some = np.flatnonzero(np.diff(bounds))
        following[bounds[some + 1] - 1] = np.where(self.closed[some], self.sequence[bounds[some]], -1)
        return following

    def pairs(self) -> tuple[Int[np.ndarray, "m 2"], Int[np.ndarray, " s"], Int[np.ndarray, " s"]]:
        """Members (ascending pairs of nodes, each once), the entries that lead along one, and the member of each."""
        following = self.following
        entries = np.flatnonzero(following >= 0)
        ends = np.sort(np.stack([self.sequence[entries], following[entries]], axis=1), axis=1)
        n = max(len(self.nodes), 1)
        keys, member = np.unique(ends[:, 0] * n + ends[:, 1], return_inverse=True)
        return np.stack([keys // n, keys % n], axis=1), entries, member

    def renamed(self, names: Int[np.ndarray, " n"]) -> "Draft":
        """The same curves through the nodes ``names[node]``, without steps from a node to itself, spurs and points.

        A curve that goes to a node and straight back stops short of it. What shrinks to one node vanishes, and so does
        a closed curve that shrinks to one member, there and back, except that a feature becomes an open one.
        """
        moved = replace(self, sequence=names[self.sequence])
        return moved.kept(moved.following != moved.sequence).without_spurs()

    def kept(self, mask: Bool[np.ndarray, " k"]) -> "Draft":
        """Only the entries in `mask`, and of these only the curves with at least two."""
        mask = mask & (np.bincount(self.curve[mask], minlength=len(self.closed)) > 1)[self.curve]
        return replace(self, sequence=self.sequence[mask], curve=self.curve[mask], middles=self.middles[mask])

    def without_spurs(self) -> "Draft":
        """The same curves without passages a, x, a along one member."""
        s, c, bounds = self.sequence, self.curve, self.bounds
        suspect = np.zeros(len(self.closed), bool)
        suspect[c[:-2][(s[:-2] == s[2:]) & (c[:-2] == c[2:])]] = True
        rings = np.flatnonzero(self.closed & (np.diff(bounds) >= 2))
        first, last = bounds[rings], bounds[rings + 1] - 1
        suspect[rings[(s[last - 1] == s[first]) | (s[last] == s[first + 1])]] = True
        if not suspect.any():
            return self
        mask, closed = np.ones(len(s), bool), self.closed.copy()
        for number in np.flatnonzero(suspect):
            entries, closed[number] = self._unfold(
                list(range(*bounds[number : number + 2].tolist())), bool(closed[number])
            )
            mask[bounds[number] : bounds[number + 1]] = False
            mask[entries] = True
        return replace(self, closed=closed).kept(mask)

    def _unfold(self, entries: list[int], closed: bool) -> tuple[list[int], bool]:
        """Entries of a curve that remain without its spurs, and whether it is still closed."""
        if closed and len(entries) == 2:
            if not self._is_spur(*entries):
                return entries, True
            return entries if self.ranks[self.curve[entries[0]]] == NodeKind.FEATURE else [], False
        stack: list[int] = []
        for entry in entries:
            if len(stack) > 1 and self.sequence[stack[-2]] == self.sequence[entry] and self._is_spur(*stack[-2:]):
                del stack[-2:]
            stack.append(entry)
        while closed and len(stack) > 2:
            if self.sequence[stack[-2]] == self.sequence[stack[0]] and self._is_spur(*stack[-2:]):
                del stack[-2:]
            elif self.sequence[stack[-1]] == self.sequence[stack[1]] and self._is_spur(stack[-1], stack[0]):
                stack = stack[1:-1]
            else:
                break
        if closed and len(stack) == 2:
            return self._unfold(stack, closed)
        return stack, closed

    def _is_spur(self, there: int, back: int) -> bool:
        """Whether a step and the next one, back to where it began, run along one member."""
        if self.ranks[self.curve[there]] == NodeKind.INTERIOR:
            return True
        ends = self.nodes[self.sequence[[there, back]]]
        return not self.encloses(ends, self.middles[there], self.middles[back])

    def encloses(
        self, ends: Float[np.ndarray, "2 3"], near: Float[np.ndarray, " 3"], far: Float[np.ndarray, " 3"]
    ) -> bool:
        """Whether two ways between the same ends, with these middles, are two members, see `lens`.

        A node in the middle of the farther way must leave two members that are not too short.
        """
        chord = ends.mean(0)
        if np.linalg.norm(near - chord) > np.linalg.norm(far - chord):
            near, far = far, near
        return bool(np.linalg.norm(near - far) >= self.lens and (np.linalg.norm(far - ends, axis=1) >= self.lens).all())

    def inserted(self, entries: Int[np.ndarray, " i"], nodes: Int[np.ndarray, " i"]) -> "Draft":
        """The same curves, leading from each of `entries` through the given node to the next one."""
        following = self.following[entries]
        middles = self.middles.copy()
        middles[entries] = (self.nodes[self.sequence[entries]] + self.nodes[nodes]) / 2
        new = (self.nodes[nodes] + self.nodes[following]) / 2
        at = entries + 1
        return replace(
            self,
            sequence=np.insert(self.sequence, at, nodes),
            curve=np.insert(self.curve, at, self.curve[entries]),
            middles=np.insert(middles, at, new, axis=0),
        )

    def extended(self, points: Float[np.ndarray, "e 3"], kinds: Int[np.ndarray, " e"]) -> "Draft":
        """The same curves, and more nodes (which no curve uses yet)."""
        return replace(
            self,
            nodes=np.concatenate([self.nodes, points]),
            kinds=np.concatenate([self.kinds, kinds]),
            weights=np.concatenate([self.weights, np.ones(len(points), np.int64)]),
        )


def draft_network(network: CurveNetwork, lens: float) -> tuple[Draft, int]:
    """A network as a draft, and the number of nodes added.

    A member from a node to itself longer than 3 `lens` gets two nodes, at its thirds; a shorter one vanishes.
    """
    curves = network.curves
    closed, sequence, sizes = curves.closed, curves.nodes, np.diff(curves.node_offsets)
    ranks = _RANK_OF_KIND[curves.kinds]
    curve = np.repeat(np.arange(len(curves)), sizes)
    member = np.full(len(sequence), -1)
    last = np.zeros(len(sequence), bool)
    last[np.cumsum(sizes) - 1] = ~closed
    member[~last] = curves.members
    _, middle = walk_paths(network, 0.5)
    weights = np.ones(len(network.nodes), np.int64)
    draft = Draft(network.nodes, network.node_kinds, weights, sequence, curve, middle[member], closed, ranks, lens)
    lengths, third = walk_paths(network, 1 / 3)
    loops = np.flatnonzero(draft.following == sequence)
    loops = loops[lengths[member[loops]] > 3 * lens]
    if len(loops):
        # Insert the second point first: an entry leads to the point that was inserted last.
        n = len(draft.nodes)
        thirds = np.concatenate([third[member[loops]], walk_paths(network, 2 / 3)[1][member[loops]]])
        draft = draft.extended(thirds, np.tile(ranks[curve[loops]], 2))
        draft = draft.inserted(loops, n + len(loops) + np.arange(len(loops)))
        draft = draft.inserted(loops + np.arange(len(loops)), n + np.arange(len(loops)))
    return draft.renamed(np.arange(len(draft.nodes))), 2 * len(loops)


def walk_paths(network: CurveNetwork, fraction: float) -> tuple[Float[np.ndarray, " n_m"], Float[np.ndarray, "n_m 3"]]:
    """Length of the path of every member, mm, and the point at that fraction of it."""
    n_m = len(network.members)
    sizes = np.diff(network.path_offsets) + 2
    first = np.cumsum(sizes) - sizes
    line = np.empty((int(sizes.sum()), 3))
    inner = np.ones(len(line), bool)
    inner[first] = inner[first + sizes - 1] = False
    line[first], line[first + sizes - 1] = network.nodes[network.members].transpose(1, 0, 2)
    line[inner] = network.path_points
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    steps[first[1:] - 1] = 0
    run = np.concatenate([[0.0], np.cumsum(steps)])
    lengths = run[first + sizes - 1] - run[first]
    goal = run[first] + fraction * lengths
    at = np.clip(np.searchsorted(run, goal, side="right") - 1, first, first + sizes - 2)
    span = run[at + 1] - run[at] if n_m else np.zeros(0)
    part = np.divide(goal - run[at], span, out=np.zeros(n_m), where=span > 0)[:, None]
    return lengths, line[at] + np.clip(part, 0, 1) * (line[at + 1] - line[at])


def split_lenses(draft: Draft) -> tuple[Draft, int]:
    """Keep apart the steps of boundary and feature curves that join the same two nodes along different ways.

    All but the first of such steps get a node in the middle. Where an interior curve joins the two nodes as well, its
    member serves all of them.
    """
    pairs, entries, member = draft.pairs()
    order = np.argsort(member, kind="stable")
    bounds = np.searchsorted(member[order], np.arange(len(pairs) + 1))
    ranks = draft.ranks[draft.curve[entries]]
    lowest = np.minimum.reduceat(ranks[order], bounds[:-1]) if len(pairs) else ranks
    points, kinds, at, through = [], [], [], []
    for m in np.flatnonzero((np.diff(bounds) > 1) & (lowest > NodeKind.INTERIOR)):
        ends = draft.nodes[pairs[m]]
        steps = order[bounds[m] : bounds[m + 1]]
        rise = np.linalg.norm(draft.middles[entries[steps]] - ends.mean(0), axis=1)
        steps = steps[np.argsort(rise, kind="stable")]
        # The way nearest to the chord stays as it is; every other one has a node of its own.
        ways, way_nodes = [draft.middles[entries[steps[0]]]], [-1]
        for step in steps[1:]:
            middle = draft.middles[entries[step]]
            way = int(np.linalg.norm(np.array(ways) - middle, axis=1).argmin())
            if draft.encloses(ends, ways[way], middle):
                way = len(ways)
                ways.append(middle)
                way_nodes.append(len(points))
                points.append(middle)
                kinds.append(ranks[step])
            if way:
                at.append(entries[step])
                through.append(len(draft.nodes) + way_nodes[way])
                kinds[way_nodes[way]] = max(kinds[way_nodes[way]], ranks[step])
    if not points:
        return draft, 0
    where = np.argsort(at)
    extended = draft.extended(np.array(points), np.array(kinds))
    return extended.inserted(np.array(at)[where], np.array(through)[where]), len(points)


def finish(draft: Draft, curves: Curves | tuple[Curve, ...], spacing: float) -> Truss:
    """The truss of a draft: nodes in use, members with waypoints where they bow, and the curves that are left."""
    pairs, entries, member = draft.pairs()
    used, renumbered = np.unique(draft.sequence, return_inverse=True)
    names = np.full(len(draft.nodes), -1)
    names[used] = np.arange(len(used))
    member_of_entry = np.full(len(draft.sequence), -1)
    member_of_entry[entries] = member
    bounds = draft.bounds
    left = np.flatnonzero(np.diff(bounds))
    made = []
    for number in left:
        part, closed = slice(bounds[number], bounds[number + 1]), bool(draft.closed[number])
        members = member_of_entry[part] if closed else member_of_entry[part][:-1]
        made.append(replace(curves[number], nodes=renumbered[part], members=members, closed=closed))
    truss = Truss(draft.nodes[used], draft.kinds[used], names[pairs], tuple(made), spacing)
    # The traced middle of each member, on the curve that shapes it.
    middles = np.zeros((len(pairs), 3))
    mine = left[truss.shape_of_member[member]] == draft.curve[entries]
    middles[member[mine]] = draft.middles[entries[mine]]
    rise = np.linalg.norm(middles - truss.nodes[truss.members].mean(1), axis=1)
    bowed = (rise > BOWED * spacing) & (rise < HAIRPIN * truss.lengths) & (draft.weights[pairs] == 1).all(1)
    return replace(truss, waypoints=middles[bowed], waypoint_offsets=np.concatenate([[0], np.cumsum(bowed)]))
