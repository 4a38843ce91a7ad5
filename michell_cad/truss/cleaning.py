"""From the traced network to a truss that can be built: short members collapsed, near-parallel ones joined, no scrap.

Arora et al. 2019 (Section 4.4) merge the ends of short elements and lose the labels of the curves there. Here a curve
is a sequence of nodes and keeps its label as long as two nodes are left of it. Two curves may end up on one member.

1. Two members between the same nodes become one, unless both lie on the surface and enclose something.
2. The ends of members shorter than `TrussOptions.shortest_member` are merged, the shortest first: towards corners, then
   features, then the boundary; two interior nodes meet at their centre of mass. Nodes on the surface never leave it: of
   two of the same kind the one that stands for more nodes stays where it is.
3. Two members that enclose less than `TrussOptions.smallest_angle` at a node are joined: the far ends are merged if
   they are close, else the longer member is led through the end of the shorter one.
4. Pieces of a few members that nothing else touches are left out (`loose`).
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from michell_cad.arrays import expand, require
from michell_cad.curves import NodeKind
from michell_cad.isocurves.network import CurveNetwork
from michell_cad.truss.draft import Draft, draft_network, finish, split_lenses
from michell_cad.truss.loose import drop_loose
from michell_cad.truss.values import Truss
from michell_cad.truss.waypoints import keep_to_surface

MAX_ROUNDS = 20
"""Rounds of collapsing and joining; each shortens the truss. Maps of which a third is folded needed 5."""

SAME = 9
"""Lengths and angles that agree in so many decimals (relative) count as equal: then the numbers of the nodes decide,
which stay the same when the part is turned or moved."""


@dataclass(frozen=True)
class TrussOptions:
    """Options of `build_truss`.

    Parameters
    ----------
    shortest_member : relative to the spacing. Shorter members are collapsed. The default leaves room for the two nodes
        of a member of radius r = 0.1 spacing with fillets f = 0.4 r: a node of radius R = 1.8 r takes ((R + f)^2 - (r +
        f)^2)^(1/2) = 1.7 r from its member, 0.34 spacing at both ends.
    smallest_angle : radians. Members that enclose less are joined where possible: two tubes of radius r and length L
        overlap all along below about 2 r / L, 11 degrees for r = 0.1 L.
    """

    shortest_member: float = 0.4
    smallest_angle: float = np.deg2rad(15.0)

    def __post_init__(self) -> None:
        require(0 <= self.shortest_member < 1, f"shortest_member must lie in [0, 1), found {self.shortest_member}")
        require(
            0 <= self.smallest_angle < np.pi / 3,
            f"smallest_angle must lie in [0, pi / 3) radians, found {self.smallest_angle}",
        )


@dataclass(frozen=True)
class CleaningReport:
    """What `clean_network` did, in counts.

    Parameters
    ----------
    nodes, members, curves : before and after.
    merged_nodes : nodes that were merged in another one because a member was too short.
    merged_corners : corners of the part among them.
    merged_ends : nodes merged because two members were near-parallel.
    rerouted_members : members led through the end of a near-parallel one.
    added_nodes : nodes put on loops and on one of two surface members with the same ends.
    shared_members : members on more than one curve.
    acute_pairs : pairs of members at a node that still enclose less than the smallest angle.
    short_members : members still shorter than the shortest length.
    loose_pieces, loose_members : pieces of a few members that were left out since nothing touches them; their members.
    """

    nodes: tuple[int, int]
    members: tuple[int, int]
    curves: tuple[int, int]
    merged_nodes: int
    merged_corners: int
    merged_ends: int
    rerouted_members: int
    added_nodes: int
    shared_members: int
    acute_pairs: int
    short_members: int
    loose_pieces: int = 0
    loose_members: int = 0


def build_truss(
    network: CurveNetwork,
    spacing: float,
    options: TrussOptions = TrussOptions(),
) -> Truss:
    """Clean a traced network; see `clean_network`, which also reports what was done."""
    return clean_network(network, spacing, options)[0]


def clean_network(
    network: CurveNetwork,
    spacing: float,
    options: TrussOptions = TrussOptions(),
    anchors: Float[np.ndarray, "n 3"] | None = None,
) -> tuple[Truss, CleaningReport]:
    """Make a truss of a traced network: no repeated, no short and few near-parallel members.

    Parameters
    ----------
    network : CurveNetwork
    spacing : mm, edge of a typical truss cell.
    options : TrussOptions
    anchors : points where the part is held or loaded, mm: no piece of the truss near one of them is left out. Default:
        none.

    Returns
    -------
    Truss
        Curves keep their labels and their order; curves whose nodes all merged are gone, and closed curves that shrank
        to one member (a closed feature is then open).
    CleaningReport

    Raises
    ------
    InvalidInputError
        If the spacing is not positive, or nothing is left.
    """
    require(np.isfinite(spacing) and spacing > 0, f"spacing must be a positive length in mm, found {spacing}")
    shortest = options.shortest_member * spacing
    draft, added = draft_network(network, shortest)
    draft, more = split_lenses(draft)
    merged = corners = ends = rerouted = 0
    for _ in range(MAX_ROUNDS):
        draft, n, c = collapse_short(draft, shortest)
        draft, e, r = join_parallel(draft, shortest, options.smallest_angle)
        merged, corners, ends, rerouted = merged + n, corners + c, ends + e, rerouted + r
        if not (e or r):
            break
    draft, still_more = split_lenses(draft)
    draft, loose, dropped = drop_loose(draft, np.zeros((0, 3)) if anchors is None else anchors, spacing)
    require(
        len(draft.sequence),
        f"no member is left of {len(network.members)} at a spacing of {spacing:.4g} mm: the part is smaller than a "
        "cell of the truss. Use a larger resolution or a smaller spacing",
    )
    truss = keep_to_surface(finish(draft, network.curves, spacing), network, _origin(draft, network))
    steps = np.bincount(np.concatenate([curve.members for curve in truss.curves]))
    report = CleaningReport(
        nodes=(len(network.nodes), len(truss.nodes)),
        members=(len(network.members), len(truss.members)),
        curves=(len(network.curves), len(truss.curves)),
        merged_nodes=merged,
        merged_corners=corners,
        merged_ends=ends,
        rerouted_members=rerouted,
        added_nodes=added + more + still_more,
        shared_members=int((steps > 1).sum()),
        acute_pairs=len(acute_pairs(truss.nodes, truss.members, options.smallest_angle)[0]),
        short_members=int((truss.lengths < shortest).sum()),
        loose_pieces=loose,
        loose_members=dropped,
    )
    return truss, report


def _origin(draft: Draft, network: CurveNetwork) -> np.ndarray:
    """The node of the network that each node in use still is, -1 for those that moved or were added."""
    used = np.unique(draft.sequence)
    same = np.minimum(used, len(network.nodes) - 1)
    stays = (used == same) & (draft.nodes[used] == network.nodes[same]).all(1)
    return np.where(stays, used, -1)


def collapse_short(draft: Draft, shortest: float) -> tuple[Draft, int, int]:
    """Merge the ends of short members; returns the draft, the number of merged nodes, and of corners among them.

    In each round all members merge that are the shortest at both of their ends, so that the order is the same as one by
    one.
    """
    nodes, kinds, weights = draft.nodes.copy(), draft.kinds.copy(), draft.weights.copy()
    names = np.arange(len(nodes))
    pairs = draft.pairs()[0]
    merged = corners = 0
    while len(pairs):
        lengths = np.linalg.norm(nodes[pairs[:, 0]] - nodes[pairs[:, 1]], axis=1)
        short = np.flatnonzero(lengths < shortest)
        if not len(short):
            break
        order = short[np.argsort(_ranked(lengths[short] / shortest), kind="stable")]
        best = np.full(len(nodes), len(order))
        np.minimum.at(best, pairs[order].ravel(), np.repeat(np.arange(len(order)), 2))
        chosen = pairs[order[(best[pairs[order]] == np.arange(len(order))[:, None]).all(1)]]
        stays, goes = _merge(nodes, kinds, weights, chosen)
        corners += int((kinds[goes] == NodeKind.CORNER).sum())
        merged += len(goes)
        target = np.arange(len(nodes))
        target[goes] = stays
        names = target[names]
        pairs = np.unique(np.sort(target[pairs], axis=1), axis=0)
        pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    if not merged:
        return draft, 0, 0
    return replace(draft, nodes=nodes, kinds=kinds, weights=weights).renamed(names), merged, corners


def _merge(
    nodes: np.ndarray, kinds: np.ndarray, weights: np.ndarray, pairs: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Merge disjoint pairs of nodes (in place): returns the nodes that stay and those that go."""
    a, b = pairs.T
    b_stays = (kinds[b] > kinds[a]) | ((kinds[b] == kinds[a]) & (weights[b] > weights[a]))
    stays, goes = np.where(b_stays, b, a), np.where(b_stays, a, b)
    inner = kinds[stays] == NodeKind.INTERIOR
    s, g = stays[inner], goes[inner]
    share = (weights[g] / (weights[g] + weights[s]))[:, None]
    nodes[s] += share * (nodes[g] - nodes[s])
    weights[stays] += weights[goes]
    return stays, goes


