"""Lay out the nodes and members of one truss, as far as it goes without changing the truss itself.

What is tried changes a few nodes or members at a time, and only what they touch is computed again (`Layout.stale`):

1. A member leaves its node towards the point at which its curve leaves the room that the node takes of it: there the
   tube begins, on the curve. How much room that is depends on the angles between the members, which change with these
   points: they move outward until they are as far as the tubes begin (`_size_stale`). So curves that touch at a node
   need no more room than up to where they have parted.
2. A member needs more room than its two nodes take: reach + reach + `SHORTEST_TUBE` r <= its chord. Where it has less,
   its nodes take smaller spheres and fillets (`node_levels`); then it and its rivals aim farther along their curves, at
   most at the far node (`AIM_STEPS`).
3. A tube that would bend more sharply than its radius follows a smoother curve (`smooth_curves`), a straight one at
   last.
4. Nodes without room for the seam of their sphere grow; creases in special position are turned a little; spheres that
   overlap other members take smaller levels.

What still has no place is in trouble: `prepare` then changes the truss.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from michell_cad.cad.aiming import size_nodes
from michell_cad.cad.centerlines import SMOOTHINGS, Centerlines, points_at, sample_splines, smooth_curves
from michell_cad.cad.mitres import Mitre
from michell_cad.cad.nodes import CREASE_CLEARANCE, NodeSizes, angles_between, node_levels
from michell_cad.cad.spheres import Seams, no_seams
from michell_cad.cad.tubes import Tubes
from michell_cad.knobs import Knobs
from michell_cad.splines import MemberSplines, fit_splines
from michell_cad.truss import SizedTruss

SHORTEST_TUBE = 0.3
"""Length of tube that must be left between two nodes (relative to the mean radius of its ends)."""

FARTHEST_CELLS = 1.25
"""Members without room aim at most this far (relative to the cell edge): the far node of a member of many cells tells
nothing about its ends."""

AIM_STEPS = 1.15 ** np.arange(1, 17)
"""They aim at the nearest of these places (relative to where they aim) that gives them room."""

AIM_SPARE = np.radians(0.5)
"""More than the angle that they need, radians."""

SHAKE = 1.06
"""Spheres of nodes that the kernel finds faulty grow by this factor, each time (relative)."""

STRAIGHTENED = 4
"""Members of a node that was faulty so often become straight."""


@dataclass(eq=False)
class Layout:
    """What is being tried for the nodes and members of one truss; arrays are changed in place.

    `design` are the design curves, `points` and `directions` those to be built. `aim` (n_e,) is how far along its curve
    an end aims, mm, `lift` (n_e,) the least that it must; `smoothed` (n_m,) counts the `SMOOTHINGS`. `level`, `growth`,
    `nudges` (n_n,) are the means tried at nodes. `stale` (n_n,) are nodes to be sized again, `unfit` (n_m,) tubes to be
    fitted again, `unturned` (n_m,) tubes whose angle 0 is to be chosen, `unplaced` (n_n,) nodes whose seams are to be
    placed again. `shakes` (n_n,) counts how often the kernel found a node faulty.
    """

    sized: SizedTruss
    knobs: Knobs
    splines: MemberSplines
    design: Centerlines
    points: np.ndarray
    directions: np.ndarray
    aim: np.ndarray
    lift: np.ndarray
    smoothed: np.ndarray
    level: np.ndarray
    growth: np.ndarray
    nudges: np.ndarray
    sizes: dict[str, np.ndarray]
    tubes: dict[str, Any]
    seams: dict[str, np.ndarray]
    mitres: dict[int, Mitre] = field(default_factory=dict)
    stale: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))
    unfit: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))
    unturned: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))
    unplaced: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))
    shakes: np.ndarray = field(default_factory=lambda: np.zeros(0, int))

    def __post_init__(self) -> None:
        self.node = self.sized.truss.members.ravel()
        n_n = len(self.sized.truss.nodes)
        self.order = np.argsort(self.node, kind="stable")
        self.bounds = np.searchsorted(self.node[self.order], np.arange(n_n + 1))
        self.radii = self.sized.radii[:, [0, 2]].ravel()
        self.last = len(node_levels(self.knobs.node_ratio)) - 1

    def ends_of(self, i: int) -> np.ndarray:
        """Ends at a node, ascending."""
        return self.order[self.bounds[i] : self.bounds[i + 1]]

    def ends_at(self, nodes: np.ndarray) -> np.ndarray:
        """Ends at some nodes (a mask)."""
        return np.flatnonzero(nodes[self.node])

    @cached_property
    def lengths(self) -> np.ndarray:
        """Lengths of the design curves, mm."""
        return self.design.lengths

    @cached_property
    def farthest(self) -> np.ndarray:
        """The farthest that each end may aim, mm."""
        return np.minimum(self.lengths, FARTHEST_CELLS * self.sized.truss.spacing).repeat(2)

    def members_at(self, nodes: np.ndarray) -> np.ndarray:
        """Members with an end at one of some nodes (a mask)."""
        return np.flatnonzero(nodes[self.sized.truss.members].any(1))

    def node_sizes(self) -> NodeSizes:
        """The sizes as a value."""
        return NodeSizes(**self.sizes)

    def all_seams(self) -> Seams:
        """The seams as a value."""
        return Seams(**self.seams)

    def all_tubes(self) -> Tubes:
        """The tubes as a value."""
        return Tubes(**self.tubes)

    def centerlines(self) -> Centerlines:
        """The centre lines to be built."""
        return Centerlines(self.points, self.directions)


def start_layout(
    sized: SizedTruss, knobs: Knobs, growth: np.ndarray | None = None, known: Layout | None = None
) -> Layout:
    """A layout of which nothing is done yet; curves that a known layout has as well are not sampled again."""
    truss = sized.truss
    n_n, n_m = len(truss.nodes), len(truss.members)
    splines = fit_splines(truss)
    design = sample_splines(splines) if known is None else _sample_new(splines, known)
    zeros = np.zeros
    sizes = {
        "radius": zeros(n_n),
        "end_radius": zeros(2 * n_m),
        "fillet": zeros(2 * n_m),
        "reach": zeros(2 * n_m),
        "creased": zeros(2 * n_m, bool),
        "rival": np.full(2 * n_m, -1),
    }
    used = np.bincount(truss.members.ravel(), minlength=n_n) > 0
    return Layout(
        sized,
        knobs,
        splines,
        design,
        np.array(design.points),
        np.array(design.directions),
        zeros(2 * n_m),
        zeros(2 * n_m),
        zeros(n_m, int),
        zeros(n_n, int),
        np.ones(n_n) if growth is None else growth.copy(),
        zeros(n_n, int),
        sizes,
        _no_tubes(n_m),
        no_seams(n_n),
        stale=used,
        unfit=np.ones(n_m, bool),
        unturned=np.zeros(n_m, bool),
        unplaced=used.copy(),
        shakes=zeros(n_n, int),
    )


def shake(layout: Layout, times: np.ndarray) -> None:
    """Lay out nodes that the kernel found faulty so many times (n_n,) in another way each time.

    Their spheres grow a bit; from the second time on their members are also turned a little and their fillets smaller,
    and at last the members are straight.
    """
    members = layout.sized.truss.members
    nodes, layout.shakes = np.flatnonzero(times > layout.shakes), times
    layout.growth[nodes] = np.maximum(layout.growth[nodes], SHAKE ** times[nodes])
    layout.nudges[nodes], layout.level[nodes] = times[nodes] // 2, np.minimum(times[nodes] // 2, layout.last)
    straight = (times[members] >= STRAIGHTENED).any(1) & (layout.smoothed < len(SMOOTHINGS))
    layout.smoothed[straight] = len(SMOOTHINGS)
    layout.points[straight] = smooth_curves(layout.design.points[straight], layout.smoothed[straight])
    layout.stale[nodes] = True
    layout.stale[members[straight]] = True


def _sample_new(splines: MemberSplines, known: Layout) -> Centerlines:
    """Centre lines, those of splines that a layout knows taken from there."""
    samples = known.points.shape[1]
    _, was, now = np.intersect1d(_signatures(known.splines), _signatures(splines), return_indices=True)
    points, directions = (np.empty((len(splines.offsets) - 1, *x.shape[1:])) for x in (known.points, known.directions))
    points[now], directions[now] = known.design.points[was], known.design.directions[was]
    fresh = np.ones(len(points), bool)
    fresh[now] = False
    fresh = np.flatnonzero(fresh)
    if len(fresh):
        sampled = sample_splines(splines.some(fresh), samples)
        points[fresh], directions[fresh] = sampled.points, sampled.directions
    return Centerlines(points, directions)


def _signatures(splines: MemberSplines) -> np.ndarray:
    """A number for each member that two different splines do not share."""
    weights = np.sqrt(np.arange(2.0, 14.0))
    return np.add.reduceat(splines.control_points.reshape(-1, 12) @ weights, splines.offsets[:-1])


def settle(layout: Layout) -> set[int]:
    """Size all stale nodes, giving smaller rooms to nodes between which a member is too short.

    Returns the members for which no room is small enough.
    """
    members = layout.sized.truss.members
    trouble: set[int] = set()
    while layout.stale.any():
        _size_stale(layout)
        near = layout.members_at(layout.stale)
        layout.stale[:] = False
        tight = near[_is_tight(layout, near)]
        trouble.difference_update(near.tolist())
        lower_levels(layout, members[tight])
        stuck = tight[(layout.level[members[tight]] == layout.last).all(1) & ~layout.stale[members[tight]].any(1)]
        freed = layout.node[_aim_farther(layout, stuck)]
        # With other directions, the nodes may do with less drastic means.
        layout.level[freed], layout.stale[freed] = 0, True
        trouble.update(stuck[~layout.stale[members[stuck]].any(1)].tolist())
    return trouble


def lower_levels(layout: Layout, nodes: np.ndarray) -> int:
    """Give nodes the next smaller room; returns how many nodes that changes."""
    nodes = np.unique(nodes)
    nodes = nodes[layout.level[nodes] < layout.last]
    layout.level[nodes] += 1
    layout.stale[nodes] = True
    return len(nodes)


def _aim_farther(layout: Layout, members: np.ndarray) -> np.ndarray:
    """Let the creased ends of members without room, and their rivals, aim farther along their curves.

    Both aim at the nearest place at which they enclose an angle that leaves the member its room, or at the last of
    `AIM_STEPS`. Returns the ends that now aim farther.
    """
    sizes, chords = layout.sizes, layout.sized.truss.lengths[members]
    reach, r = (sizes[name].reshape(-1, 2)[members] for name in ("reach", "end_radius"))
    rival = sizes["rival"].reshape(-1, 2)[members]
    tips, rest = np.where(rival >= 0, reach, 0.0), np.where(rival >= 0, 0.0, reach)
    share = (chords - SHORTEST_TUBE * r.mean(1) - rest.sum(1)) / np.maximum(tips.sum(1), 1e-12)
    row, side = np.nonzero((rival >= 0) & np.isfinite(reach))
    e, q = 2 * members[row] + side, rival[row, side]
    room = reach[row, side] * share[row] - CREASE_CLEARANCE * sizes["end_radius"][e]
    needed = 2 * np.arctan((sizes["end_radius"] + sizes["fillet"])[e] / np.maximum(room, 1e-12))
    aims = np.maximum(layout.aim[e], layout.aim[q])[:, None] * AIM_STEPS
    d = [_directions(layout, end, np.minimum(aims, layout.farthest[end][:, None])) for end in (e, q)]
    enough = angles_between(*d) >= needed[:, None] + AIM_SPARE
    enough[:, -1] = True
    aim = aims[np.arange(len(e)), enough.argmax(1)]
    changed = []
    for end in (e, q):
        wanted = np.minimum(aim, layout.farthest[end])
        more = wanted > layout.lift[end]
        np.maximum.at(layout.lift, end[more], wanted[more])
        changed.append(end[more])
    return np.unique(np.concatenate(changed))


def _directions(layout: Layout, ends: np.ndarray, aims: np.ndarray) -> np.ndarray:
    """Unit vectors (n, j, 3) from the nodes of ends to the points of their curves at the distances `aims` (n, j)."""
    m, side = ends // 2, ends % 2
    s = np.minimum(aims / layout.lengths[m][:, None], 1.0)
    d = points_at(layout.points[m], np.where(side[:, None] == 0, s, 1 - s)) - layout.points[m, -side][:, None]
    return d / np.linalg.norm(d, axis=2, keepdims=True)


def _size_stale(layout: Layout) -> None:
    """Size the stale nodes; their ends aim farther until their tubes begin where they aim."""
    nodes, ends, sizes = np.flatnonzero(layout.stale), layout.ends_at(layout.stale), layout.sizes
    layout.unfit[ends // 2] = True
    layout.unplaced[nodes] = True
    layout.aim[ends] = np.maximum(_rest_reach(layout, ends), layout.lift[ends])
    levels = node_levels(layout.knobs.node_ratio)
    room = np.array([(level.smallest_ratio, level.largest_ratio) for level in levels])[layout.level]
    fillet = layout.knobs.fillet_ratio * np.array([level.largest_fillet for level in levels])[layout.level]
    size_nodes(
        nodes,
        layout.order,
        layout.bounds,
        layout.points,
        layout.lengths,
        layout.radii,
        layout.nudges,
        room * layout.growth[:, None],
        fillet,
        layout.aim,
        layout.directions.reshape(-1, 3),
        *(sizes[name] for name in ("radius", "end_radius", "fillet", "reach", "creased", "rival")),
    )


def _rest_reach(layout: Layout, ends: np.ndarray) -> np.ndarray:
    """Where the tubes begin at nodes whose members are all at wide angles, mm."""
    levels = node_levels(layout.knobs.node_ratio)
    ratio, fillet = np.array([(level.smallest_ratio, level.largest_fillet) for level in levels]).T
    fillet = fillet * layout.knobs.fillet_ratio
    level = layout.level[layout.node[ends]]
    return layout.radii[ends] * np.sqrt((ratio + fillet) ** 2 - (1 + fillet) ** 2)[level]


def _is_tight(layout: Layout, members: np.ndarray) -> np.ndarray:
    reach, r = layout.sizes["reach"].reshape(-1, 2)[members], layout.sizes["end_radius"].reshape(-1, 2)[members]
    return reach.sum(1) + SHORTEST_TUBE * r.mean(1) > layout.sized.truss.lengths[members]


def _no_tubes(n: int) -> dict[str, Any]:
    """The columns of `Tubes`, to be filled in."""
    return {
        "sections": np.zeros(n, int),
        "spines": [np.zeros((0, 3))] * n,
        "poles": [np.zeros((0, 3))] * n,
        "end_normals": np.zeros((n, 2, 3)),
        "radii": np.zeros((n, 3)),
        "straight": np.zeros(n, bool),
    }
