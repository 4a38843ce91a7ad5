"""Lay out the nodes and members of one truss, as far as it goes without changing the truss itself.

What is tried changes a few nodes or members at a time, and only what they touch is computed again (`Layout.stale`):

1. Two members whose curves leave a node at less than `ACUTE`, though their secants do not, leave along these: the
   spines come back to the curves within the members. A secant runs to the far node, but not farther than `SECANT`.
2. A member needs more room than its two nodes take: reach + reach + `SHORTEST_TUBE` r <= its chord. Where it has less,
   its nodes take smaller spheres and fillets (`node_levels`); then it and its rivals leave along their secants.
3. A tube that would bend more sharply than its radius becomes straight.
4. Nodes without room for the seam of their sphere grow; creases in special position are turned a little; spheres that
   overlap other members take smaller levels.

What still has no place is in trouble: `prepare` then changes the truss.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from michell_cad.cad.centerlines import Centerlines, sample_splines, straight_centerlines
from michell_cad.cad.mitres import Mitre, corner_angles, cut_mitre
from michell_cad.cad.nodes import NodeSizes, angles_between, cap_angle, end_pairs, node_levels, size_nodes
from michell_cad.cad.spheres import Caps, Seams, no_seams, place_seams
from michell_cad.cad.tubes import Tubes, fit_tubes, pinched_tubes
from michell_cad.knobs import Knobs
from michell_cad.splines import MemberSplines, fit_splines
from michell_cad.truss import SizedTruss

SHORTEST_TUBE = 0.3
"""Length of tube that must be left between two nodes (relative to the mean radius of its ends)."""

ACUTE, WORTHWHILE = np.radians(45.0), np.radians(2.0)
"""Curves that enclose less than the first leave along their secants if that gains more than the second, radians."""

SECANT = 1.25
"""Longest secant (relative to the cell edge): the chord of a member of many cells tells nothing about its ends."""

MAX_TRIES = 100
"""Tries to place all nodes of one truss; each try takes one level, one nudge or one growth at the nodes that failed."""

NUDGE = np.radians(0.7)
"""Directions of creased members in special position are turned by multiples of this angle."""

MOST_NUDGES = 4

GROWTH, MOST_GROWTH = 1.12, 2.0
"""A sphere without room for its seam grows by this factor, at most to this multiple (relative)."""

PHASES = np.linspace(0, 2 * np.pi, 25)[:-1]
"""Rotations of a member about itself that are tried to keep its seam away from the corners of its creases."""


@dataclass(eq=False)
class Layout:
    """What is being tried for the nodes and members of one truss; arrays are changed in place.

    `design` are the design curves, `points` and `directions` those to be built. `turned` (n_e,) says whether an end
    leaves along its secant, `straight` (n_m,) whether a member does not follow its curve at all. `level`, `growth`,
    `nudges` (n_n,) are the means tried at nodes. `stale` (n_n,) are nodes to be sized again, `unfit` (n_m,) tubes to be
    fitted again, `unplaced` (n_n,) nodes whose seams are to be placed again.
    """

    sized: SizedTruss
    knobs: Knobs
    splines: MemberSplines
    design: Centerlines
    points: np.ndarray
    directions: np.ndarray
    turned: np.ndarray
    straight: np.ndarray
    level: np.ndarray
    growth: np.ndarray
    nudges: np.ndarray
    sizes: dict[str, np.ndarray]
    tubes: dict[str, Any]
    seams: dict[str, np.ndarray]
    mitres: dict[int, Mitre] = field(default_factory=dict)
    stale: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))
    unfit: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))
    unplaced: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))

    def __post_init__(self) -> None:
        self.node = self.sized.truss.members.ravel()
        n_n = len(self.sized.truss.nodes)
        self.order = np.argsort(self.node, kind="stable")
        self.bounds = np.searchsorted(self.node[self.order], np.arange(n_n + 1))
        self.secants = _secants(self.design, SECANT * self.sized.truss.spacing)
        self.last = len(node_levels(self.knobs.node_ratio)) - 1

    def ends_of(self, i: int) -> np.ndarray:
        """Ends at a node, ascending."""
        return self.order[self.bounds[i] : self.bounds[i + 1]]

    def ends_at(self, nodes: np.ndarray) -> np.ndarray:
        """Ends at some nodes (a mask)."""
        return np.flatnonzero(nodes[self.node])

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
    layout = Layout(
        sized,
        knobs,
        splines,
        design,
        np.array(design.points),
        np.array(design.directions),
        zeros(2 * n_m, bool),
        zeros(n_m, bool),
        zeros(n_n, int),
        np.ones(n_n) if growth is None else growth.copy(),
        zeros(n_n, int),
        sizes,
        _no_tubes(n_m),
        no_seams(n_n),
        stale=used,
        unfit=np.ones(n_m, bool),
        unplaced=used.copy(),
    )
    _spread_acute(layout)
    return layout


def _secants(lines: Centerlines, length: float) -> np.ndarray:
    """Unit vectors from both ends of each member to its far end, or to where the curve is so long; (n_e, 3)."""
    s = np.minimum(length / lines.lengths, 1.0)
    far = lines.at(np.stack([s, 1 - s], axis=1))
    away = far - lines.points[:, [0, -1]]
    return (away / np.linalg.norm(away, axis=2, keepdims=True)).reshape(-1, 3)


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
        rivals = layout.sizes["rival"].reshape(-1, 2)[stuck]
        freed = np.union1d(stuck, rivals[rivals >= 0] // 2)
        freed = freed[~layout.turned.reshape(-1, 2)[freed].all(1)]
        leave_along_secants(layout, np.concatenate([2 * freed, 2 * freed + 1]))
        # With other directions, the nodes may do with less drastic means.
        layout.level[members[freed]] = 0
        trouble.update(stuck[~layout.stale[members[stuck]].any(1)].tolist())
    return trouble


def lower_levels(layout: Layout, nodes: np.ndarray) -> int:
    """Give nodes the next smaller room; returns how many nodes that changes."""
    nodes = np.unique(nodes)
    nodes = nodes[layout.level[nodes] < layout.last]
    layout.level[nodes] += 1
    layout.stale[nodes] = True
    return len(nodes)


def leave_along_secants(layout: Layout, ends: np.ndarray) -> None:
    """Let ends leave their nodes along their secants."""
    layout.turned[ends] = True
    layout.stale[layout.node[ends]] = True


def _spread_acute(layout: Layout) -> None:
    first, second = end_pairs(layout.node)
    d, secants = layout.design.directions.reshape(-1, 3), layout.secants
    curved = angles_between(d[first], d[second])
    straight = angles_between(secants[first], secants[second])
    gains = (curved < ACUTE) & (straight > curved + WORTHWHILE)
    layout.turned[first[gains]] = layout.turned[second[gains]] = True


def _point_ends(layout: Layout, ends: np.ndarray) -> None:
    """Directions of some ends."""
    truss = layout.sized.truss
    d = np.where(layout.turned[ends, None], layout.secants[ends], layout.design.directions.reshape(-1, 3)[ends])
    straight = layout.straight[ends // 2]
    a, b = truss.nodes[layout.node[ends[straight]]], truss.nodes[layout.node[ends[straight] ^ 1]]
    d[straight] = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
    nudges = layout.nudges[layout.node[ends]]
    k = np.flatnonzero(nudges)
    if len(k):
        axis = np.cross(d[k], np.roll(d[k], 1, axis=1) + np.array([0.3, -0.2, 0.1]))
        axis /= np.linalg.norm(axis, axis=1, keepdims=True)
        # Different for every member of the node, the same in every run.
        size = NUDGE * nudges[k] * (1 + (7 * (ends[k] // 2) + ends[k] % 2) % 5) / 3
        d[k] += np.tan(size)[:, None] * np.cross(axis, d[k])
        d[k] /= np.linalg.norm(d[k], axis=1, keepdims=True)
    layout.directions.reshape(-1, 3)[ends] = d


def _size_stale(layout: Layout) -> None:
    nodes, ends = np.flatnonzero(layout.stale), layout.ends_at(layout.stale)
    _point_ends(layout, ends)
    number = np.zeros(len(layout.stale), int)
    number[nodes] = np.arange(len(nodes))
    found = size_nodes(
        number[layout.node[ends]],
        layout.directions.reshape(-1, 3)[ends],
        layout.sized.radii[:, [0, 2]].ravel()[ends],
        len(nodes),
        layout.knobs.fillet_ratio,
        node_levels(layout.knobs.node_ratio),
        layout.level[nodes],
        layout.growth[nodes],
    )
    layout.sizes["radius"][nodes] = found.radius
    for name in ("end_radius", "fillet", "reach", "creased"):
        layout.sizes[name][ends] = getattr(found, name)
    layout.sizes["rival"][ends] = np.where(found.rival >= 0, ends[found.rival], -1)
    layout.unfit[ends // 2] = True
    layout.unplaced[nodes] = True


def _is_tight(layout: Layout, members: np.ndarray) -> np.ndarray:
    reach, r = layout.sizes["reach"].reshape(-1, 2)[members], layout.sizes["end_radius"].reshape(-1, 2)[members]
    return reach.sum(1) + SHORTEST_TUBE * r.mean(1) > layout.sized.truss.lengths[members]


def place(layout: Layout) -> tuple[set[int], set[int]]:
    """Go on until everything is placed; returns the members and nodes that are in trouble."""
    for _ in range(MAX_TRIES):
        members = settle(layout)
        if members:
            return members, set()
        members = _fit_unfit(layout)
        if members:
            return members, set()
        if layout.stale.any():
            continue
        nodes = _place_unplaced(layout)
        if nodes or not layout.stale.any():
            return set(), nodes
    return set(), set(np.flatnonzero(layout.unplaced).tolist())


def _fit_unfit(layout: Layout) -> set[int]:
    """Fit the tubes that need it; pinched ones become straight. Returns members that are pinched even so."""
    members = np.flatnonzero(layout.unfit)
    if not len(members):
        return set()
    tubes = _fit(layout, members, np.zeros(len(members)))
    pinched = members[pinched_tubes(tubes)]
    curved = pinched[~layout.straight[pinched]]
    if len(curved):
        layout.straight[curved] = True
        truss = layout.sized.truss
        chords = straight_centerlines(truss.nodes, truss.members[curved], layout.points.shape[1])
        layout.points[curved] = chords.points
        leave_along_secants(layout, np.concatenate([2 * curved, 2 * curved + 1]))
    hopeless = np.setdiff1d(pinched, curved)
    if len(hopeless) and not lower_levels(layout, layout.sized.truss.members[hopeless]):
        return set(hopeless.tolist())
    _turn_seams(layout, members)
    layout.unplaced[layout.sized.truss.members[members]] = True
    layout.unfit[members] = False
    return set()


def _fit(layout: Layout, members: np.ndarray, phase: np.ndarray) -> Tubes:
    """Fit some tubes, and enter them."""
    sized = layout.sized
    ends = layout.sizes["end_radius"].reshape(-1, 2)[members]
    radii = np.stack([ends[:, 0], sized.radii[members, 1], ends[:, 1]], axis=1)
    lines = Centerlines(layout.points[members], layout.directions[members])
    reach = layout.sizes["reach"].reshape(-1, 2)[members]
    tubes = fit_tubes(lines, sized.truss.nodes[sized.truss.members[members]], reach, radii, phase)
    for name, column in layout.tubes.items():
        if isinstance(column, list):
            for m, values in zip(members.tolist(), getattr(tubes, name), strict=True):
                column[m] = values
        else:
            column[members] = getattr(tubes, name)
    return tubes


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


def _offsets(layout: Layout, i: int, creased: np.ndarray) -> tuple[float, float]:
    """Radii of the offsets of sphere and tubes along which the ball of the fillets rolls."""
    f = float(layout.sizes["fillet"][creased[0]])
    return float(layout.sizes["radius"][i]) + f, float(layout.sizes["end_radius"][creased[0]]) + f


def _turn_seams(layout: Layout, members: np.ndarray) -> None:
    """Turn members with creased ends about themselves so that their angles 0 keep away from corners."""
    chosen = np.zeros(len(layout.unfit), bool)
    chosen[members] = True
    ends = np.flatnonzero(layout.sizes["creased"] & np.repeat(chosen, 2))
    d = layout.directions.reshape(-1, 3)
    normals = layout.tubes["end_normals"].reshape(-1, 3)
    clear: dict[int, np.ndarray] = {}
    for i in np.unique(layout.node[ends]).tolist():
        creased = layout.ends_of(i)
        creased = creased[layout.sizes["creased"][creased]]
        for e, u in zip(
            creased.tolist(),
            corner_angles(d[creased], normals[creased], *_offsets(layout, i, creased)),
            strict=True,
        ):
            if len(u) and chosen[e // 2]:
                # Turning the member forward turns the frame at its second end backward, seen from that node.
                off = u[:, None] - (PHASES if e % 2 == 0 else -PHASES)
                gap = np.abs(np.mod(off + np.pi, 2 * np.pi) - np.pi).min(0)
                clear[e // 2] = np.minimum(clear.get(e // 2, np.inf), gap)
    if clear:
        _fit(layout, np.array(list(clear)), np.array([PHASES[int(np.argmax(gap))] for gap in clear.values()]))


def _place_unplaced(layout: Layout) -> set[int]:
    """Cut creases and place seams where needed; helps nodes without, and returns those beyond help."""
    nodes = np.flatnonzero(layout.unplaced)
    creased, groups, vertices = _cut_creases(layout, nodes)
    failed = [i for i in nodes.tolist() if i in creased and i not in layout.mitres]
    d = layout.directions.reshape(-1, 3)
    normals = layout.tubes["end_normals"].reshape(-1, 3)
    sizes = layout.sizes
    a = cap_angle(sizes["radius"][layout.node], sizes["end_radius"], sizes["fillet"])
    valence = layout.bounds[nodes + 1] - layout.bounds[nodes]
    most = np.array([max((len(v) for v in vertices.get(i, ())), default=1) for i in nodes.tolist()])
    for k, v in np.unique(np.stack([valence, most], axis=1), axis=0):
        some = nodes[(valence == k) & (most == v)]
        ends = layout.order[layout.bounds[some][:, None] + np.arange(k)]
        at = np.zeros((len(some), k, v))
        group = np.tile(np.arange(k), (len(some), 1))
        for row, i in enumerate(some.tolist()):
            if i in vertices:
                group[row] = groups[i]
                for column, angles in enumerate(vertices[i]):
                    at[row, column] = np.resize(angles, v)
        found = place_seams(Caps(d[ends], a[ends], group, normals[ends], at))
        for name, column in layout.seams.items():
            column[some] = getattr(found, name)
    without = nodes[~layout.seams["found"][nodes]]
    layout.unplaced[nodes] = False
    layout.nudges[failed] += 1
    layout.growth[np.setdiff1d(without, failed)] *= GROWTH
    helpless = (layout.nudges > MOST_NUDGES) | (layout.growth > MOST_GROWTH)
    again = np.union1d(without, np.array(failed, int))
    layout.stale[again[~helpless[again]]] = True
    return set(again[helpless[again]].tolist())


def _cut_creases(layout: Layout, nodes: np.ndarray):
    """Mitres of the creased ones among the nodes; for these nodes, which caps overlap and the vertices on circles."""
    d = layout.directions.reshape(-1, 3)
    normals = layout.tubes["end_normals"].reshape(-1, 3)
    has_crease = np.zeros(len(layout.level), bool)
    has_crease[layout.node[layout.sizes["creased"]]] = True
    groups: dict[int, np.ndarray] = {}
    vertices: dict[int, list[np.ndarray]] = {}
    for i in nodes.tolist():
        layout.mitres.pop(i, None)
    cut = nodes[has_crease[nodes]].tolist()
    for i in cut:
        ends = layout.ends_of(i)
        local = np.flatnonzero(layout.sizes["creased"][ends])
        creased = ends[local]
        mitre = cut_mitre(d[creased], normals[creased], *_offsets(layout, i, creased))
        if mitre is not None:
            layout.mitres[i] = mitre
            groups[i], vertices[i] = _loops(len(ends), local, mitre)
    return set(cut), groups, vertices


def _loops(n: int, creased: np.ndarray, mitre: Mitre) -> tuple[np.ndarray, list[np.ndarray]]:
    """Which of the n caps of a node overlap, directly or not, and the vertices on each circle."""
    groups, vertices = np.arange(n), [np.zeros(1)] * n
    for k, path in enumerate(mitre.pieces):
        vertices[creased[k]] = np.array([piece.start for piece in path])
        for piece in path:
            if piece.neighbour >= 0:
                groups[groups == groups[creased[piece.neighbour]]] = groups[creased[k]]
    return groups, vertices
