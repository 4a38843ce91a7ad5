"""Node spheres: how large a sphere each node needs so that its members leave it side by side, or joined by creases.

At a node with a sphere of radius R, a member of radius r with a fillet of radius f takes a cap of half-angle
a = asin((r + f) / (R + f)); its tube begins at the distance H = sqrt((R + f)^2 - (r + f)^2) along its direction, where
the torus that a ball of radius f rolls between sphere and tube ends. Two members at an angle alpha leave side by side
if alpha >= a_1 + a_2 + `MARGIN`. R grows to make that true, up to `Level.largest_ratio` times the largest radius at the
node. Beyond, the two members are *creased*: both get the same radius r (the largest of the creased ones there), and
their tubes meet in the plane that bisects their directions, where the same ball of radius f rolls along both tubes (see
`creases`; without fillets the edge stays sharp). Their offsets r + f meet in an ellipse whose tip lies
(r + f) / tan(alpha / 2) from the node. Of several equal tubes through one point, the one whose direction is nearest
bounds their union, so that any number of members can be creased.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from michell_cad.arrays import freeze

MARGIN = np.radians(1.0)
"""Angle left free between two caps."""

OVERLAP = np.radians(2.0)
"""Two creased caps overlap by at least this angle: a crease of caps that just touch has edges too short to build."""

SHARPEST_TURN = 0.7
"""The ball that fillets a crease has at most this share of the smallest radius of curvature on its way, which is
(r + f) sin(alpha / 2) at the tip (relative): at 1 its surface would have a cusp."""

CREASE_CLEARANCE = 0.1
"""A creased tube begins this far beyond the tip of its crease (relative to its radius), so that no edge touches it."""

SETTLE = 1.3
"""R of a creased node may grow by this factor until no two of its caps just touch (relative)."""

SMALLEST_RATIO = 1.15
"""Smallest R / r: below it the sphere of a node hardly covers the start of its tubes (relative)."""


@dataclass(frozen=True)
class Level:
    """How much room a node may take: R / r at rest, largest R / r, largest fraction of the wanted fillet."""

    smallest_ratio: float
    largest_ratio: float
    largest_fillet: float


LARGEST_RATIO = 2.5
"""Largest R / r: with the full fillet of 0.4 r enough for 60 degrees. A sphere of 2.5 r weighs as much as 21 r of
member; members at more acute angles are creased, which takes less room and less material."""


def node_levels(node_ratio: float) -> tuple[Level, ...]:
    """From the wanted node to the smallest one, for nodes between which a member has too little room."""
    largest = max(LARGEST_RATIO, node_ratio)
    return (
        Level(node_ratio, largest, 1.0),
        Level(min(node_ratio, 1.5), min(largest, 2.0), 0.5),
        Level(1.25, 1.6, 0.25),
        Level(SMALLEST_RATIO, 1.3, 0.1),
    )


@dataclass(frozen=True, eq=False)
class NodeSizes:
    """Spheres of the nodes and how the ends of the members sit on them; end 2 m + i is at node i of member m.

    Parameters
    ----------
    radius : (n_n,) float, mm, R of the sphere.
    end_radius : (n_e,) float, mm, r of the tube where it leaves the node: larger than wanted at some creased ends.
    fillet : (n_e,) float, mm, f.
    reach : (n_e,) float, mm, distance along the direction of the end at which the tube begins; inf if no sphere fits.
    creased : (n_e,) bool.
    rival : (n_e,) int, the creased end that decides the reach; -1 if the sphere does.
    """

    radius: Float[np.ndarray, " n_n"]
    end_radius: Float[np.ndarray, " n_e"]
    fillet: Float[np.ndarray, " n_e"]
    reach: Float[np.ndarray, " n_e"]
    creased: Bool[np.ndarray, " n_e"]
    rival: Int[np.ndarray, " n_e"]

    def __post_init__(self) -> None:
        freeze(self, radius=np.float64, end_radius=np.float64, fillet=np.float64, reach=np.float64)
        freeze(self, creased=bool, rival=np.int64)


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
    """Choose spheres, fillets and creases of all nodes, see the module's text.

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
    ratio = fillet_ratio * most[node_of_end]
    r = radii.copy()
    crease = np.zeros(len(first), bool)
    while True:
        widest = np.zeros(n_nodes)
        np.maximum.at(widest, node_of_end, r)
        f = ratio * r
        needed = separating_radius(angle, r[first], r[second], f[first], f[second])
        crease |= needed > (largest * widest)[node]
        creased = np.zeros(len(r), bool)
        creased[first[crease]] = creased[second[crease]] = True
        equal = _equalise(creased, node_of_end, r, n_nodes)
        if (equal == r).all():
            break
        r = equal
    f[creased] = _crease_fillets(node_of_end, node[crease], angle[crease], f, creased, r, n_nodes)[creased]
    R = smallest * widest
    np.maximum.at(R, node, np.where(crease, 0.0, needed))
    _settle(R, node, first, second, angle, r, f, creased, crease)
    reach = np.sqrt((R[node_of_end] + f) ** 2 - (r + f) ** 2)
    reach[creased] += CREASE_CLEARANCE * r[creased]
    rival = np.full(len(r), -1)
    both = creased[first] & creased[second]
    e = np.concatenate([first[both], second[both]])
    other = np.concatenate([second[both], first[both]])
    tip = (r[e] + f[e]) / np.tan(np.tile(angle[both], 2) / 2) + CREASE_CLEARANCE * r[e]
    farthest = np.argsort(tip, kind="stable")
    farthest = farthest[tip[farthest] > reach[e[farthest]]]
    # The last assignment to an end is the one with the farthest tip.
    reach[e[farthest]], rival[e[farthest]] = tip[farthest], other[farthest]
    return NodeSizes(R, r, f, reach, creased, rival)


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


