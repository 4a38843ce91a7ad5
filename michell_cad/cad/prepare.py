"""Prepare a sized truss for its shell: place spheres, mitres, seams and tubes, and change what cannot be built.

A member needs more room than its two nodes take: reach + reach + `SHORTEST_TUBE` r <= its chord. Where it has less, its
nodes take smaller spheres and fillets (`node_levels`), then it becomes straight, since the tangents of two curves may
enclose less than their chords. Where that does not help, the truss itself is changed (`simplify_truss`) and everything
starts again:

* a mitre longer than the member: the two members are near-parallel, so the longer one is led through the far node of
  the shorter one, or the two far nodes are merged if they are close;
* otherwise the two nodes of the member are merged.

A tube that would bend more sharply than its radius gets straight ends along its chord.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from michell_cad.cad.centerlines import Centerlines, sample_splines, straight_centerlines
from michell_cad.cad.mitres import Mitre, corner_angles, cut_mitre
from michell_cad.cad.nodes import NodeSizes, cap_angle, node_levels, size_nodes
from michell_cad.cad.prepared import NodeMitre, PreparedTruss
from michell_cad.cad.simplify import simplify_truss
from michell_cad.cad.spheres import Seam, place_seam, renumber_cuts
from michell_cad.cad.tubes import Tubes, fit_tubes, pinched_tubes
from michell_cad.errors import GeometryKernelError
from michell_cad.knobs import Knobs
from michell_cad.splines import fit_splines
from michell_cad.truss import SizedTruss, Truss

SHORTEST_TUBE = 0.3
"""Length of tube that must be left between two nodes (relative to the mean radius of its ends)."""

MAX_ROUNDS = 60
"""Rounds of changes to the truss; each round removes members or shortens them, so there is an end."""

DETOUR_ROUNDS = 10
"""After this many rounds nodes are merged only: detours could follow each other in a circle, merges come to an end."""

SHORT = 2.5
"""A member shorter than this has its nodes merged, not its rivals rerouted (relative to the radius of its ends)."""

MAX_TRIES = 60
"""Tries to place all nodes of one truss; each try takes one level, one nudge or one growth at the nodes that failed."""

NUDGE = np.radians(0.7)
"""Directions of mitred members in special position are turned by multiples of this angle."""

MOST_NUDGES = 4

GROWTH, MOST_GROWTH = 1.12, 2.0
"""A sphere without room for its seam grows by this factor, at most to this multiple (relative)."""

CLOSE = 0.35
"""Far ends of near-parallel members are merged if nearer than this (relative to the shorter member)."""

PHASES = np.linspace(0, 2 * np.pi, 25)[:-1]
"""Rotations of a member about itself that are tried to keep its seam away from the corners of its mitres."""


@dataclass(eq=False)
class _Attempt:
    """What is being tried for the nodes and members of one truss."""

    sized: SizedTruss
    knobs: Knobs
    lines: Centerlines
    level: np.ndarray
    straight: np.ndarray
    nudges: np.ndarray
    growth: np.ndarray
    trouble: dict[str, set[int]] = field(default_factory=lambda: {"members": set(), "nodes": set()})


@dataclass(frozen=True, eq=False)
class _Placed:
    """A successful attempt."""

    lines: Centerlines
    sizes: NodeSizes
    tubes: Tubes
    mitres: dict[int, NodeMitre]
    seams: dict[int, Seam]


def prepare_truss(
    sized: SizedTruss, knobs: Knobs, progress: Callable[[float], None] | None = None
) -> PreparedTruss:
    """Place everything that the shell consists of, changing the truss where it cannot be built.

    Parameters
    ----------
    sized : the truss with its radii.
    knobs : node_ratio and fillet_ratio are used.
    progress : told the fraction of the work done.

    Raises
    ------
    GeometryKernelError
        If no change makes the truss buildable; names curves and a radius that works.
    """
    current = sized
    merged_nodes = rerouted = 0
    touched = np.zeros(len(sized.truss.nodes), bool)
    for round_number in range(MAX_ROUNDS):
        attempt = _start(current, knobs)
        placed = _place(attempt)
        if placed is not None:
            if progress is not None:
                progress(1.0)
            return _describe(sized, attempt, placed, touched, merged_nodes, rerouted)
        merges, detours = _choose_changes(attempt, round_number < DETOUR_ROUNDS)
        current, number = simplify_truss(current, merges, detours)
        if not len(current.truss.members):
            break
        hit = np.zeros(len(number), bool)
        hit[: len(touched)] = touched
        hit[[i for pair in merges for i in pair] + [j for _, j in detours]] = True
        touched = np.zeros(len(current.truss.nodes), bool)
        touched[number[hit & (number >= 0)]] = True
        merged_nodes, rerouted = merged_nodes + len(merges), rerouted + len(detours)
    raise GeometryKernelError(_explain_failure(sized, knobs))


def _start(sized: SizedTruss, knobs: Knobs) -> _Attempt:
    truss = sized.truss
    n_n, n_m = len(truss.nodes), len(truss.members)
    lines = sample_splines(fit_splines(truss))
    return _Attempt(
        sized, knobs, lines, np.zeros(n_n, int), np.zeros(n_m, bool), np.zeros(n_n, int), np.ones(n_n)
    )


def _place(attempt: _Attempt) -> _Placed | None:
    """Try until everything is placed; None if some members or nodes are beyond help (`attempt.trouble`)."""
    last = len(node_levels(attempt.knobs.node_ratio)) - 1
    for _ in range(MAX_TRIES):
        attempt.trouble = {"members": set(), "nodes": set()}
        lines = _directed(attempt)
        sizes = _sizes(attempt, lines)
        members = attempt.sized.truss.members
        tight = _tight_members(attempt.sized, sizes)
        retry = _raise_levels(attempt, members[tight], last)
        stuck = tight & (attempt.level[members] == last).all(1)
        if _straighten(attempt, sizes, stuck) or retry:
            continue
        if stuck.any():
            attempt.trouble["members"] |= set(np.flatnonzero(stuck).tolist())
            return None
        tubes = _fit(attempt, lines, sizes, np.zeros(len(members)))
        pinched = pinched_tubes(tubes)
        if (pinched & ~attempt.straight).any():
            attempt.straight |= pinched
            continue
        stuck = pinched & (_raise_levels(attempt, members[pinched], last) == 0)
        if pinched.any() and not stuck.any():
            continue
        attempt.trouble["members"] |= set(np.flatnonzero(stuck).tolist())
        tubes = _turn_seams(attempt, lines, sizes, tubes)
        mitres, failed_mitres = _cut_mitres(attempt, lines, sizes, tubes)
        seams, failed_seams = _place_seams(attempt, lines, sizes, tubes, mitres)
        if not (failed_mitres or failed_seams or attempt.trouble["members"]):
            return _Placed(lines, sizes, tubes, mitres, seams)
        _help_nodes(attempt, failed_mitres, failed_seams)
        if attempt.trouble["members"] or attempt.trouble["nodes"]:
            return None
    return None


def _directed(attempt: _Attempt) -> Centerlines:
    """The centre lines, with straight members and nudged directions in place."""
    lines, truss = attempt.lines, attempt.sized.truss
    points, directions = np.array(lines.points), np.array(lines.directions)
    if attempt.straight.any():
        chords = straight_centerlines(truss.nodes, truss.members[attempt.straight])
        points[attempt.straight], directions[attempt.straight] = chords.points, chords.directions
    for m, side in np.argwhere(attempt.nudges[truss.members] > 0):
        d = directions[m, side]
        axis = np.cross(d, np.roll(d, 1) + np.array([0.3, -0.2, 0.1]))
        # Different for every member of the node, the same in every run.
        size = NUDGE * attempt.nudges[truss.members[m, side]] * (1 + (7 * m + side) % 5) / 3
        d = d + np.tan(size) * np.cross(axis / np.linalg.norm(axis), d)
        directions[m, side] = d / np.linalg.norm(d)
    return Centerlines(points, directions)


def _sizes(attempt: _Attempt, lines: Centerlines) -> NodeSizes:
    truss, knobs = attempt.sized.truss, attempt.knobs
    levels = node_levels(knobs.node_ratio)
    return size_nodes(
        truss.members.ravel(),
        lines.directions.reshape(-1, 3),
        attempt.sized.radii[:, [0, 2]].ravel(),
        len(truss.nodes),
        knobs.fillet_ratio,
        levels,
        attempt.level,
        attempt.growth,
    )


def _tight_members(sized: SizedTruss, sizes: NodeSizes) -> np.ndarray:
    reach, r = sizes.reach.reshape(-1, 2), sizes.end_radius.reshape(-1, 2)
    return reach.sum(1) + SHORTEST_TUBE * r.mean(1) > sized.truss.lengths


def _raise_levels(attempt: _Attempt, members: np.ndarray, last: int) -> int:
    """Give the nodes of these members the next smaller room; returns how many nodes that changes."""
    nodes = np.unique(members)
    nodes = nodes[attempt.level[nodes] < last]
    attempt.level[nodes] += 1
    return len(nodes)


def _straighten(attempt: _Attempt, sizes: NodeSizes, stuck: np.ndarray) -> bool:
    """Make members without room and their rivals straight: tangents may be more acute than chords. Whether any was not."""
    rivals = sizes.rival.reshape(-1, 2)[stuck]
    members = np.union1d(np.flatnonzero(stuck), rivals[rivals >= 0] // 2)
    members = members[~attempt.straight[members]]
    attempt.straight[members] = True
    # With other directions, the nodes may do with less drastic means.
    attempt.level[attempt.sized.truss.members[members]] = 0
    return len(members) > 0


def _fit(attempt: _Attempt, lines: Centerlines, sizes: NodeSizes, phase: np.ndarray) -> Tubes:
    truss = attempt.sized.truss
    ends = sizes.end_radius.reshape(-1, 2)
    radii = np.stack([ends[:, 0], attempt.sized.radii[:, 1], ends[:, 1]], axis=1)
    return fit_tubes(lines, truss.nodes[truss.members], sizes.reach.reshape(-1, 2), radii, phase)


def _mitred_ends(attempt: _Attempt, sizes: NodeSizes) -> dict[int, np.ndarray]:
    node = attempt.sized.truss.members.ravel()
    ends = np.flatnonzero(sizes.mitred)
    if not len(ends):
        return {}
    order = ends[np.argsort(node[ends], kind="stable")]
    nodes, starts = np.unique(node[order], return_index=True)
    return {int(i): part for i, part in zip(nodes, np.split(order, starts[1:]), strict=True)}


def _turn_seams(attempt: _Attempt, lines: Centerlines, sizes: NodeSizes, tubes: Tubes) -> Tubes:
    """Turn the mitred members about themselves so that their angles 0 keep away from corners."""
    d = lines.directions.reshape(-1, 3)
    normals = tubes.frames[:, [0, -1], 0].reshape(-1, 3)
    clear: dict[int, np.ndarray] = {}
    for i, ends in _mitred_ends(attempt, sizes).items():
        for k, e in enumerate(ends):
            u = corner_angles(k, d[ends], normals[e], sizes.radius[i], sizes.end_radius[e])
            if len(u):
                # Turning the member forward turns the frame at its second end backward, seen from that node.
                off = u[:, None] - (PHASES if e % 2 == 0 else -PHASES)
                gap = np.abs(np.mod(off + np.pi, 2 * np.pi) - np.pi).min(0)
                m = int(e) // 2
                clear[m] = np.minimum(clear.get(m, np.inf), gap)
    if not clear:
        return tubes
    phase = np.zeros(len(tubes.straight))
    for m, gap in clear.items():
        phase[m] = PHASES[int(np.argmax(gap))]
    return _fit(attempt, lines, sizes, phase)


def _cut_mitres(attempt, lines, sizes, tubes) -> tuple[dict[int, NodeMitre], list[int]]:
    d = lines.directions.reshape(-1, 3)
    normals = tubes.frames[:, [0, -1], 0].reshape(-1, 3)
    mitres: dict[int, NodeMitre] = {}
    failed = []
    for i, ends in _mitred_ends(attempt, sizes).items():
        mitre = cut_mitre(d[ends], normals[ends], sizes.radius[i], sizes.end_radius[ends[0]])
        if mitre is None:
            failed.append(i)
        else:
            mitres[i] = NodeMitre(ends, mitre)
    return mitres, failed


def _place_seams(attempt, lines, sizes, tubes, mitres) -> tuple[dict[int, Seam], list[int]]:
    node = attempt.sized.truss.members.ravel()
    d = lines.directions.reshape(-1, 3)
    normals = tubes.frames[:, [0, -1], 0].reshape(-1, 3)
    a = cap_angle(sizes.radius[node], sizes.end_radius, sizes.fillet)
    order = np.argsort(node, kind="stable")
    nodes, starts = np.unique(node[order], return_index=True)
    seams: dict[int, Seam] = {}
    failed = []
    zero = np.zeros(1)
    for i, ends in zip(nodes.tolist(), np.split(order, starts[1:]), strict=True):
        groups, vertices = np.arange(len(ends)), [zero] * len(ends)
        if i in mitres:
            groups, vertices = _loops(ends, mitres[i])
        seam = place_seam(d[ends], a[ends], groups, normals[ends], vertices)
        if seam is None:
            failed.append(i)
        else:
            seams[i] = renumber_cuts(seam, ends)
    return seams, failed


def _loops(ends: np.ndarray, mitred: NodeMitre) -> tuple[np.ndarray, list[np.ndarray]]:
    """Which caps of a node overlap, directly or not, and the vertices on each circle."""
    place = {int(e): k for k, e in enumerate(ends)}
    groups, vertices = np.arange(len(ends)), [np.zeros(1)] * len(ends)
    for k, path in enumerate(mitred.mitre.pieces):
        mine = place[int(mitred.ends[k])]
        vertices[mine] = np.array([piece.start for piece in path])
        for piece in path:
            if piece.neighbour >= 0:
                other = place[int(mitred.ends[piece.neighbour])]
                groups[groups == groups[other]] = groups[mine]
    return groups, vertices


def _help_nodes(attempt: _Attempt, failed_mitres: list[int], failed_seams: list[int]) -> None:
    for i in failed_mitres:
        attempt.nudges[i] += 1
        if attempt.nudges[i] > MOST_NUDGES:
            attempt.trouble["nodes"].add(i)
    for i in set(failed_seams) - set(failed_mitres):
        attempt.growth[i] *= GROWTH
        if attempt.growth[i] > MOST_GROWTH:
            attempt.trouble["nodes"].add(i)


def _choose_changes(attempt: _Attempt, may_detour: bool) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """Merges and detours for the members and nodes in trouble, the shortest member first, each node at most once."""
    truss = attempt.sized.truss
    sizes = _sizes(attempt, _directed(attempt))
    lengths = truss.lengths
    troubled = set(attempt.trouble["members"])
    for i in attempt.trouble["nodes"]:
        at_node = np.flatnonzero((truss.members == i).any(1))
        troubled.add(int(at_node[np.argmin(lengths[at_node])]))
    if not troubled:
        # Nothing settled within the tries: give way where most room is missing.
        lack = sizes.reach.reshape(-1, 2).sum(1) / lengths
        troubled.add(int(np.argmax(lack)))
    merges: list[tuple[int, int]] = []
    detours: list[tuple[int, int]] = []
    used: set[int] = set()
    for m in sorted(troubled, key=lambda m: (lengths[m], m)):
        change = _change_for(m, truss, sizes, may_detour)
        nodes = {int(i) for i in truss.members[m]} | set(change[1])
        if change[0] == "detour":
            nodes |= {int(i) for i in truss.members[change[1][0]]} | {change[1][1]}
            nodes.discard(change[1][0])
            nodes |= {int(i) for i in truss.members[m]}
        if nodes & used:
            continue
        used |= nodes
        (merges if change[0] == "merge" else detours).append(change[1])
    return merges, detours


def _change_for(m: int, truss: Truss, sizes: NodeSizes, may_detour: bool) -> tuple[str, tuple[int, int]]:
    a, b = (int(i) for i in truss.members[m])
    reach = sizes.reach.reshape(-1, 2)[m]
    side = int(np.argmax(reach))
    rival = int(sizes.rival[2 * m + side])
    short = SHORT * sizes.end_radius[2 * m + side]
    if not may_detour or rival < 0 or reach[side] < 0.4 * truss.lengths[m] or truss.lengths[m] < short:
        return "merge", (a, b)
    other = rival // 2
    near = int(truss.members[m, side])
    far, far_other = (int(pair[0] if pair[1] == near else pair[1]) for pair in truss.members[[m, other]])
    gap = np.linalg.norm(truss.nodes[far] - truss.nodes[far_other])
    if gap < CLOSE * min(truss.lengths[m], truss.lengths[other]):
        return "merge", (far, far_other)
    if truss.lengths[other] >= truss.lengths[m]:
        return "detour", (other, far)
    return "detour", (m, far_other)


def _describe(sized, attempt, placed, touched, merged_nodes, rerouted) -> PreparedTruss:
    truss, sizes = attempt.sized.truss, placed.sizes
    widest = np.zeros(len(truss.nodes))
    np.maximum.at(widest, truss.members.ravel(), sizes.end_radius)
    used = widest > 0
    mitred = np.isin(np.arange(len(truss.nodes)), list(placed.mitres))
    raised = used & ~mitred & (sizes.radius > 1.001 * attempt.knobs.node_ratio * widest)
    wanted = attempt.knobs.fillet_ratio * sizes.end_radius
    smaller = np.zeros(len(truss.nodes), bool)
    smaller[truss.members.ravel()[sizes.fillet < 0.999 * wanted]] = True
    smaller |= used & (sizes.radius < 0.999 * attempt.knobs.node_ratio * widest)
    fallback = {"mitred": int((mitred & ~touched).sum()), "merged": int((touched & used).sum())}
    removed = len(sized.truss.members) - len(truss.members)
    messages = _messages(sizes, attempt, fallback, merged_nodes, rerouted, removed)
    return PreparedTruss(
        sized=attempt.sized,
        centerlines=placed.lines,
        sizes=sizes,
        tubes=placed.tubes,
        mitres=placed.mitres,
        seams=placed.seams,
        fallback_nodes={kind: n for kind, n in fallback.items() if n},
        raised_nodes=int(raised.sum()),
        reduced_nodes=int((smaller & ~mitred).sum()),
        merged_members=removed,
        messages=messages,
    )


def _messages(sizes, attempt, fallback, merged_nodes, rerouted, removed) -> tuple[str, ...]:
    lines = []
    if fallback["mitred"]:
        lines.append(
            f"{fallback['mitred']} nodes have members at angles too acute for side-by-side fillets: "
            f"{int(sizes.mitred.sum())} ends are mitred there, without fillet"
        )
    if merged_nodes:
        lines.append(f"{merged_nodes} nodes were merged with a neighbour, since the members between them are too short")
    if rerouted:
        lines.append(f"{rerouted} members were led through a node beside them, since they run near-parallel to another")
    if removed:
        lines.append(f"the solid has {removed} members fewer than the truss")
    if attempt.straight.any():
        lines.append(f"{int(attempt.straight.sum())} members are straight, since their radius is too large for their bend or their angles")
    return tuple(lines)


def _explain_failure(sized: SizedTruss, knobs: Knobs) -> str:
    """Name the tightest curves, and a radius at which they would have room."""
    attempt = _start(sized, knobs)
    sizes = _sizes(attempt, attempt.lines)
    lack = sizes.reach.reshape(-1, 2).sum(1) / sized.truss.lengths
    worst = np.argsort(-lack, kind="stable")[:3]
    names = {sized.truss.curves[sized.truss.curve_of_member[m]].name for m in worst}
    radius = float(sized.radii.max())
    finite = lack[np.isfinite(lack)]
    better = radius / max(float(finite.max()) if len(finite) else 2.0, 1.2)
    return (
        f"the members are too thick for their lengths and angles: no solid could be laid out at radii up to {radius:.4g} mm; "
        f"the tightest are on {', '.join(sorted(names))}. Use a radius of at most {better:.3g} mm, or fewer curves"
    )
