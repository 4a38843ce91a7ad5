"""Place what a layout has sized: tubes, the creases where members meet at acute angles, and the seams of the spheres.

What fails is helped a little, and then only what that touches is done again: pinched tubes follow smoother curves,
creases in special position are turned, spheres without room for their seam grow.
"""

import numpy as np
from jaxtyping import Float

from michell_cad.cad.centerlines import SMOOTHINGS, Centerlines, smooth_curves
from michell_cad.cad.layout import Layout, lower_levels, settle
from michell_cad.cad.mitres import Mitre, corner_angles, cut_mitre
from michell_cad.cad.nodes import cap_angle
from michell_cad.cad.spheres import Caps, place_seams
from michell_cad.cad.tubes import Tubes, fit_tubes, pinched_tubes
from michell_cad.truss import member_radius

MAX_TRIES = 100
"""Tries to place all nodes of one truss; each try takes one level, one nudge or one growth at the nodes that failed."""

MOST_NUDGES = 4
"""Times that a crease in special position is turned."""

GROWTH, MOST_GROWTH = 1.12, 2.0
"""A sphere without room for its seam grows by this factor, at most to this multiple (relative)."""

STATIONS = np.linspace(0, 1, 34)[1:-1]
"""Where the radius along a member is looked at."""

PHASES = np.linspace(0, 2 * np.pi, 25)[:-1]
"""Rotations of a member about itself that are tried to keep its seam away from the corners of its creases."""


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
        _turn_seams(layout, np.flatnonzero(layout.unturned))
        layout.unturned[:] = False
        nodes = _place_unplaced(layout)
        if nodes or not layout.stale.any():
            return set(), nodes
    return set(), set(np.flatnonzero(layout.unplaced).tolist())


def _fit_unfit(layout: Layout) -> set[int]:
    """Fit the tubes that need it; pinched ones follow smoother curves. Returns members that are pinched even so."""
    members = np.flatnonzero(layout.unfit)
    if not len(members):
        return set()
    tubes = _fit(layout, members, np.zeros(len(members)))
    pinched = members[pinched_tubes(tubes)]
    curved = pinched[layout.smoothed[pinched] < len(SMOOTHINGS)]
    if len(curved):
        layout.smoothed[curved] += 1
        layout.points[curved] = smooth_curves(layout.design.points[curved], layout.smoothed[curved])
        layout.stale[layout.sized.truss.members[curved]] = True
    hopeless = np.setdiff1d(pinched, curved)
    if len(hopeless) and not lower_levels(layout, layout.sized.truss.members[hopeless]):
        return set(hopeless.tolist())
    layout.unplaced[layout.sized.truss.members[members]] = True
    layout.unturned[members] = True
    layout.unfit[members] = False
    return set()


def without_waist(radii: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Radii at start, middle and end, with a middle so thick that the tube is nowhere thinner than these three.

    At a crease a thin member is as thick as its rival. On the way from there to its own radius `member_radius`
    would fall below that by an eighth of the difference: more than there is, if the rival is ten times as thick.
    """
    r0, _, r2 = radii.T[..., None]
    mean = (r0 + r2) / 2
    base = member_radius(np.stack([r0, mean, r2], axis=-1), STATIONS)
    bump = member_radius(np.array([0.0, 1.0, 0.0]), STATIONS)
    needed = mean[:, 0] + ((radii.min(1)[:, None] - base) / bump).max(1)
    return np.stack([radii[:, 0], np.maximum(radii[:, 1], needed), radii[:, 2]], axis=1)


def _fit(layout: Layout, members: np.ndarray, phase: np.ndarray) -> Tubes:
    """Fit some tubes, and enter them."""
    sized = layout.sized
    ends = layout.sizes["end_radius"].reshape(-1, 2)[members]
    radii = without_waist(np.stack([ends[:, 0], sized.radii[members, 1], ends[:, 1]], axis=1))
    lines = Centerlines(layout.points[members], layout.directions[members])
    reach = layout.sizes["reach"].reshape(-1, 2)[members]
    nodes = sized.truss.nodes[sized.truss.members[members]]
    tubes = fit_tubes(lines, nodes, reach, radii, phase, layout.smoothed[members] > 0)
    for name, column in layout.tubes.items():
        if isinstance(column, list):
            for m, values in zip(members.tolist(), getattr(tubes, name), strict=True):
                column[m] = values
        else:
            column[members] = getattr(tubes, name)
    return tubes


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
    for k in np.unique(valence):
        some = nodes[valence == k]
        ends = layout.order[layout.bounds[some][:, None] + np.arange(k)]
        most = max((len(v) for i in some.tolist() for v in vertices.get(i, ())), default=1)
        at = np.zeros((len(some), k, most))
        group = np.tile(np.arange(k), (len(some), 1))
        for row, i in enumerate(some.tolist()):
            if i in vertices:
                group[row] = groups[i]
                for column, angles in enumerate(vertices[i]):
                    # Filled up by the first: it is there anyway.
                    at[row, column], at[row, column, : len(angles)] = angles[0], angles
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