def join_parallel(draft: Draft, shortest: float, smallest_angle: float) -> tuple[Draft, int, int]:
    """Join members that enclose less than the smallest angle; returns the draft, merged ends and rerouted members.

    Of two such members v-a (the shorter) and v-b: if b lies less than `shortest` beyond the foot of a on v-b, or nearer
    to a than that, a and b are merged; else v-b is led through a, for which an a that may not lie on the curves of v-b
    is first moved to its foot on v-b. Two different features that meet at an acute angle are left.
    """
    pairs, entries, member = draft.pairs()
    v, a, b = acute_pairs(draft.nodes, pairs, smallest_angle)
    if not len(v):
        return draft, 0, 0
    nodes, kinds, weights = draft.nodes.copy(), draft.kinds.copy(), draft.weights.copy()
    highest = np.zeros(len(pairs), np.int64)
    np.maximum.at(highest, member, draft.ranks[draft.curve[entries]])
    keys = pairs @ [len(nodes), 1]

    def number(i: int, j: int) -> int:
        """The member between two nodes."""
        return int(np.searchsorted(keys, min(i, j) * len(nodes) + max(i, j)))

    busy = np.zeros(len(nodes), bool)
    names = np.arange(len(nodes))
    through = np.full(len(pairs), -1)
    merges = 0
    for x, near, far in zip(v.tolist(), a.tolist(), b.tolist(), strict=True):
        if busy[[x, near, far]].any():
            continue
        needed, other = highest[number(x, far)], highest[number(x, near)]
        if needed == NodeKind.FEATURE and other == NodeKind.FEATURE:
            continue
        along = nodes[far] - nodes[x]
        foot = nodes[x] + along * (along @ (nodes[near] - nodes[x])) / (along @ along)
        beyond = min(np.linalg.norm(nodes[far] - foot), np.linalg.norm(nodes[far] - nodes[near]))
        if beyond < shortest:
            stays, goes = _merge(nodes, kinds, weights, np.array([[near, far]]))
            names[goes] = stays
            merges += 1
        else:
            if kinds[near] < needed:
                nodes[near], kinds[near] = foot, needed
            through[number(x, far)] = near
        busy[[x, near, far]] = True
    draft = replace(draft, nodes=nodes, kinds=kinds, weights=weights)
    via = through[member]
    draft = draft.inserted(entries[via >= 0], via[via >= 0])
    return draft.renamed(names), merges, int((through >= 0).sum())


