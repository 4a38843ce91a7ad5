"""Members that touch without sharing a node: the kernel's check is blind to them, so they are looked for here.

Members are rows of balls, `BALLS_PER_RADIUS` per radius; two members cross where two of their balls overlap. The
nearest pair of balls overestimates the distance of the axes by less than 2 % at the distance where tubes touch.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import KDTree

from michell_cad.arrays import freeze
from michell_cad.cad.balls import Balls
from michell_cad.cad.prepared import PreparedTruss
from michell_cad.cad.simplify import Joint
from michell_cad.splines import MemberSplines
from michell_cad.truss import SizedTruss, Truss, member_radius
from michell_cad.truss.draft import RANKS

BALLS_PER_RADIUS = 2.0
MOST_BALLS = 400
"""Balls per member at most: members longer than 200 radii get coarser rows."""

TOUCHING = 0.98
"""Members whose axes are nearer than this share of the sum of their radii count as crossing (relative)."""

BESIDE = 1.25
"""An end of a member lies beside another member if nearer than this (relative to the sum of their radii)."""

JOINT_ROOM = 3.0
"""Crossing members get a common node only so far from their ends (relative to the larger radius)."""

AT_NODE = 1.3
"""Near a common node, members are compared only beyond this multiple of what the node takes of them (relative)."""


@dataclass(frozen=True, eq=False)
class Crossings:
    """Pairs of members that overlap away from a common node, the deepest first.

    Parameters
    ----------
    members : (k, 2) int.
    depth : (k,) float, mm, by how much they overlap.
    points : (k, 3) float, mm, where.
    """

    members: Int[np.ndarray, "k 2"]
    depth: Float[np.ndarray, " k"]
    points: Float[np.ndarray, "k 3"]

    def __post_init__(self) -> None:
        freeze(self, members=np.int64, depth=np.float64, points=np.float64)


def crossing_members(sized: SizedTruss, splines: MemberSplines) -> Crossings:
    """Members without a common node that overlap, on the design curves."""
    truss = sized.truss
    if not len(truss.members):
        return Crossings(np.zeros((0, 2), int), np.zeros(0), np.zeros((0, 3)))
    owner, s = _place_balls(splines.lengths, sized.radii.max(1))
    points = np.empty((len(owner), 3))
    counts = np.bincount(owner, minlength=len(truss.members))
    for n in np.unique(counts):
        rows = counts[owner] == n
        members = np.flatnonzero(counts == n)
        points[rows] = splines.some(members).positions(s[rows].reshape(-1, n)[0]).reshape(-1, 3)
    balls = Balls.of(owner, points, member_radius(sized.radii[owner], s))
    everywhere = np.full((len(truss.members), 2), np.inf)
    pair, depth = balls.overlaps(TOUCHING, truss.members, truss.nodes, everywhere)
    return _deepest(owner[pair], depth, points[pair].mean(1))


def crossing_tubes(prepared: PreparedTruss) -> Crossings:
    """Members that overlap as built: their tubes, also beyond a common node, or a tube and a sphere, or two spheres.

    A sphere stands for one of the members of its node.
    """
    truss = prepared.sized.truss
    balls = _tube_balls(prepared)
    room = AT_NODE * prepared.sizes.reach.reshape(-1, 2)
    pair, depth = balls.overlaps(TOUCHING, truss.members, truss.nodes, room)
    node, member, sphere_depth = crossing_spheres(prepared, balls)
    some_member = np.zeros(len(truss.nodes), int)
    some_member[truss.members.ravel()] = np.arange(truss.members.size) // 2
    return _deepest(
        np.concatenate([balls.owner[pair], np.stack([some_member[node], member], axis=1)]),
        np.concatenate([depth, sphere_depth]),
        np.concatenate([balls.points[pair].mean(1), truss.nodes[node]]),
    )


def crossing_spheres(
    prepared: PreparedTruss, balls: Balls | None = None
) -> tuple[Int[np.ndarray, " k"], Int[np.ndarray, " k"], Float[np.ndarray, " k"]]:
    """Nodes whose spheres overlap members of other nodes, or their spheres: (node, member, depth in mm).

    `balls` are those of the tubes, if they are known.
    """
    truss, R = prepared.sized.truss, prepared.sizes.radius
    used = np.unique(truss.members)
    balls = _tube_balls(prepared) if balls is None else balls
    tubes = balls.inside(TOUCHING, truss.members, used, truss.nodes, R)
    spheres = _crossing_spheres(truss, used, R)
    return tuple(np.concatenate(columns) for columns in zip(tubes, spheres, strict=True))  # pyright: ignore[reportReturnType]


def _crossing_spheres(truss: Truss, used: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes whose spheres overlap the sphere of a node that is no neighbour: each with the members of the other."""
    pair = used[KDTree(truss.nodes[used]).query_pairs(2 * TOUCHING * R[used].max(), output_type="ndarray")]
    depth = TOUCHING * R[pair].sum(1) - np.linalg.norm(truss.nodes[pair[:, 0]] - truss.nodes[pair[:, 1]], axis=1)
    n = len(truss.nodes)
    apart = ~np.isin(np.sort(pair, axis=1) @ [n, 1], truss.members @ [n, 1])
    pair, depth = pair[apart & (depth > 0)], depth[apart & (depth > 0)]
    row, end = np.nonzero(np.concatenate([pair[:, 1], pair[:, 0]])[:, None] == truss.members.ravel())
    return np.concatenate([pair[:, 0], pair[:, 1]])[row], end // 2, np.tile(depth, 2)[row]


