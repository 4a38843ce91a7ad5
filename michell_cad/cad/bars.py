"""The truss as separate solids: one bar for each curve, and one body for each node.

A bar runs along its whole curve: the tubes of its members, joined inside the nodes by short cores that go on straight,
or bend where the curve does, and closed by plane discs where the curve ends. A node is its sphere with all fillets,
closed by discs where the tubes begin. So bars and nodes overlap inside the nodes, and united they are the one solid.

A member of two curves belongs to the bar of the curve that names it (`Truss.curve_of_member`). Where a curve lacks a
member for that reason, or turns so sharply at a node that no core can follow, it has more than one bar.

The circles between the pieces of a bar are shared edges, and every piece is a face with a seam. Turning each piece
about its own axis lines the seams up along the bar; around a closed curve an angle is left over (the holonomy of the
rotation-minimising frames), so that one circle is cut in two arcs there, at the seams of both sides.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

from michell_cad.arrays import freeze
from michell_cad.cad.centerlines import SAMPLES, Centerlines
from michell_cad.cad.fits import FITS
from michell_cad.cad.prepared import PreparedTruss
from michell_cad.cad.shell_plan import (
    Coedges,
    CurveForm,
    Edges,
    FaceRole,
    Faces,
    Frames,
    PcurveForm,
    ShellPlan,
    Strips,
    SurfaceForm,
)
from michell_cad.cad.shell_tables import KERNEL_TOLERANCE, TOLERANCE, TURN, Table
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

    centers: np.ndarray
    tangents: np.ndarray
    normals: np.ndarray
    radii: np.ndarray
    straight: np.ndarray
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
    closed: np.ndarray

    def __post_init__(self) -> None:
        freeze(self, pieces=np.int64, offsets=np.int64, curve=np.int64, closed=bool)


def plan_bars(prepared: PreparedTruss) -> tuple[ShellPlan, Int[np.ndarray, " n_b"]]:
    """The bars as a plan with one component each, and the curve of each bar."""
    joints = _find_joints(prepared)
    cores, sharp = _fit_cores(prepared, joints)
    pieces = _join_pieces(_member_pieces(prepared, joints.forward), cores, _stubs(prepared, joints, cores))
    chains = _chain_pieces(prepared, joints, sharp)
    pieces, gap = _align_seams(pieces, chains)
    return _plan(pieces, chains, gap), chains.curve


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
    """Pieces turned so that their seams line up, and for each place in the chains the angle from the seam before.

    That angle is 0 but before the stubs of closed bars; for the first pieces of open bars it means nothing.
    """
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


class _Tables:
    """The tables of the plan while they grow."""

    def __init__(self) -> None:
        self.points, self.frames = Table(x=3), Table(origin=3, axis=3, zero=3, radii=2)
        self.edges = Table(form=1, curve=1, ranges=2, ends=2)
        self.faces = Table(form=1, surface=1, reversed_=1, role=1, owner=1, component=1)
        self.coedges = Table(face=1, order=1, edge=1, reversed_=1, form=1, pcurve=1)
        self.lines = Table(origin=2, direction=2)

    def run(self, face, order, edge, reversed_, form, origin, direction) -> None:
        """Edges along faces; `origin` and `direction` serve those whose pcurves are lines."""
        n = len(face)
        line = self.lines.add(n, origin=origin, direction=direction)
        self.coedges.add(n, face=face, order=order, edge=edge, reversed_=reversed_, form=form, pcurve=line)


def _plan(pieces: Pieces, chains: Chains, gap: np.ndarray) -> ShellPlan:
    s, q = _Tables(), chains.pieces
    P, T, N, r = pieces.centers[q], pieces.tangents[q], pieces.normals[q], pieces.radii[q]
    first, last = chains.offsets[:-1], chains.offsets[1:] - 1
    bar = np.repeat(np.arange(len(chains.curve)), np.diff(chains.offsets))
    n = len(q)
    is_first = np.zeros(n, bool)
    is_first[first] = True
    split = np.flatnonzero((gap > 0) & ~is_first)
    # Circle k is where piece k of the chains begins; those at the ends of open bars follow.
    open_bars = np.flatnonzero(~chains.closed)
    stop = np.arange(n) + 1
    stop[last] = first
    stop[last[open_bars]] = n + np.arange(len(open_bars))
    ends = last[open_bars]
    zero = N[:, 0].copy()
    zero[split] = N[split - 1, 1]
    frame = [np.concatenate([a, b[ends]]) for a, b in ((P[:, 0], P[:, 1]), (T[:, 0], T[:, 1]), (zero, N[:, 1]))]
    radius = np.r_[r[:, 0], r[ends, 1]]
    circle = s.frames.add(
        len(radius), origin=frame[0], axis=frame[1], zero=frame[2], radii=np.stack([radius, radius], axis=1)
    )
    point = s.points.add(len(circle), x=frame[0] + radius[:, None] * frame[2])
    start_point = point[:n].copy()
    start_point[split] = s.points.add(len(split), x=P[split, 0] + r[split, :1] * N[split, 0])
    ranges = np.tile([0.0, TURN], (len(circle), 1))
    ranges[split, 0] = gap[split]
    goes = point.copy()
    goes[split] = start_point[split]
    edge = s.edges.add(
        len(circle), form=CurveForm.CONIC, curve=circle, ranges=ranges, ends=np.stack([goes, point], axis=1)
    )
    rest = s.edges.add(
        len(split),
        form=CurveForm.CONIC,
        curve=split,
        ranges=np.stack([np.zeros(len(split)), gap[split]], axis=1),
        ends=np.stack([point[split], start_point[split]], axis=1),
    )
    straight = pieces.straight[q]
    length = np.linalg.norm(P[:, 1] - P[:, 0], axis=1)
    number = np.cumsum(~straight) - 1
    face, seam = _add_faces(s, pieces, chains, bar, number, length, start_point, point[stop])
    around, along, zeros = np.where(straight, TURN, 1.0), np.where(straight, length, 1.0), np.zeros(n)
    start_form = np.where(straight, PcurveForm.LINE, PcurveForm.TUBE_START)
    top_form = np.where(straight, PcurveForm.LINE, PcurveForm.TUBE_TOP)
    s.run(face, 0, edge[:n], 0, start_form, np.stack([np.where(gap * ~is_first > 0, -gap, 0), zeros], axis=1), (1, 0))
    s.run(face[split], 1, rest, 0, PcurveForm.LINE, np.stack([TURN - gap[split], zeros[split]], axis=1), (1, 0))
    s.run(face, 10, seam, 0, PcurveForm.LINE, np.stack([around, zeros], axis=1), (0, 1))
    top = np.stack([zeros, along], axis=1)
    s.run(face, 20, edge[stop], 1, top_form, top, (1, 0))
    s.run(face[split - 1], 21, rest, 1, top_form[split - 1], top[split - 1], (1, 0))
    s.run(face, 30, seam, 1, PcurveForm.LINE, (0, 0), (0, 1))
    for circles, facing in ((first[open_bars], 1), (stop[ends], 0)):
        disc = s.faces.add(
            len(circles),
            form=SurfaceForm.PLANE,
            surface=circles,
            reversed_=facing,
            role=FaceRole.MEMBER,
            owner=0,
            component=open_bars,
        )
        s.run(disc, 0, edge[circles], 0, PcurveForm.PLANAR, (0, 0), (1, 0))
    return _finish(s, tuple(pieces.poles[k] for k in q[~straight].tolist()), float(r.max()), len(chains.curve))


def _add_faces(s: _Tables, pieces, chains, bar, number, length, start_point, stop_point):
    """One face and one seam for each piece."""
    q, n = chains.pieces, len(chains.pieces)
    straight = pieces.straight[q]
    P, T, N, r = pieces.centers[q, 0], pieces.tangents[q, 0], pieces.normals[q, 0], pieces.radii[q, :1]
    surface = s.frames.add(n, origin=P, axis=T, zero=N, radii=np.concatenate([r, r], axis=1))
    line = s.frames.add(n, origin=P + r * N, axis=T, zero=N, radii=(1, 1))
    face = s.faces.add(
        n,
        form=np.where(straight, SurfaceForm.CYLINDER, SurfaceForm.TUBE),
        surface=np.where(straight, surface, number),
        reversed_=0,
        role=FaceRole.MEMBER,
        owner=q,
        component=bar,
    )
    seam = s.edges.add(
        n,
        form=np.where(straight, CurveForm.LINE, CurveForm.TUBE_SEAM),
        curve=np.where(straight, line, number),
        ranges=np.stack([np.zeros(n), np.where(straight, length, 1.0)], axis=1),
        ends=np.stack([start_point, stop_point], axis=1),
    )
    return face, seam


def _finish(s: _Tables, poles: tuple[np.ndarray, ...], radius: float, components: int) -> ShellPlan:
    edges, faces, coedges, frames = s.edges, s.faces, s.coedges, s.frames
    tolerance = max(TOLERANCE * radius, KERNEL_TOLERANCE)
    order = np.lexsort((coedges["order"], coedges["face"]))
    face, edge, form, pcurve = (coedges.whole(name)[order] for name in ("face", "edge", "form", "pcurve"))
    whole = {name: faces.whole(name) for name in ("form", "surface", "role", "owner", "component")}
    return ShellPlan(
        points=s.points["x"],
        frames=Frames(frames["origin"], frames["axis"], frames["zero"], frames["radii"]),
        edges=Edges(
            edges.whole("form"),
            edges.whole("curve"),
            edges["ranges"],
            edges.whole("ends"),
            np.full(edges.size, tolerance),
        ),
        faces=Faces(reversed_=faces["reversed_"] > 0, **whole),
        coedges=Coedges(face, np.zeros(len(face), int), edge, coedges["reversed_"][order] > 0, form, pcurve),
        pcurve_lines=np.stack([s.lines["origin"], s.lines["direction"]], axis=1),
        pcurve_poles=tuple(np.zeros((0, len(fit.places), 2)) for fit in FITS),
        strips=Strips(np.zeros((0, 3, 1, 3)), np.zeros((0, 1)), np.zeros((0, 1)), 0),
        tube_poles=poles,
        tolerance=tolerance,
        components=components,
    )
