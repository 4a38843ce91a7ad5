"""How the balls of nodes change with the radii of the members there: what sizing for loads has to know.

The rule is that of `nodes`, for the directions and levels of one layout: with r the radii at a node (those of creased
members made equal), f = phi r and R_ij the least radius at which members i and j leave side by side,

    R = growth max(a max_i r_i, max_ij R_ij),   cap_i(R_ij) + cap_j(R_ij) = angle_ij,   cap = asin((r + f) / (R + f)),

so that d log R / d log r_i = w_i / (w_i + w_j) for the pair that decides, with w = -d cap / dR. It is exact at the
radii that were built; far from them a layout may choose other levels.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from michell_cad.arrays import freeze
from michell_cad.cad.layout import Layout, start_layout
from michell_cad.cad.node_sizing import angle_between, equalise, separating_radius
from michell_cad.cad.nodes import node_levels
from michell_cad.cad.prepared import PreparedTruss
from michell_cad.compiled import compiled
from michell_cad.knobs import Knobs
from michell_cad.truss import SizedTruss, Truss

EQUAL = 1e-9
"""Pairs and members that ask for the same ball, up to this (relative), have equal parts in its derivatives."""


@dataclass(frozen=True, eq=False)
class BallRule:
    """Balls of the nodes of one truss, for any radii of its members; end 2 m + i is at node i of member m.

    Parameters
    ----------
    order, bounds : ends of node n are order[bounds[n] : bounds[n + 1]].
    directions : (n_e, 3) unit vectors into the members.
    smallest, largest : (n_n,) least R over the largest radius there, and above how much a pair is creased instead.
    fillet : (n_n,) f / r.
    growth : (n_n,) factor of all.
    """

    order: Int[np.ndarray, " n_e"]
    bounds: Int[np.ndarray, " n_n1"]
    directions: Float[np.ndarray, "n_e 3"]
    smallest: Float[np.ndarray, " n_n"]
    largest: Float[np.ndarray, " n_n"]
    fillet: Float[np.ndarray, " n_n"]
    growth: Float[np.ndarray, " n_n"]

    def __post_init__(self) -> None:
        freeze(self, order=np.int64, bounds=np.int64, directions=np.float64, smallest=np.float64)
        freeze(self, largest=np.float64, fillet=np.float64, growth=np.float64)

    def __call__(
        self, radii: Float[np.ndarray, "n_m 2"]
    ) -> tuple[Float[np.ndarray, " n_n"], Float[np.ndarray, "n_m 2"]]:
        """R of every node, mm, and d log R / d log r of every end for the ball at its node; 0 without members."""
        R, slopes = np.zeros(len(self.growth)), np.zeros(2 * len(radii))
        ends = np.ascontiguousarray(radii, np.float64).ravel()
        place_balls(self.order, self.bounds, self.directions, ends, self.smallest, self.largest, self.fillet, R, slopes)
        return self.growth * R, slopes.reshape(-1, 2)


def rule_at_rest(truss: Truss, knobs: Knobs) -> BallRule:
    """The rule of a truss that was not laid out yet: all nodes as large as wanted."""
    return _rule_of(start_layout(SizedTruss(truss, np.ones((len(truss.members), 3))), knobs))


def rule_as_built(prepared: PreparedTruss) -> BallRule:
    """The rule of a truss as it was laid out, which gives the balls that it got for the radii that it has."""
    rule = _rule_of(prepared.layout)
    R, _ = rule(prepared.sized.radii[:, [0, 2]])
    growth = np.divide(prepared.sizes.radius, R, out=np.ones(len(R)), where=R > 0)
    return BallRule(rule.order, rule.bounds, rule.directions, rule.smallest, rule.largest, rule.fillet, growth)


def _rule_of(layout: Layout) -> BallRule:
    levels = [
        (level.smallest_ratio, level.largest_ratio, level.largest_fillet)
        for level in node_levels(layout.knobs.node_ratio)
    ]
    smallest, largest, fillet = np.array(levels)[layout.level].T
    return BallRule(
        layout.order,
        layout.bounds,
        layout.directions.reshape(-1, 3),
        smallest,
        largest,
        layout.knobs.fillet_ratio * fillet,
        np.ones(len(layout.level)),
    )


def _place_balls(
    order: Any, bounds: Any, directions: Any, ends: Any, smallest: Any, largest: Any, fillet: Any, R: Any, slopes: Any
) -> None:
    for n in range(len(R)):
        mine = order[bounds[n] : bounds[n + 1]]
        if len(mine):
            R[n] = place_ball(mine, directions, ends, smallest[n], largest[n], fillet[n], slopes)


def _place_ball(
    mine: Any, directions: Any, ends: Any, smallest: float, largest: float, fillet: float, slopes: Any
) -> float:
    """R of one node; adds the derivatives to those of its ends."""
    k = len(mine)
    r, angle, needed = np.empty(k), np.zeros((k, k)), np.zeros((k, k))
    creased = np.zeros(k, np.bool_)
    for i in range(k):
        r[i] = ends[mine[i]]
        for j in range(i + 1, k):
            angle[i, j] = angle_between(directions[mine[i]], directions[mine[j]])
    leader = 0
    while True:
        widest = r.max()
        for i in range(k):
            for j in range(i + 1, k):
                needed[i, j] = separating_radius(angle[i, j], r[i], r[j], fillet * r[i], fillet * r[j])
                if needed[i, j] > largest * widest:
                    creased[i] = creased[j] = True
                    needed[i, j] = 0.0
        for i in range(k):
            if creased[i] and (not creased[leader] or r[i] > r[leader]):
                leader = i
        if not equalise(creased, r):
            break
    R = max(smallest * widest, needed.max())
    least, count = (1 - EQUAL) * R, 0
    share = np.zeros(k)
    for i in range(k):
        if smallest * r[i] >= least:
            count += 1
            share[i] += 1.0
        for j in range(i + 1, k):
            if needed[i, j] >= least:
                count += 1
                a, b = weight_of(R, r[i], fillet), weight_of(R, r[j], fillet)
                share[i] += a / (a + b)
                share[j] += b / (a + b)
    for i in range(k):
        slopes[mine[leader if creased[i] else i]] += share[i] / count
    return R


def _weight_of(R: float, r: float, fillet: float) -> float:
    """-d cap / dR of a member."""
    sine = min((1 + fillet) * r / (R + fillet * r), 1 - 1e-12)
    return sine / ((R + fillet * r) * np.sqrt(1 - sine**2))


weight_of = compiled(_weight_of, inline=True)
place_ball = compiled(_place_ball)
place_balls = compiled(_place_balls)