def _equalise(creased, node_of_end, r, n_nodes):
    """Give the creased ends of each node the largest of their radii."""
    largest = np.zeros(n_nodes)
    np.maximum.at(largest, node_of_end[creased], r[creased])
    return np.where(creased, largest[node_of_end], r)


def _crease_fillets(node_of_end, node, angle, f, creased, r, n_nodes):
    """The fillets of creased ends, one for each node: what is wanted, or what the sharpest of its creases allows.

    f <= q (r + f) sin(alpha / 2) with q = `SHARPEST_TURN` gives f <= r x / (1 - x) with x = q sin(alpha / 2).
    """
    smallest = np.full(n_nodes, np.inf)
    np.minimum.at(smallest, node_of_end[creased], f[creased])
    share = np.full(n_nodes, np.inf)
    x = SHARPEST_TURN * np.sin(angle / 2)
    np.minimum.at(share, node, x / (1 - x))
    return np.minimum(smallest[node_of_end], share[node_of_end] * r)


def _settle(R, node, first, second, angle, r, f, creased, crease) -> None:
    """Raise R, in place, at nodes with creases until every pair of ends is clear, or creased and overlaps clearly.

    If no larger R does, smaller ones are tried; R becomes infinite if none is found.
    """
    has_crease = np.zeros(len(R), bool)
    has_crease[node[crease]] = True
    pairs = np.flatnonzero(has_crease[node])
    pairs = pairs[np.argsort(node[pairs], kind="stable")]
    lowest = np.zeros(len(R))
    np.maximum.at(lowest, node[pairs], SMALLEST_RATIO * np.maximum(r[first[pairs]], r[second[pairs]]))
    start = R.copy()
    for step in [*np.linspace(0, 1, 60), *(-np.linspace(0, 1, 60)[1:]), np.nan]:
        if not len(pairs):
            return
        at, a, b = node[pairs], first[pairs], second[pairs]
        if np.isnan(step):
            R[at] = np.inf
            return
        R[at] = (start + step * (SETTLE - 1) * start)[at] if step >= 0 else (start + step * (start - lowest))[at]
        total = cap_angle(R[at], r[a], f[a]) + cap_angle(R[at], r[b], f[b])
        both = creased[a] & creased[b]
        clear = (total + MARGIN <= angle[pairs]) | (both & (total - OVERLAP >= angle[pairs]))
        failed = np.zeros(len(R), bool)
        failed[at[~clear]] = True
        pairs = pairs[failed[at]]
