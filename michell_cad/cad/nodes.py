"""Node spheres: how large a sphere each node needs so that its members leave it side by side.

At a node with a sphere of radius R, a member of radius r with a fillet of radius f takes a cap of half-angle
a = asin((r + f) / (R + f)); its tube begins at the distance H = sqrt((R + f)^2 - (r + f)^2) along its direction, where
the torus that a ball of radius f rolls between sphere and tube ends. Two members at an angle alpha leave side by side
if alpha >= a_1 + a_2 + `MARGIN`. Otherwise, in this order:

1. R grows up to `Level.largest_ratio` times the largest radius at the node;
2. the fillets of the two members shrink (`FILLET_STEPS`);
3. the two members are mitred: both get the same radius r (the largest of the mitred ones there) and no fillet, and
   their tubes are cut by the plane that bisects their directions, along an ellipse whose tip lies r / tan(alpha / 2)
   from the node. Of several equal tubes through one point, the one whose direction is nearest bounds their union, so
   that any number of members can be mitred.

The mitre replaces a boolean union of the members of that node: it is exact, and as fast as all the rest.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from michell_cad.arrays import freeze

MARGIN = np.radians(1.0)
"""Angle left free between two caps."""

OVERLAP = np.radians(2.0)
"""Two mitred caps overlap by at least this angle: a mitre of caps that just touch has edges too short to build."""

FILLET_STEPS = (1.0, 0.5, 0.25, 0.1)
"""Fractions of the wanted fillet that are tried before a pair of members is mitred (relative)."""

MITRE_CLEARANCE = 0.1
"""A mitred tube begins this far beyond the tip of its mitre (relative to its radius), so that no edge touches it."""

SETTLE = 1.3
"""R of a mitred node may grow by this factor until no two of its caps just touch (relative)."""

SMALLEST_RATIO = 1.15
"""Smallest R / r: below it the sphere of a node hardly covers the start of its tubes (relative)."""


@dataclass(frozen=True)
class Level:
    """How much room a node may take: R / r at rest, largest R / r, largest fraction of the wanted fillet."""

    smallest_ratio: float
    largest_ratio: float
    largest_fillet: float


def node_levels(node_ratio: float) -> tuple[Level, ...]:
    """From the wanted node to the smallest one, for nodes between which a member has too little room."""
    largest = max(3.0, node_ratio)
    # 3 r: with the full fillet enough for 50 degrees; the sphere then weighs as much as 36 r of member.
    return (
        Level(node_ratio, largest, 1.0),
        Level(min(node_ratio, 1.5), min(largest, 2.2), 0.5),
        Level(1.25, 1.6, 0.25),
        Level(SMALLEST_RATIO, 1.3, 0.1),
    )


@dataclass(frozen=True, eq=False)
class NodeSizes:
    """Spheres of the nodes and how the ends of the members sit on them; end 2 m + i is at node i of member m.

    Parameters
    ----------
    radius : (n_n,) float, mm, R of the sphere.
    end_radius : (n_e,) float, mm, r of the tube where it leaves the node: larger than wanted at some mitred ends.
    fillet : (n_e,) float, mm, f.
    reach : (n_e,) float, mm, distance along the direction of the end at which the tube begins; inf if no sphere fits.
    mitred : (n_e,) bool.
    rival : (n_e,) int, the mitred end that decides the reach; -1 if the sphere does.
    """

    radius: Float[np.ndarray, " n_n"]
    end_radius: Float[np.ndarray, " n_e"]
    fillet: Float[np.ndarray, " n_e"]
    reach: Float[np.ndarray, " n_e"]
    mitred: Bool[np.ndarray, " n_e"]
    rival: Int[np.ndarray, " n_e"]

    def __post_init__(self) -> None:
        freeze(self, radius=np.float64, end_radius=np.float64, fillet=np.float64, reach=np.float64)
        freeze(self, mitred=bool, rival=np.int64)


def end_pairs(node_of_end: Int[np.ndarray, " n_e"]) -> tuple[Int[np.ndarray, " n_p"], Int[np.ndarray, " n_p"]]:
    """All pairs (first < second) of ends at the same node."""
    order = np.argsort(node_of_end, kind="stable")
    starts = np.flatnonzero(np.r_[True, np.diff(node_of_end[order]) != 0])
    valence = np.diff(np.r_[starts, len(order)])
    first, second = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    for k in np.unique(valence):
        ends = order[starts[valence == k][:, None] + np.arange(k)]
        i, j = np.triu_indices(k, 1)
        first.append(ends[:, i].ravel())
        second.append(ends[:, j].ravel())
    return np.concatenate(first), np.concatenate(second)


def angles_between(a: Float[np.ndarray, "*i 3"], b: Float[np.ndarray, "*j 3"]) -> Float[np.ndarray, "*k"]:
    """Angles between unit vectors, accurate near 0 and near pi."""
    return 2 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))


def size_nodes(
    node_of_end: Int[np.ndarray, " n_e"],
    directions: Float[np.ndarray, "n_e 3"],
    radii: Float[np.ndarray, " n_e"],
    n_nodes: int,
    fillet_ratio: float,
    levels: tuple[Level, ...],
    level: Int[np.ndarray, " n_n"],
    growth: Float[np.ndarray, " n_n"],
) -> NodeSizes:
    """Choose spheres, fillets and mitres of all nodes, see the module's text.

    Parameters
    ----------
    node_of_end : node at each end.
    directions : unit vectors from the node into the member.
    radii : wanted radius of each end, mm.
    n_nodes : number of nodes.
    fillet_ratio : wanted f / r.
    levels, level : the rooms that there are, and which of them each node takes.
    growth : factor on the smallest sphere of each node.
    """
    smallest, largest, most = (
        np.array([getattr(one, name) for one in levels])[level]
        for name in ("smallest_ratio", "largest_ratio", "largest_fillet")
    )
    smallest, largest = smallest * growth, largest * growth
    first, second = end_pairs(node_of_end)
    angle = angles_between(directions[first], directions[second])
    node = node_of_end[first]
    r = radii.copy()
    mitred_pair = np.zeros(len(first), bool)
    while True:
        widest = np.zeros(n_nodes)
        np.maximum.at(widest, node_of_end, r)
        factor, needed, failed = _fit_fillets(
            first, second, angle, r, fillet_ratio, most[node], (largest * widest)[node], mitred_pair
        )
        mitred_pair |= failed
        mitred = np.zeros(len(r), bool)
        mitred[first[mitred_pair]] = mitred[second[mitred_pair]] = True
        grown = _equalise(mitred, node_of_end, r, n_nodes)
        if not failed.any() and (grown == r).all():
            break
        r = grown
    end_factor = most[node_of_end].copy()
    np.minimum.at(end_factor, first, factor)
    np.minimum.at(end_factor, second, factor)
    f = np.where(mitred, 0.0, fillet_ratio * r * end_factor)
    R = smallest * widest
    np.maximum.at(R, node, np.where(mitred_pair, 0.0, needed))
    by_node = np.argsort(node, kind="stable")
    bounds = np.searchsorted(node[by_node], np.arange(n_nodes + 1))
    for i in np.unique(node[mitred_pair]):
        pairs = by_node[bounds[i] : bounds[i + 1]]
        R[i] = _settle(R[i], first[pairs], second[pairs], angle[pairs], r, f, mitred)
    reach = np.sqrt((R[node_of_end] + f) ** 2 - (r + f) ** 2)
    reach[mitred] += MITRE_CLEARANCE * r[mitred]
    rival = np.full(len(r), -1)
    mitre = mitred[first] & mitred[second]
    e = np.concatenate([first[mitre], second[mitre]])
    other = np.concatenate([second[mitre], first[mitre]])
    tip = r[e] * (1 / np.tan(np.tile(angle[mitre], 2) / 2) + MITRE_CLEARANCE)
    farthest = np.argsort(tip, kind="stable")
    farthest = farthest[tip[farthest] > reach[e[farthest]]]
    # The last assignment to an end is the one with the farthest tip.
    reach[e[farthest]], rival[e[farthest]] = tip[farthest], other[farthest]
    return NodeSizes(R, r, f, reach, mitred, rival)


NEWTON_STEPS = 60
"""More than enough: the first steps double R at least where the angle is very acute, the last ones are quadratic."""
NEWTON_TOLERANCE = 1e-9
"""Relative accuracy of R, on its safe side."""


def cap_angle(R: np.ndarray | float, r: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Half-angle of the cap that a member takes from the sphere, fillet included."""
    return np.arcsin(np.minimum((r + f) / (R + f), 1.0))


