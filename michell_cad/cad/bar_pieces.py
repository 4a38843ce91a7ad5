"""The pieces of bars: tubes of members along their curves, cores that join them, and how they follow each other.

A core runs through a node from circle to circle, straight on, or bent where the curve bends. All pieces are turned
about their own axes so that their seams line up along the bar. Around a closed curve an angle is left over (the
holonomy of rotation-minimising frames): a closed bar has a short cylinder, a stub, before its last core, whose seam
lies elsewhere.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from michell_cad.arrays import freeze
from michell_cad.cad.centerlines import SAMPLES, Centerlines
from michell_cad.cad.prepared import PreparedTruss
from michell_cad.cad.shell_tables import TURN
from michell_cad.cad.tubes import AROUND, Tubes, fit_tubes, pinched_tubes

CORNER = 0.6
"""How far the control points of a core lie on the way from its circles to the node (relative): 2/3 where it is straight
would keep the speed even, 0.55 at a right angle gives a quarter circle."""

STUB = 0.5
"""Length of the straight piece at which a closed bar is joined to itself (relative to the core it is cut from)."""

SAME_ANGLE = 1e-6
"""Seams nearer than this meet (radians): the tolerance of edges relative to their radius."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """Pieces of bars, each from a first circle to a last one.

    Parameters
    ----------
    centers, tangents, normals : (n, 2, 3) float: centres of both circles, mm; the direction along the bar; and the unit
        vector to angle 0, about which angles count along the bar.
    radii : (n, 2) float, mm.
    straight : (n,) bool, cylinders.
    poles : the others' surfaces, (9, k, 3) float each.
    """

    centers: Float[np.ndarray, "n 2 3"]
    tangents: Float[np.ndarray, "n 2 3"]
    normals: Float[np.ndarray, "n 2 3"]
    radii: Float[np.ndarray, "n 2"]
    straight: Bool[np.ndarray, " n"]
    poles: tuple[np.ndarray, ...]

    def __post_init__(self) -> None:
        freeze(self, centers=np.float64, tangents=np.float64, normals=np.float64, radii=np.float64, straight=bool)


@dataclass(frozen=True, eq=False)
class Chains:
    """Which pieces follow each other: those of bar b are ``pieces[offsets[b] : offsets[b + 1]]``.

    `curve` and `closed` have an entry for each bar.
    """

    pieces: Int[np.ndarray, " q"]
    offsets: Int[np.ndarray, " b1"]
    curve: Int[np.ndarray, " b"]
    closed: Bool[np.ndarray, " b"]

    def __post_init__(self) -> None:
        freeze(self, pieces=np.int64, offsets=np.int64, curve=np.int64, closed=bool)


def lay_pieces(prepared: PreparedTruss) -> tuple[Pieces, Chains, Float[np.ndarray, " q"]]:
    """The pieces of all bars, turned; their chains; and for each place in a chain the angle from the seam before.

    That angle is 0 but before the stubs of closed bars; for the first pieces of open bars it means nothing.
    """
    joints = _find_joints(prepared)
    cores, sharp = _fit_cores(prepared, joints)
    pieces = _join_pieces(_member_pieces(prepared, joints.forward), cores, _stubs(prepared, joints, cores))
    chains = _chain_pieces(prepared, joints, sharp)
    pieces, gap = _align_seams(pieces, chains)
    return pieces, chains, gap


@dataclass(frozen=True, eq=False)
class _Joints:
    """Joints of consecutive members along curves, by the ends that meet there; `number[c][i]` follows step i."""

    before: np.ndarray
    after: np.ndarray
    closing: np.ndarray
    number: tuple[np.ndarray, ...]
    forward: np.ndarray


def _find_joints(p: PreparedTruss) -> _Joints:
    truss = p.sized.truss
    owner = truss.curve_of_member
    forward = np.ones(len(truss.members), bool)
    none = np.zeros(0, int)
    before, after, closing, number, count = [none], [none], [none], [], 0
    for c, curve in enumerate(truss.curves):
        mine = owner[curve.members] == c
        along = truss.members[curve.members, 0] == curve.nodes[: len(curve.members)]
        forward[curve.members[mine]] = along[mine]
        following = np.roll(np.arange(len(mine)), -1)
        joined = mine & mine[following] & (curve.closed | (following > 0))
        number.append(np.where(joined, count + np.cumsum(joined) - 1, -1))
        count += int(joined.sum())
        at = np.flatnonzero(joined)
        before.append(2 * curve.members[at] + along[at])
        after.append(2 * curve.members[following[at]] + ~along[following[at]])
        closing.append(curve.closed & (at == len(mine) - 1))
    return _Joints(np.concatenate(before), np.concatenate(after), np.concatenate(closing) > 0, tuple(number), forward)


def _member_pieces(p: PreparedTruss, forward: np.ndarray) -> Pieces:
    """The tubes of the members, all along their curves."""
    ends = 2 * np.arange(len(forward))[:, None] + np.where(forward[:, None], [0, 1], [1, 0])
    d = p.directions[ends]
    centers = p.sized.truss.nodes[p.node_of_end[ends]] + p.sizes.reach[ends][..., None] * d
    # Run the other way, a tube is counted the other way around.
    poles = tuple(one if f else one[::-1, ::-1] for one, f in zip(p.tubes.poles, forward.tolist(), strict=True))
    tangents = d * np.array([1.0, -1.0])[:, None]
    return Pieces(centers, tangents, p.normals[ends], p.sizes.end_radius[ends], p.tubes.straight, poles)


def _fit_cores(p: PreparedTruss, joints: _Joints) -> tuple[Pieces, np.ndarray]:
    """Tubes through the nodes, and whether the turn is too sharp for them."""
    ends = np.stack([joints.before, joints.after], axis=1)
    X, d, reach = p.sized.truss.nodes[p.node_of_end[ends]], p.directions[ends], np.array(p.sizes.reach[ends])
    reach[joints.closing, 0] *= STUB
    t = np.linspace(0, 1, SAMPLES)[:, None]
    outer, inner = X + reach[..., None] * d, X + (1 - CORNER) * reach[..., None] * d
    points = (
        (1 - t) ** 3 * outer[:, :1]
        + 3 * t * (1 - t) ** 2 * inner[:, :1]
        + 3 * t**2 * (1 - t) * inner[:, 1:]
        + t**3 * outer[:, 1:]
    )
    tangents = -d * np.array([1.0, -1.0])[:, None]
    directions = -d
    r = p.sizes.end_radius[ends]
    n = len(ends)
    tubes = fit_tubes(
        Centerlines(points, directions),
        outer,
        np.zeros((n, 2)),
        np.stack([r[:, 0], r.mean(1), r[:, 1]], axis=1),
        np.zeros(n),
        np.zeros(n, bool),
    )
    return Pieces(outer, tangents, tubes.end_normals, r, tubes.straight, tuple(tubes.poles)), _too_sharp(tubes)


def _too_sharp(tubes: Tubes) -> np.ndarray:
    return pinched_tubes(tubes) if len(tubes.sections) else np.zeros(0, bool)


def _stubs(p: PreparedTruss, joints: _Joints, cores: Pieces) -> Pieces:
    """Short cylinders before the cores at which closed curves are closed."""
    at = np.flatnonzero(joints.closing)
    e = joints.before[at]
    d = p.directions[e]
    first = p.sized.truss.nodes[p.node_of_end[e]] + p.sizes.reach[e][:, None] * d
    r = p.sizes.end_radius[e]
    normals = cores.normals[at, :1]
    return Pieces(
        np.stack([first, cores.centers[at, 0]], axis=1),
        np.stack([-d, -d], axis=1),
        np.concatenate([normals, normals], axis=1),
        np.stack([r, r], axis=1),
        np.ones(len(at), bool),
        (np.zeros((0, 0, 3)),) * len(at),
    )


def _join_pieces(*parts: Pieces) -> Pieces:
    names = ("centers", "tangents", "normals", "radii", "straight")
    columns = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    return Pieces(**columns, poles=sum((part.poles for part in parts), ()))


def _chain_pieces(p: PreparedTruss, joints: _Joints, sharp: np.ndarray) -> Chains:
    truss = p.sized.truss
    owner, n_m, n_j = truss.curve_of_member, len(truss.members), len(sharp)
    stub = n_m + n_j + np.cumsum(joints.closing) - 1
    pieces, lengths, curve_of_bar, closed = [], [], [], []
    for c, curve in enumerate(truss.curves):
        number = joints.number[c]
        whole = (number >= 0) & ~sharp[number] if n_j else number >= 0
        steps = np.arange(len(whole))
        loop = bool(whole.all())
        if curve.closed and not loop:
            # Start behind a break.
            steps = np.roll(steps, -1 - int(np.flatnonzero(~whole)[-1]))
        bar: list[int] = []
        for i in steps.tolist():
            m = int(curve.members[i])
            if owner[m] != c:
                continue
            bar.append(m)
            if whole[i]:
                j = int(number[i])
                bar += [int(stub[j])] * bool(joints.closing[j]) + [n_m + j]
                if not (loop and i == steps[-1]):
                    continue
            pieces += bar
            lengths.append(len(bar))
            curve_of_bar.append(c)
            closed.append(loop)
            bar = []
    return Chains(np.array(pieces), np.cumsum([0, *lengths]), np.array(curve_of_bar), np.array(closed))


def _align_seams(pieces: Pieces, chains: Chains) -> tuple[Pieces, np.ndarray]:
    """Pieces turned so that their seams line up, and the angles between them, see `lay_pieces`."""
    q = chains.pieces
    first = chains.offsets[:-1]
    before = np.arange(len(q)) - 1
    last = chains.offsets[1:] - 1
    before[first] = last
    T, old, new = pieces.tangents[q, 0], pieces.normals[q[before], 1], pieces.normals[q, 0]
    step = np.arctan2((np.cross(old, new) * T).sum(1), (old * new).sum(1))
    turned = -np.cumsum(step)
    turned -= np.repeat(turned[first], np.diff(chains.offsets))
    # The last two pieces of a closed bar, its stub and its core, fit the first piece.
    loop = np.flatnonzero(chains.closed)
    turned[last[loop]] = turned[last[loop] - 1] = step[first[loop]]
    gap = np.mod(step + turned - turned[before], TURN)
    gap[np.minimum(gap, TURN - gap) < SAME_ANGLE] = 0.0
    angle = np.zeros(len(pieces.straight))
    angle[q] = turned
    return _turn(pieces, angle), gap


def _turn(pieces: Pieces, angle: np.ndarray) -> Pieces:
    """Pieces turned about their own axes: poles are an affine function of the two normals of a tube."""
    cosine, sine = np.cos(angle), np.sin(angle)
    side = np.cross(pieces.tangents, pieces.normals)
    normals = cosine[:, None, None] * pieces.normals + sine[:, None, None] * side
    poles = []
    for one, c, s in zip(pieces.poles, cosine.tolist(), sine.tolist(), strict=True):
        if len(one):
            center = (one[0] + one[4]) / 2
            U, V = one[0] - center, one[2] - center
            one = center + AROUND[:, 0, None, None] * (c * U + s * V) + AROUND[:, 1, None, None] * (c * V - s * U)
        poles.append(one)
    return Pieces(pieces.centers, pieces.tangents, normals, pieces.radii, pieces.straight, tuple(poles))
