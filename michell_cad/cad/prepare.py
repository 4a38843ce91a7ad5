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

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from michell_cad.cad.centerlines import Centerlines, sample_splines, straight_centerlines
from michell_cad.cad.clearance import crossing_spheres, resolve_crossings
from michell_cad.cad.mitres import Mitre, NodeMitre, corner_angles, cut_mitre
from michell_cad.cad.nodes import NodeSizes, cap_angle, node_levels, size_nodes
from michell_cad.cad.prepared import Changes, PreparedTruss
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

SHAKE = 1.06
"""Spheres of nodes that the kernel finds faulty grow by this factor (relative)."""

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
    memo: dict[bytes, tuple[Mitre | None, Seam | None]]
    trouble: dict[str, set[int]] = field(default_factory=lambda: {"members": set(), "nodes": set()})


def prepare_truss(
    sized: SizedTruss,
    knobs: Knobs,
    progress: Callable[[float], None] | None = None,
    previous: PreparedTruss | None = None,
    shaken: Sequence[int] = (),
) -> PreparedTruss:
    """Place everything that the shell consists of, changing the truss where it cannot be built.

    Parameters
    ----------
    sized : the truss with its radii.
    knobs : node_ratio and fillet_ratio are used.
    progress : told the fraction of the work done.
    previous, shaken : to go on from an earlier result in which these nodes came out invalid: their spheres grow a bit.

    Raises
    ------
    GeometryKernelError
        If no change makes the truss buildable; names curves and a radius that works.
    """
    current = sized if previous is None else previous.sized
    n_n = len(current.truss.nodes)
    changes = Changes(np.zeros(n_n, bool), 0, 0, len(sized.truss.members)) if previous is None else previous.changes
    growth = np.ones(n_n) if previous is None else np.array(previous.growth)
    growth[list(shaken)] *= SHAKE
    memo: dict[bytes, tuple[Mitre | None, Seam | None]] = {}
    for round_number in range(MAX_ROUNDS):
        attempt = _start(current, knobs, growth, memo)
        prepared = _place(attempt, changes)
        if prepared is not None:
            merges, detours = resolve_crossings(prepared) if round_number < DETOUR_ROUNDS else ([], [])
            if not (merges or detours):
                return prepared
        else:
            merges, detours = _choose_changes(attempt, round_number < DETOUR_ROUNDS)
        current, number = simplify_truss(current, merges, detours)
        if not len(current.truss.members):
            break
        changes = changes.after(merges, detours, number, len(current.truss.nodes))
        old, growth = growth, np.ones(len(current.truss.nodes))
        growth[number[number >= 0]] = old[number >= 0]
        if progress is not None:
            progress((round_number + 1) / MAX_ROUNDS)
    raise GeometryKernelError(_explain_failure(sized, knobs))


def _start(sized: SizedTruss, knobs: Knobs, growth: np.ndarray, memo: dict) -> _Attempt:
    truss = sized.truss
    n_n, n_m = len(truss.nodes), len(truss.members)
    lines = sample_splines(fit_splines(truss))
    level, straight, nudges = np.zeros(n_n, int), np.zeros(n_m, bool), np.zeros(n_n, int)
    return _Attempt(sized, knobs, lines, level, straight, nudges, growth.copy(), memo)


def _place(attempt: _Attempt, changes: Changes) -> PreparedTruss | None:
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
        mitres, seams, failed_mitres, failed_seams = _place_nodes(attempt, lines, sizes, tubes)
        if not (failed_mitres or failed_seams or attempt.trouble["members"]):
            prepared = _describe(attempt, changes, lines, sizes, tubes, mitres, seams)
            if not _raise_levels(attempt, crossing_spheres(prepared)[0], last):
                return prepared
            continue
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
    """Make members without room, and their rivals, straight: tangents may be more acute than chords. Whether any is."""
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
    ends = np.flatnonzero(sizes.creased)
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
            u = corner_angles(k, d[ends], normals[e], float(sizes.radius[i] + sizes.fillet[e]), float(sizes.end_radius[e] + sizes.fillet[e]))
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


def _place_nodes(attempt: _Attempt, lines: Centerlines, sizes: NodeSizes, tubes: Tubes):
    """Mitres and seams of all nodes, and the nodes where there is none. Nodes that were seen before are looked up."""
    node = attempt.sized.truss.members.ravel()
    d = lines.directions.reshape(-1, 3)
    normals = tubes.frames[:, [0, -1], 0].reshape(-1, 3)
    a = cap_angle(sizes.radius[node], sizes.end_radius, sizes.fillet)
    fingerprint = np.column_stack([d, normals, sizes.end_radius, sizes.fillet, sizes.creased, sizes.radius[node]])
    order = np.argsort(node, kind="stable")
    nodes, starts = np.unique(node[order], return_index=True)
    mitres: dict[int, NodeMitre] = {}
    seams: dict[int, Seam] = {}
    failed_mitres, failed_seams = [], []
    for i, ends in zip(nodes.tolist(), np.split(order, starts[1:]), strict=True):
        key = fingerprint[ends].tobytes()
        if key not in attempt.memo:
            attempt.memo[key] = _place_node(d[ends], normals[ends], a[ends], ends, sizes, float(sizes.radius[i]))
        mitre, seam = attempt.memo[key]
        mitred = ends[sizes.creased[ends]]
        if len(mitred) and mitre is None:
            failed_mitres.append(i)
        elif seam is None:
            failed_seams.append(i)
        else:
            seams[i] = renumber_cuts(seam, ends)
            if mitre is not None:
                mitres[i] = NodeMitre(mitred, mitre)
    return mitres, seams, failed_mitres, failed_seams


