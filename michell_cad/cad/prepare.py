"""Prepare a sized truss for its shell: lay out nodes and members, and change what cannot be built.

What has no place in its `layout` is in trouble. Then the truss itself is changed (`simplify_truss`):

* two near-parallel members that part farther out than the shorter one is long: the longer one is led through the far
  node of the shorter one, or the two far nodes are merged if they are close;
* otherwise the two nodes of a member without room are merged;
* of two members that cross, one is led through the near end of the other, or both get a common node.

What the change did not touch keeps its layout.
"""

from collections.abc import Callable, Sequence

import numpy as np

from michell_cad.cad.carry import carry_over
from michell_cad.cad.centerlines import SMOOTHINGS
from michell_cad.cad.clearance import crossing_spheres, resolve_crossings
from michell_cad.cad.layout import Layout, lower_levels, settle, shake, start_layout
from michell_cad.cad.mitres import NodeMitre
from michell_cad.cad.nodes import NodeSizes
from michell_cad.cad.placement import place
from michell_cad.cad.prepared import Changes, PreparedTruss
from michell_cad.cad.simplify import simplify_truss
from michell_cad.errors import GeometryKernelError
from michell_cad.knobs import Knobs
from michell_cad.truss import SizedTruss, Truss

MAX_ROUNDS = 200
"""Rounds of changes to the truss; each round removes members or shortens them, so there is an end."""

CROSSING_ROUNDS = 10
"""So often members that cross are led aside; then they stay as they are, since this could go on in a circle."""

SHORT = 2.5
"""A member shorter than this has its nodes merged, not its rivals rerouted (relative to the radius of its ends)."""

WIDE = 0.75
"""Members are rerouted only if their far ends are nearer than this (relative to the longer one; at 44 degrees)."""

CLOSE = 0.35
"""Far ends of near-parallel members are merged if nearer than this (relative to the shorter member)."""