def acute_pairs(
    nodes: Float[np.ndarray, "n 3"], members: Int[np.ndarray, "m 2"], smallest_angle: float
) -> tuple[Int[np.ndarray, " p"], Int[np.ndarray, " p"], Int[np.ndarray, " p"]]:
    """Pairs of members v-a and v-b that enclose less than the angle, the sharpest first; v-a is the shorter."""
    darts = np.concatenate([members, members[:, ::-1]])
    darts = darts[np.argsort(darts[:, 0], kind="stable")]
    along = nodes[darts[:, 1]] - nodes[darts[:, 0]]
    lengths = np.linalg.norm(along, axis=1)
    along = along / np.maximum(lengths, np.finfo(float).tiny)[:, None]
    counts = np.bincount(darts[:, 0], minlength=len(nodes))
    last = np.cumsum(counts)[darts[:, 0]]
    first, local = expand(last - np.arange(len(darts)) - 1)
    second = first + 1 + local
    chord = np.linalg.norm(along[first] - along[second], axis=1)
    acute = np.flatnonzero(chord < 2 * np.sin(smallest_angle / 2))
    acute = acute[np.argsort(_ranked(chord[acute]), kind="stable")]
    first, second = first[acute], second[acute]
    swap = lengths[first] > lengths[second] * (1 + 10.0**-SAME)
    near, far = np.where(swap, second, first), np.where(swap, first, second)
    return darts[near, 0], darts[near, 1], darts[far, 1]


def _ranked(values: np.ndarray) -> np.ndarray:
    """Values near 1 by which things are put in order, without the rounding that would decide between equal ones."""
    return np.round(values, SAME)


def valences(kinds: Int[np.ndarray, " n"], members: Int[np.ndarray, "m 2"]) -> dict[str, dict[int, int]]:
    """Histograms of the number of members at interior nodes and at all others: ``{"interior": {6: 120}, "boundary":
    ...}``.

    A member from a node to itself counts twice.
    """
    degrees = np.bincount(members.ravel(), minlength=len(kinds))
    inside: Bool[np.ndarray, " n"] = kinds == NodeKind.INTERIOR
    histograms = {}
    for name, mask in (("interior", inside), ("boundary", ~inside)):
        values, counts = np.unique(degrees[mask], return_counts=True)
        histograms[name] = dict(zip(values.tolist(), counts.tolist(), strict=True))
    return histograms


def interior_degree_6(network: CurveNetwork) -> float:
    """Fraction of the interior nodes of a traced network with exactly six members (1.0 if there is none)."""
    histogram = valences(network.node_kinds, network.members)["interior"]
    return histogram.get(6, 0) / sum(histogram.values()) if histogram else 1.0