def _place_node(d, normals, a, ends, sizes, R: float) -> tuple[Mitre | None, Seam | None]:
    mitred = np.flatnonzero(sizes.creased[ends])
    mitre = None
    groups, vertices = np.arange(len(ends)), [np.zeros(1)] * len(ends)
    if len(mitred):
        one = ends[mitred[0]]
        f = float(sizes.fillet[one])
        mitre = cut_mitre(d[mitred], normals[mitred], R + f, float(sizes.end_radius[one]) + f)
        if mitre is None:
            return None, None
        groups, vertices = _loops(len(ends), mitred, mitre)
    return mitre, place_seam(d, a, groups, normals, vertices)


def _loops(n: int, mitred: np.ndarray, mitre: Mitre) -> tuple[np.ndarray, list[np.ndarray]]:
    """Which of the n caps of a node overlap, directly or not, and the vertices on each circle."""
    groups, vertices = np.arange(n), [np.zeros(1)] * n
    for k, path in enumerate(mitre.pieces):
        vertices[mitred[k]] = np.array([piece.start for piece in path])
        for piece in path:
            if piece.neighbour >= 0:
                groups[groups == groups[mitred[piece.neighbour]]] = groups[mitred[k]]
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


def _describe(attempt: _Attempt, changes: Changes, lines, sizes, tubes, mitres, seams) -> PreparedTruss:
    truss, knobs = attempt.sized.truss, attempt.knobs
    widest = np.zeros(len(truss.nodes))
    np.maximum.at(widest, truss.members.ravel(), sizes.end_radius)
    used = widest > 0
    creased, sharp = np.zeros(len(truss.nodes), bool), np.zeros(len(truss.nodes), bool)
    creased[list(mitres)] = True
    sharp[truss.members.ravel()[sizes.fillet <= 0]] = True
    sharp &= creased
    smaller = used & (sizes.radius < 0.999 * knobs.node_ratio * widest)
    smaller[truss.members.ravel()[sizes.fillet < 0.999 * knobs.fillet_ratio * sizes.end_radius]] = True
    counts = {"mitred": sharp & ~changes.touched, "merged": changes.touched & used}
    fallback = {kind: int(mask.sum()) for kind, mask in counts.items() if mask.any()}
    return PreparedTruss(
        sized=attempt.sized,
        design=attempt.lines,
        centerlines=lines,
        sizes=sizes,
        tubes=tubes,
        mitres=mitres,
        seams=seams,
        changes=changes,
        growth=attempt.growth,
        fallback_nodes=fallback,
        creased_nodes=int((creased & ~sharp).sum()),
        raised_nodes=int((used & (sizes.radius > 1.001 * knobs.node_ratio * widest)).sum()),
        reduced_nodes=int((smaller & ~creased).sum()),
        straightened_members=int(attempt.straight.sum()),
        messages=_messages(attempt, changes, sizes, int(sharp.sum())),
    )


def _messages(attempt: _Attempt, changes: Changes, sizes: NodeSizes, mitred: int) -> tuple[str, ...]:
    lines = []
    if mitred:
        lines.append(
            f"{mitred} nodes have members at acute angles that meet in sharp edges, since no fillets are wanted"
        )
    if changes.merged_nodes:
        lines.append(f"{changes.merged_nodes} nodes were merged with another: the members between them are too short")
    if changes.rerouted_members:
        lines.append(
            f"{changes.rerouted_members} members were led through a node beside them, since they overlap another member"
        )
    removed = changes.original_members - len(attempt.sized.truss.members)
    if removed:
        lines.append(f"the solid has {removed} members fewer than the truss")
    if attempt.straight.any():
        lines.append(
            f"{int(attempt.straight.sum())} members are straight: their radius is too large for their bend or angles"
        )
    return tuple(lines)


def _explain_failure(sized: SizedTruss, knobs: Knobs) -> str:
    """Name the tightest curves, and a radius at which they would have room."""
    attempt = _start(sized, knobs, np.ones(len(sized.truss.nodes)), {})
    sizes = _sizes(attempt, attempt.lines)
    lack = sizes.reach.reshape(-1, 2).sum(1) / sized.truss.lengths
    worst = np.argsort(-lack, kind="stable")[:3]
    names = {sized.truss.curves[sized.truss.curve_of_member[m]].name for m in worst}
    radius = float(sized.radii.max())
    finite = lack[np.isfinite(lack)]
    better = radius / max(float(finite.max()) if len(finite) else 2.0, 1.2)
    return (
        "the members are too thick for their lengths and angles: "
        f"no solid could be laid out at radii up to {radius:.4g} mm; the tightest are "
        f"on {', '.join(sorted(names))}. Use a radius of at most {better:.3g} mm, or fewer curves"
    )