def separating_radius(
    angle: np.ndarray, r_1: np.ndarray, r_2: np.ndarray, f_1: np.ndarray, f_2: np.ndarray
) -> np.ndarray:
    """Smallest R at which two caps at `angle` leave `MARGIN` between them; inf if there is none.

    The sum of the cap angles falls with R and is convex, so Newton's method climbs to the root from below.
    """
    target = np.maximum(angle - MARGIN, 1e-3)
    R = np.maximum(r_1, r_2) * SMALLEST_RATIO
    for _ in range(NEWTON_STEPS):
        excess, slope = -target, np.zeros_like(R)
        for r, f in ((r_1, f_1), (r_2, f_2)):
            sine = (r + f) / (R + f)
            excess = excess + np.arcsin(sine)
            slope = slope + sine / ((R + f) * np.sqrt(1 - sine * sine))
        step = np.maximum(excess, 0) / slope
        R = R + step
        if (step <= NEWTON_TOLERANCE * R).all():
            break
    return np.where(angle > 2 * MARGIN, R * (1 + NEWTON_TOLERANCE), np.inf)


def _fit_fillets(first, second, angle, r, fillet_ratio, most, largest, mitred_pair):
    """Per pair: the largest fillet fraction that fits below the largest R, the R it needs, and whether none fits."""
    factor = np.full(len(first), FILLET_STEPS[-1])
    needed = np.full(len(first), np.inf)
    for step in FILLET_STEPS if fillet_ratio > 0 else (0.0,):
        # A mitred end has no fillet, whatever its other pairs would allow.
        loose = np.zeros(len(r), bool)
        loose[first[mitred_pair]] = loose[second[mitred_pair]] = True
        f = fillet_ratio * r * ~loose
        fraction = np.minimum(step, most)
        open_pairs = np.flatnonzero(needed > largest)  # few are left after the first step
        a, b, part = first[open_pairs], second[open_pairs], fraction[open_pairs]
        R = separating_radius(angle[open_pairs], r[a], r[b], part * f[a], part * f[b])
        fits = R <= largest[open_pairs]
        factor[open_pairs[fits]], needed[open_pairs[fits]] = part[fits], R[fits]
    return factor, needed, (needed > largest) & ~mitred_pair


def _equalise(mitred, node_of_end, r, n_nodes):
    """Give the mitred ends of each node the largest of their radii."""
    largest = np.zeros(n_nodes)
    np.maximum.at(largest, node_of_end[mitred], r[mitred])
    return np.where(mitred, largest[node_of_end], r)


def _settle(R, first, second, angle, r, f, mitred):
    """The smallest R from `R` on at which every pair of one node is clear, or mitred and overlaps clearly; or inf."""
    both = mitred[first] & mitred[second]
    lowest = SMALLEST_RATIO * max(r[first].max(), r[second].max())
    candidates = np.concatenate([np.linspace(R, SETTLE * R, 60), np.linspace(R, lowest, 60)])[:, None]
    total = cap_angle(candidates, r[first], f[first]) + cap_angle(candidates, r[second], f[second])
    clear = ((total + MARGIN <= angle) | (both & (total - OVERLAP >= angle))).all(1)
    return float(candidates[np.argmax(clear), 0]) if clear.any() else np.inf