def _tube_balls(prepared: PreparedTruss) -> Balls:
    """Balls along all tubes."""
    tubes = prepared.tubes
    fine = np.linspace(0, 1, max(33, 4 * int(tubes.sections.max()) + 1))
    spine = tubes.spine_points(fine)
    lengths = np.linalg.norm(np.diff(spine, axis=1), axis=2).sum(1)
    owner, t = _place_balls(lengths, tubes.radius_range[1])
    x = t * (len(fine) - 1)
    low = np.minimum(x.astype(int), len(fine) - 2)
    w = (x - low)[:, None]
    points = (1 - w) * spine[owner, low] + w * spine[owner, low + 1]
    return Balls.of(owner, points, member_radius(tubes.radii[owner], t))


def resolve_crossings(prepared: PreparedTruss) -> tuple[list[tuple[int, int]], list[Joint]]:
    """Detours and joints, as `simplify_truss` takes them, after which crossing members share a node.

    If an end of one of two crossing members lies within `BESIDE` of their radii of the other, or its sphere touches it,
    the other is led through it. Else both get a new node where they cross, on the curve that is bound to a feature or
    to the surface if one is, unless it would be nearer than `JOINT_ROOM` to one of their ends: such a pair stays as it
    is.
    """
    truss, crossings = prepared.sized.truss, crossing_tubes(prepared)
    radius = prepared.tubes.radius_range[1]
    detours: list[tuple[int, int]] = []
    joints: list[Joint] = []
    used: set[int] = set()
    for (a, b), point in zip(crossings.members.tolist(), crossings.points, strict=True):
        ends = {int(i) for m in (a, b) for i in truss.members[m]}
        if ends & used:
            continue
        beside = _end_beside(prepared, a, b, radius)
        if beside is not None:
            detours.append(beside)
            used |= ends
            continue
        ranks = [RANKS[truss.curves[truss.shape_of_member[m]].kind] for m in (a, b)]
        if ranks[0] != ranks[1]:
            spine = prepared.tubes.some(np.array([a if ranks[0] > ranks[1] else b])).spine_points(np.linspace(0, 1, 65))
            point = spine[0, np.linalg.norm(spine[0] - point, axis=1).argmin()]
        room = np.linalg.norm(truss.nodes[list(ends)] - point, axis=1).min()
        if room > JOINT_ROOM * max(radius[a], radius[b]):
            joints.append(Joint(tuple(point.tolist()), int(max(ranks)), (a, b)))
            used |= ends
    return detours, joints


def _end_beside(prepared: PreparedTruss, a: int, b: int, radius: np.ndarray) -> tuple[int, int] | None:
    """The member, of two, that runs nearest past an end of the other one, and this end; None if none is near."""
    members, nodes = prepared.sized.truss.members, prepared.sized.truss.nodes
    best = None
    for m, other in ((a, b), (b, a)):
        for i in set(members[m].tolist()) - set(members[other].tolist()):
            gap = float(np.linalg.norm(prepared.centerlines.points[other] - nodes[i], axis=1)[1:-1].min())
            near = max(BESIDE * (radius[a] + radius[b]), prepared.sizes.radius[i] + radius[other])
            if gap < near and (best is None or gap < best[0]):
                best = (gap, (other, i))
    return None if best is None else best[1]


def _place_balls(lengths: np.ndarray, radii: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Member and fraction of its length for every ball."""
    n = np.clip(np.ceil(BALLS_PER_RADIUS * lengths / radii), 2, MOST_BALLS).astype(int) + 1
    owner = np.repeat(np.arange(len(n)), n)
    local = np.arange(len(owner)) - np.repeat(np.cumsum(n) - n, n)
    return owner, local / (n[owner] - 1)


def _deepest(
    members: Int[np.ndarray, "k 2"], depth: Float[np.ndarray, " k"], points: Float[np.ndarray, "k 3"]
) -> Crossings:
    """One entry per pair of members, the deepest."""
    pairs = np.sort(members, axis=1)
    order = np.argsort(-depth, kind="stable")
    _, first = np.unique(pairs[order], axis=0, return_index=True)
    chosen = order[np.sort(first)]
    return Crossings(pairs[chosen], depth[chosen], points[chosen])