STUBBORN, STUBBORN_COSINE = 4, 0.7
"""At a node that came out faulty so often, the two members nearest to each other, if they enclose less than 45 degrees,
are made one."""


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
    previous, shaken : to go on from an earlier result in which these nodes came out invalid, see `shake`.

    Raises
    ------
    GeometryKernelError
        If no change makes the truss buildable; names curves and a radius that works.
    """
    if previous is None:
        layout = start_layout(sized, knobs)
        changes = Changes(np.zeros(len(sized.truss.nodes), bool), 0, 0, 0, len(sized.truss.members))
    else:
        layout = carry_over(previous.layout, previous.sized, np.arange(len(previous.sized.truss.nodes)))
        changes = previous.changes
    times = np.array(layout.shakes)
    times[list(shaken)] += 1
    shake(layout, times)
    stubborn = [node for node in shaken if times[node] >= STUBBORN]
    merges, detours = _compatible(_join_nearest(layout.sized.truss, stubborn), layout.sized.truss)
    if merges or detours:
        layout, changes = _change(layout, changes, merges, detours, [])
    crossing_rounds = 0
    for round_number in range(MAX_ROUNDS):
        prepared, trouble = _lay_out(layout, changes)
        if prepared is not None:
            merges = []
            crossing_rounds += 1
            detours, joints = resolve_crossings(prepared) if crossing_rounds <= CROSSING_ROUNDS else ([], [])
            if not (detours or joints):
                return prepared
        else:
            merges, detours = _choose_changes(layout, trouble)
            joints = []
        layout, changes = _change(layout, changes, merges, detours, joints)
        if progress is not None:
            progress((round_number + 1) / MAX_ROUNDS)
    raise GeometryKernelError(_explain_failure(sized, knobs))


def _change(layout: Layout, changes: Changes, merges: list, detours: list, joints: list) -> tuple[Layout, Changes]:
    """Change the truss, and lay out anew what is near."""
    simpler, number = simplify_truss(layout.sized, merges, detours, joints)
    if not len(simpler.truss.members):
        raise GeometryKernelError(_explain_failure(layout.sized, layout.knobs))
    changes = changes.after(merges, detours, len(joints), number, len(simpler.truss.nodes))
    return carry_over(layout, simpler, number[: len(layout.level)]), changes


def _lay_out(layout: Layout, changes: Changes) -> tuple[PreparedTruss | None, set[int]]:
    """The prepared truss, or None and the members in trouble."""
    while True:
        members, nodes = place(layout)
        if members or nodes:
            lengths = layout.sized.truss.lengths
            shortest = {min((layout.ends_of(i) // 2).tolist(), key=lambda m: (lengths[m], m)) for i in nodes}
            return None, members | shortest
        prepared = _describe(layout, changes)
        if not lower_levels(layout, crossing_spheres(prepared)[0]):
            return prepared, set()


def _choose_changes(layout: Layout, trouble: set[int]) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """Merges and detours for members in trouble, the shortest member first."""
    truss, sizes = layout.sized.truss, layout.node_sizes()
    ordered = sorted(trouble, key=lambda m: (truss.lengths[m], m))
    return _compatible([(m, *_change_for(m, truss, sizes)) for m in ordered], truss)


def _compatible(
    wanted: Sequence[tuple[int, str, tuple[int, int]]], truss: Truss
) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """Merges and detours, of those wanted (member, kind, change) the first that can be made at once.

    No node is in two merges or in a merge and a detour, and no member takes part in two detours.
    """
    merges: list[tuple[int, int]] = []
    detours: list[tuple[int, int]] = []
    merged: set[int] = set()
    led: set[int] = set()
    rerouted: set[int] = set()
    for m, kind, change in wanted:
        if kind == "merge" and not set(change) & (merged | led):
            merged |= set(change)
            merges.append(change)
        elif kind == "detour":
            nodes = {change[1], *truss.members[change[0]].tolist()}
            if not nodes & merged and not {m, change[0]} & rerouted:
                led |= nodes
                rerouted |= {m, change[0]}
                detours.append(change)
    return merges, detours


def _change_for(m: int, truss: Truss, sizes: NodeSizes) -> tuple[str, tuple[int, int]]:
    """The change for a member without room: a merge of two nodes, or a detour of a member through a node."""
    reach, rival = sizes.reach.reshape(-1, 2)[m], sizes.rival.reshape(-1, 2)[m]
    short = SHORT * sizes.end_radius[2 * m : 2 * m + 2].max()
    if (rival < 0).all() or truss.lengths[m] < short:
        return "merge", (int(truss.members[m, 0]), int(truss.members[m, 1]))
    side = int(np.argmax(np.where(rival >= 0, reach, -np.inf)))
    other = int(rival[side]) // 2
    return _join(m, other, int(truss.members[m, side]), truss)


def _join_nearest(truss: Truss, nodes: Sequence[int]) -> list[tuple[int, str, tuple[int, int]]]:
    """At each of the nodes, the change that makes one of the two members nearest to each other, if they are acute."""
    wanted = []
    for node in nodes:
        members, side = np.nonzero(truss.members == node)
        away = truss.nodes[truss.members[members, 1 - side]] - truss.nodes[node]
        away /= np.linalg.norm(away, axis=1, keepdims=True)
        cosine = np.triu(away @ away.T, 1)
        i, j = np.unravel_index(int(np.argmax(cosine)), cosine.shape)
        if cosine[i, j] > STUBBORN_COSINE:
            m = int(members[i])
            wanted.append((m, *_join(m, int(members[j]), node, truss)))
    return wanted


def _join(m: int, other: int, near: int, truss: Truss) -> tuple[str, tuple[int, int]]:
    """The change that makes one of two members at a node."""
    far, far_other = (int(pair[0] if pair[1] == near else pair[1]) for pair in truss.members[[m, other]])
    gap = np.linalg.norm(truss.nodes[far] - truss.nodes[far_other])
    if gap < CLOSE * min(truss.lengths[m], truss.lengths[other]):
        return "merge", (far, far_other)
    if gap > WIDE * max(truss.lengths[m], truss.lengths[other]):
        return "merge", (int(truss.members[m, 0]), int(truss.members[m, 1]))
    # The gap replaces the longer member: the members become shorter in all, so that there is an end.
    return "detour", (other, far) if truss.lengths[other] >= truss.lengths[m] else (m, far_other)


def _describe(layout: Layout, changes: Changes) -> PreparedTruss:
    truss, knobs, sizes = layout.sized.truss, layout.knobs, layout.node_sizes()
    node = layout.node
    widest = np.zeros(len(truss.nodes))
    np.maximum.at(widest, node, sizes.end_radius)
    used = widest > 0
    creased, sharp = np.zeros(len(truss.nodes), bool), np.zeros(len(truss.nodes), bool)
    creased[node[sizes.creased]] = True
    sharp[node[sizes.creased & (sizes.fillet <= 0)]] = True
    smaller = used & (sizes.radius < 0.999 * knobs.node_ratio * widest)
    smaller[node[sizes.fillet < 0.999 * knobs.fillet_ratio * sizes.end_radius]] = True
    counts = {"mitred": sharp & ~changes.touched, "merged": changes.touched & used}
    mitres = {}
    for i in sorted(layout.mitres):
        ends = layout.ends_of(i)
        mitres[i] = NodeMitre(ends[sizes.creased[ends]], layout.mitres[i])
    straight = layout.smoothed == len(SMOOTHINGS)
    turned = (layout.lift > 0) & ~np.repeat(straight, 2)
    return PreparedTruss(
        sized=layout.sized,
        design=layout.design,
        centerlines=layout.centerlines(),
        sizes=sizes,
        tubes=layout.all_tubes(),
        mitres=mitres,
        seams=layout.all_seams(),
        changes=changes,
        layout=layout,
        fallback_nodes={kind: int(mask.sum()) for kind, mask in counts.items() if mask.any()},
        creased_nodes=int((creased & ~sharp).sum()),
        raised_nodes=int((used & (sizes.radius > 1.001 * knobs.node_ratio * widest)).sum()),
        reduced_nodes=int(smaller.sum()),
        turned_ends=int(turned.sum()),
        straightened_members=int(straight.sum()),
        messages=_messages(layout, changes, int(sharp.sum()), int(turned.sum())),
    )


def _messages(layout: Layout, changes: Changes, sharp: int, turned: int) -> tuple[str, ...]:
    lines = []
    if sharp:
        lines.append(f"nodes whose members at acute angles meet in sharp edges, since no fillets are wanted: {sharp}")
    if changes.merged_nodes:
        lines.append(f"nodes merged with another, since the members between them are too short: {changes.merged_nodes}")
    if changes.rerouted_members:
        lines.append(
            f"members led through a node beside them, since they overlap another member: {changes.rerouted_members}"
        )
    if changes.joints:
        lines.append(f"nodes added where members cross: {changes.joints}")
    removed = changes.original_members - len(layout.sized.truss.members)
    if removed:
        lines.append(f"members {'fewer' if removed > 0 else 'more'} in the solid than in the truss: {abs(removed)}")
    smoothed, straight = layout.smoothed > 0, layout.smoothed == len(SMOOTHINGS)
    if (smoothed & ~straight).any():
        lines.append(
            "members on a smoother curve than their own, which bends too sharply for their radius: "
            f"{int((smoothed & ~straight).sum())}"
        )
    if straight.any():
        lines.append(f"members made straight, since their radius is too large for their bend: {int(straight.sum())}")
    return tuple(lines)


def _explain_failure(sized: SizedTruss, knobs: Knobs) -> str:
    """Name the tightest curves, and a radius at which they would have room."""
    layout = start_layout(sized, knobs)
    settle(layout)
    lack = layout.sizes["reach"].reshape(-1, 2).sum(1) / sized.truss.lengths
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
