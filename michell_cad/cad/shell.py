"""Assemble the shell: every edge is made once and shared by its two faces, so that the shell is closed by construction.

Per node a sphere face; per filleted end a torus face; per mitred end a cylinder face from the mitre out to where it has
parted from its rivals; per member a tube face. Curves along the sphere are circles, cut at corners of mitres and where
the seam of the sphere meets them.
"""

import numpy as np

from michell_cad.cad.mitres import SPHERE, Piece
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
    SurfaceForm,
)
from michell_cad.cad.spheres import fit_longitudes, fit_sines

TOLERANCE = 1e-6
"""Tolerance of edges and vertices (relative to the largest radius): rational circles fail at a tenth of it."""

KERNEL_TOLERANCE = 1e-7
"""mm: the kernel takes nearer points for the same one."""

FIT_SAFETY = 2.0
"""Edges take this multiple of the largest deviation that was measured between their curves (relative)."""

TURN = 2 * np.pi


class _Table:
    """Rows of several columns, appended in blocks."""

    def __init__(self, **widths: int) -> None:
        self._blocks: dict[str, list[np.ndarray]] = {name: [] for name in widths}
        self._widths = widths
        self.size = 0

    def add(self, n: int, **columns: object) -> np.ndarray:
        """Append n rows; a scalar or a single row is repeated. Returns their numbers."""
        for name, width in self._widths.items():
            shape = (n,) if width == 1 else (n, width)
            self._blocks[name].append(np.broadcast_to(np.asarray(columns[name], float), shape))
        self.size += n
        return np.arange(self.size - n, self.size)

    def __getitem__(self, name: str) -> np.ndarray:
        width = self._widths[name]
        return np.concatenate([np.zeros((0,) if width == 1 else (0, width)), *self._blocks[name]])

    def whole(self, name: str) -> np.ndarray:
        """A column of whole numbers."""
        return self[name].astype(np.int64)


class _Shell:
    """The tables while they grow."""

    def __init__(self, prepared: PreparedTruss) -> None:
        self.p = prepared
        truss, sizes = prepared.sized.truss, prepared.sizes
        self.node = prepared.node_of_end
        self.d, self.N = prepared.directions, prepared.normals
        self.B = np.cross(self.d, self.N)
        self.X = truss.nodes[self.node]
        self.r, self.f, self.reach, self.mitred = sizes.end_radius, sizes.fillet, sizes.reach, sizes.mitred
        self.R, self.a = sizes.radius[self.node], prepared.caps
        self.n_e, self.n_m = len(self.node), len(truss.members)
        self.tolerance = max(TOLERANCE * float(self.r.max()), KERNEL_TOLERANCE)
        self.points = _Table(x=3)
        self.frames = _Table(origin=3, axis=3, zero=3, radii=2)
        self.edges = _Table(form=1, curve=1, ranges=2, ends=2, tolerance=1)
        self.faces = _Table(form=1, surface=1, reversed_=1, role=1, owner=1, node=1)
        self.coedges = _Table(face=1, wire=1, order=1, edge=1, reversed_=1, form=1, pcurve=1)
        self.lines = _Table(origin=2, direction=2)
        self.poles: list[np.ndarray] = []
        self.n_poles = 0
        # A plain end has one circle for tube and sphere.
        self.plain = (self.f == 0) & ~self.mitred
        self.tube_edge = np.full(self.n_e, -1)
        self.corners: dict[int, np.ndarray] = {}
        self.widened: tuple[np.ndarray, np.ndarray] = (np.zeros(0, int), np.zeros(0))

    def add_edges(self, form, curve, ranges, ends) -> np.ndarray:
        return self.edges.add(len(ends), form=form, curve=curve, ranges=ranges, ends=ends, tolerance=self.tolerance)

    def run_along(self, face, wire, order, edge, reversed_, form, pcurve) -> None:
        n = len(np.atleast_1d(edge))
        self.coedges.add(n, face=face, wire=wire, order=order, edge=edge, reversed_=reversed_, form=form, pcurve=pcurve)

    def run_line(self, face, order, edge, reversed_, origin, direction) -> None:
        """Coedges in wire 0 whose pcurves are lines."""
        n = len(np.atleast_1d(edge))
        lines = self.lines.add(n, origin=origin, direction=direction)
        self.run_along(face, 0, order, edge, reversed_, PcurveForm.LINE, lines)

    def add_poles(self, poles: np.ndarray) -> np.ndarray:
        self.poles.append(poles)
        self.n_poles += len(poles)
        return np.arange(self.n_poles - len(poles), self.n_poles)


def assemble_shell(prepared: PreparedTruss) -> ShellPlan:
    """Lay out points, edges and faces of all solids of a prepared truss."""
    shell = _Shell(prepared)
    _lay_circles(shell)
    arcs = _lay_arcs(shell)
    _lay_fillets(shell, arcs)
    _lay_mitres(shell, arcs)
    _lay_tubes(shell, arcs)
    _lay_spheres(shell, arcs)
    return _finish(shell)


class _Arcs:
    """Arcs of the circles on the spheres, per end in ascending order of angle, after all cuts."""

    def __init__(self, end, ranges, ends, edge, cuts) -> None:
        self.end, self.ranges, self.ends, self.edge = end, ranges, ends, edge
        self.cuts = cuts
        self.order = np.lexsort((ranges[:, 0], end))
        self.bounds = np.searchsorted(end[self.order], np.arange(int(end.max()) + 2))

    def of_end(self, e: int) -> np.ndarray:
        return self.order[self.bounds[e] : self.bounds[e + 1]]


def _lay_circles(s: _Shell) -> None:
    """Circles of the tubes (frames 0 .. n_e - 1, points likewise), circles on the spheres (the next n_e)."""
    center = s.X + s.reach[:, None] * s.d
    s.points.add(s.n_e, x=center + s.r[:, None] * s.N)
    s.frames.add(s.n_e, origin=center, axis=s.d, zero=s.N, radii=np.stack([s.r, s.r], axis=1))
    rho = s.R * np.sin(s.a)
    s.frames.add(
        s.n_e,
        origin=s.X + (s.R * np.cos(s.a))[:, None] * s.d,
        axis=s.d,
        zero=s.N,
        radii=np.stack([rho, rho], axis=1),
    )
    own = np.flatnonzero(~s.plain)
    s.tube_edge[own] = s.add_edges(CurveForm.CONIC, own, (0, TURN), np.stack([own, own], axis=1))


def _lay_arcs(s: _Shell) -> _Arcs:
    """Edges on the spheres: whole circles, or arcs between corners of mitres, cut where a seam meets them."""
    filleted = np.flatnonzero(~s.plain & ~s.mitred)
    whole = np.flatnonzero(~s.mitred)
    vertex = np.arange(s.n_e)
    rho, h = s.R * np.sin(s.a), s.R * np.cos(s.a)
    on_sphere = s.X + h[:, None] * s.d + rho[:, None] * s.N
    vertex[filleted] = s.points.add(len(filleted), x=on_sphere[filleted])
    end, ranges = [whole], [np.tile([0.0, TURN], (len(whole), 1))]
    ends = [np.stack([vertex[whole], vertex[whole]], axis=1)]
    for i, node in s.p.mitres.items():
        X = s.p.sized.truss.nodes[i]
        s.corners[i] = s.points.add(len(node.mitre.corners), x=X + node.mitre.corners)
        pieces = [piece for path in node.mitre.pieces for piece in path if piece.neighbour < 0]
        if pieces:
            end.append(node.ends[[piece.end for piece in pieces]])
            ranges.append(np.array([(piece.start, piece.stop) for piece in pieces]))
            ends.append(s.corners[i][[(piece.first, piece.last) for piece in pieces]])
    end, ranges, ends = np.concatenate(end), np.concatenate(ranges), np.concatenate(ends)
    cuts, end, ranges, ends = _cut_at_seams(s, end, ranges, ends)
    curve = np.where(s.plain[end], end, s.n_e + end)
    edge = s.add_edges(CurveForm.CONIC, curve, ranges, ends)
    return _Arcs(end, ranges, ends, edge, cuts)


def _cut_at_seams(s: _Shell, end, ranges, ends):
    """Split the arcs that the seams of the spheres meet; `cuts` maps (node, pole) to the new point."""
    of_end: dict[int, list[int]] = {}
    wanted = {}
    for i, seam in s.p.seams.items():
        for pole, cut in enumerate((seam.south_cut, seam.north_cut)):
            if cut is not None:
                wanted[i, pole] = cut
    for k in np.flatnonzero(np.isin(end, [e for e, _ in wanted.values()])):
        of_end.setdefault(int(end[k]), []).append(int(k))
    keys, arcs, angles = [], [], []
    for key, (e, angle) in wanted.items():
        arc = next(k for k in of_end[e] if ranges[k, 0] < angle < ranges[k, 1])
        keys.append(key)
        arcs.append(arc)
        angles.append(angle)
    arcs, angles = np.array(arcs, int), np.array(angles)
    e = end[arcs]
    rho, h = (s.R * np.sin(s.a))[e, None], (s.R * np.cos(s.a))[e, None]
    q = np.cos(angles)[:, None] * s.N[e] + np.sin(angles)[:, None] * s.B[e]
    new = s.points.add(len(arcs), x=s.X[e] + h * s.d[e] + rho * q)
    upper, upper_ends = ranges[arcs].copy(), ends[arcs].copy()
    upper[:, 0], upper_ends[:, 0] = angles, new
    ranges, ends = ranges.copy(), ends.copy()
    ranges[arcs, 1], ends[arcs, 1] = angles, new
    cuts = dict(zip(keys, new.tolist(), strict=True))
    return cuts, np.r_[end, e], np.concatenate([ranges, upper]), np.concatenate([ends, upper_ends])


def _lay_fillets(s: _Shell, arcs: _Arcs) -> None:
    e = np.flatnonzero(s.f > 0)
    n = len(e)
    if not n:
        return
    s_of_end = np.full(s.n_e, -1)
    first = np.array([arcs.of_end(i)[0] for i in e.tolist()])
    s_of_end[e] = arcs.ends[first, 0]
    center = s.X[e] + s.reach[e, None] * s.d[e]
    major, minor = s.r[e] + s.f[e], s.f[e]
    gamma = np.arctan2(s.reach[e], major)
    arc = s.frames.add(
        n,
        origin=center + major[:, None] * s.N[e],
        axis=-s.B[e],
        zero=s.N[e],
        radii=np.stack([minor, minor], axis=1),
    )
    seam = s.add_edges(
        CurveForm.CONIC, arc, np.stack([np.full(n, np.pi), np.pi + gamma], axis=1), np.stack([e, s_of_end[e]], axis=1)
    )
    surface = s.frames.add(n, origin=center, axis=s.d[e], zero=s.N[e], radii=np.stack([major, minor], axis=1))
    face = s.faces.add(
        n, form=SurfaceForm.TORUS, surface=surface, reversed_=1, role=FaceRole.FILLET, owner=e, node=s.node[e]
    )
    face_of_end = np.full(s.n_e, -1)
    face_of_end[e] = face
    s.run_line(face, 0, s.tube_edge[e], 0, (0, np.pi), (1, 0))
    s.run_line(face, 1, seam, 0, (TURN, 0), (0, 1))
    k = np.flatnonzero(s.f[arcs.end] > 0)
    top = np.zeros(s.n_e)
    top[e] = np.pi + gamma
    origin = np.stack([np.zeros(len(k)), top[arcs.end[k]]], axis=1)
    s.run_line(face_of_end[arcs.end[k]], 10 - arcs.ranges[k, 0], arcs.edge[k], 1, origin, (1, 0))
    s.run_line(face, 20, seam, 1, (0, 0), (0, 1))


def _lay_mitres(s: _Shell, arcs: _Arcs) -> None:
    """Cylinders from the mitres to the circles of the tubes."""
    for i, node in s.p.mitres.items():
        creases = _lay_creases(s, i)
        ends = node.ends.tolist()
        for k, e in enumerate(ends):
            frame = s.frames.add(1, origin=s.X[e], axis=s.d[e], zero=s.N[e], radii=(s.r[e], 0))
            face = s.faces.add(
                1, form=SurfaceForm.CYLINDER, surface=frame, reversed_=0, role=FaceRole.MITRE, owner=e, node=i
            )
            H = s.R[e] * np.cos(s.a[e])
            foot, height = -1, H
            for arc in arcs.of_end(e):
                s.run_line(face, arcs.ranges[arc, 0], arcs.edge[arc], 0, (0, H), (1, 0))
                if arcs.ranges[arc, 0] == 0:
                    foot = arcs.ends[arc, 0]
            for piece in node.mitre.pieces[k]:
                if piece.neighbour == SPHERE:
                    continue
                edge, t_range = creases[_crease_key(piece)]
                middle, size = _rival(s, e, ends[piece.neighbour])
                forward = piece.end < piece.neighbour
                sign = 1.0 if forward else -1.0
                # The angle is middle + sign t, up to whole turns.
                turns = TURN * np.round((piece.start - middle - sign * t_range[0 if forward else 1]) / TURN)
                poles = s.add_poles(fit_sines(t_range, middle + turns, sign, size))
                s.run_along(face, 0, piece.start, edge, not forward, PcurveForm.FITTED, poles)
                if piece.start == 0:
                    foot, height = s.corners[i][piece.first], size * np.cos(middle)
            line = s.frames.add(1, origin=s.X[e] + s.r[e] * s.N[e], axis=s.d[e], zero=s.N[e], radii=(1, 1))
            seam = s.add_edges(CurveForm.LINE, line, [(height, s.reach[e])], [(foot, e)])
            s.run_line(face, 10, seam, 0, (TURN, 0), (0, 1))
            s.run_line(face, 11, s.tube_edge[e], 1, (0, s.reach[e]), (1, 0))
            s.run_line(face, 12, seam, 1, (0, 0), (0, 1))


def _crease_key(piece: Piece) -> tuple[int, int, int, int]:
    """The same for the two occurrences of a piece between two members, whose corners come in opposite order."""
    if piece.end < piece.neighbour:
        return piece.end, piece.neighbour, piece.first, piece.last
    return piece.neighbour, piece.end, piece.last, piece.first


def _rival(s: _Shell, e: int, other: int) -> tuple[float, float]:
    """Angle around end e at which the other end lies, and the distance r / tan(alpha / 2) of their tip."""
    toward = s.d[other] - (s.d[other] @ s.d[e]) * s.d[e]
    half = np.arctan2(np.linalg.norm(s.d[e] - s.d[other]), np.linalg.norm(s.d[e] + s.d[other]))
    return float(np.arctan2(toward @ s.B[e], toward @ s.N[e])), float(s.r[e] / np.tan(half))


def _lay_creases(s: _Shell, i: int) -> dict[tuple[int, int, int, int], tuple[np.ndarray, tuple[float, float]]]:
    """Edges between the mitred members of node i, with the ranges of their parameter t (see `mitres`)."""
    node = s.p.mitres[i]
    ends = node.ends.tolist()
    creases = {}
    for piece in (piece for path in node.mitre.pieces for piece in path):
        if piece.neighbour < piece.end:
            continue
        e, other = ends[piece.end], ends[piece.neighbour]
        half_sine = np.linalg.norm(s.d[e] - s.d[other]) / 2
        bisector = (s.d[e] + s.d[other]) / np.linalg.norm(s.d[e] + s.d[other])
        frame = s.frames.add(
            1,
            origin=s.X[e],
            axis=(s.d[e] - s.d[other]) / (2 * half_sine),
            zero=bisector,
            radii=(s.r[e] / half_sine, s.r[e]),
        )
        middle, _ = _rival(s, e, other)
        shift = middle + TURN * np.round(((piece.start + piece.stop) / 2 - middle) / TURN)
        t_range = (piece.start - shift, piece.stop - shift)
        edge = s.add_edges(CurveForm.CONIC, frame, [t_range], [s.corners[i][[piece.first, piece.last]]])
        creases[_crease_key(piece)] = (edge, t_range)
    return creases


def _lay_tubes(s: _Shell, arcs: _Arcs) -> None:
    n, straight = s.n_m, s.p.tubes.straight
    length = np.linalg.norm((s.X + s.reach[:, None] * s.d)[1::2] - (s.X + s.reach[:, None] * s.d)[0::2], axis=1)
    m = np.arange(n)
    center = (s.X + s.reach[:, None] * s.d)[0::2]
    frame = s.frames.add(
        n, origin=center, axis=s.d[0::2], zero=s.N[0::2], radii=np.stack([s.r[0::2], s.r[0::2]], axis=1)
    )
    line = s.frames.add(n, origin=center + s.r[0::2, None] * s.N[0::2], axis=s.d[0::2], zero=s.N[0::2], radii=(1, 1))
    face = s.faces.add(
        n,
        form=np.where(straight, SurfaceForm.CYLINDER, SurfaceForm.TUBE),
        surface=np.where(straight, frame, m),
        reversed_=0,
        role=FaceRole.MEMBER,
        owner=m,
        node=s.node[0::2],
    )
    # Parameters around and along: an angle and a length on a cylinder, both in [0, 1] on a fitted tube.
    around, along = np.where(straight, TURN, 1.0), np.where(straight, length, 1.0)
    seam = s.add_edges(
        np.where(straight, CurveForm.LINE, CurveForm.TUBE_SEAM),
        np.where(straight, line, m),
        np.stack([np.zeros(n), along], axis=1),
        np.stack([2 * m, 2 * m + 1], axis=1),
    )
    zero = np.zeros(n)
    s.run_line(face, 10, seam, 0, np.stack([around, zero], axis=1), (0, 1))
    s.run_line(face, 30, seam, 1, (0, 0), (0, 1))
    own = np.flatnonzero(~s.plain)
    shared = np.flatnonzero(s.plain[arcs.end])
    e = np.r_[own, arcs.end[shared]]
    edge = np.r_[s.tube_edge[own], arcs.edge[shared]]
    start = np.r_[np.zeros(len(own)), arcs.ranges[shared, 0]]
    side, member = e % 2, e // 2
    lines = s.lines.add(
        len(e),
        origin=np.stack([side * TURN, side * length[member]], axis=1),
        direction=np.stack([1.0 - 2 * side, np.zeros(len(e))], axis=1),
    )
    form = np.where(straight[member], PcurveForm.LINE, np.where(side == 0, PcurveForm.TUBE_START, PcurveForm.TUBE_END))
    s.run_along(face[member], 0, start + 20 * side, edge, 0, form, np.where(straight[member], lines, 0))


def _lay_spheres(s: _Shell, arcs: _Arcs) -> None:
    nodes = np.array(list(s.p.seams), int)
    seams = [s.p.seams[int(i)] for i in nodes]
    n = len(nodes)
    X, R = s.p.sized.truss.nodes[nodes], s.p.sizes.radius[nodes]
    axis, zero = np.array([seam.axis for seam in seams]), np.array([seam.zero for seam in seams])
    frame = s.frames.add(n, origin=X, axis=axis, zero=zero, radii=np.stack([R, R], axis=1))
    face = s.faces.add(
        n, form=SurfaceForm.SPHERE, surface=frame, reversed_=0, role=FaceRole.NODE, owner=nodes, node=nodes
    )
    poles = np.array([[arcs.cuts.get((int(i), pole), -1) for pole in (0, 1)] for i in nodes])
    for pole, sign in enumerate((-1, 1)):
        free = np.flatnonzero(poles[:, pole] < 0)
        point = s.points.add(len(free), x=X[free] + sign * R[free, None] * axis[free])
        poles[free, pole] = point
        edge = s.add_edges(CurveForm.NONE, 0, (0, TURN), np.stack([point, point], axis=1))
        s.run_line(face[free], (0, 200)[pole], edge, pole, (0, sign * np.pi / 2), (1, 0))
    meridian = s.frames.add(n, origin=X, axis=np.cross(zero, axis), zero=zero, radii=np.stack([R, R], axis=1))
    latitudes = np.array([(seam.south, seam.north) for seam in seams])
    seam_edge = s.add_edges(CurveForm.CONIC, meridian, latitudes, poles)
    s.run_line(face, 100, seam_edge, 0, (TURN, 0), (0, 1))
    s.run_line(face, 300, seam_edge, 1, (0, 0), (0, 1))
    row_of_node = np.full(len(s.p.sized.truss.nodes), -1)
    row_of_node[nodes] = np.arange(n)
    row = row_of_node[s.node[arcs.end]]
    wire, order = _chain_loops(arcs, row, poles)
    frames = np.stack([zero, np.cross(axis, zero), axis], axis=1)
    circles = np.stack([s.N, s.B, s.d], axis=1)[arcs.end]
    fitted, deviation = fit_longitudes(frames[row], R[row], circles, s.a[arcs.end], arcs.ranges)
    s.widened = (arcs.edge, FIT_SAFETY * deviation)
    face_of_arc = face[row]
    island = _find_islands(fitted, row, wire)
    if island.any():
        # Members that enclose a piece of sphere between them cut it off: it is a face of its own.
        pair, place = np.unique(np.stack([row, wire], axis=1)[island], axis=0, return_inverse=True)
        cut_off = s.faces.add(
            len(pair),
            form=SurfaceForm.SPHERE,
            surface=frame[pair[:, 0]],
            reversed_=0,
            role=FaceRole.NODE,
            owner=nodes[pair[:, 0]],
            node=nodes[pair[:, 0]],
        )
        face_of_arc[island] = cut_off[place.ravel()]
    s.run_along(face_of_arc, wire, order, arcs.edge, 1, PcurveForm.FITTED, s.add_poles(fitted))


def _find_islands(poles: np.ndarray, row: np.ndarray, wire: np.ndarray) -> np.ndarray:
    """Arcs of wires, other than the first of their face, that have the face inside: positive area of the parameters."""
    u, v = poles[..., 0], poles[..., 1]
    # The arcs are run against their direction.
    share = -((u[:, 1:] + u[:, :-1]) / 2 * np.diff(v, axis=1)).sum(1)
    area = np.zeros((row.max() + 1, wire.max() + 1))
    np.add.at(area, (row, wire), share)
    return (wire > 0) & (area[row, wire] > 0)


def _chain_loops(arcs: _Arcs, row: np.ndarray, poles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Wire and order of every arc along the face of its sphere, which it bounds against its own direction.

    Wire 0 starts at the seam's south end, around the south pole, and comes back around the north pole.
    """
    wire, order = np.zeros(len(row), int), np.zeros(len(row), int)
    by_row = np.argsort(row, kind="stable")
    bounds = np.searchsorted(row[by_row], np.arange(len(poles) + 1))
    stops, starts = arcs.ends[:, 1].tolist(), arcs.ends[:, 0].tolist()
    for k in range(len(poles)):
        waiting = {stops[a]: int(a) for a in by_row[bounds[k] : bounds[k + 1]]}
        loops = 0
        while waiting:
            place = 0 if poles[k, 0] in waiting else 1 if poles[k, 1] in waiting else 2
            point = int(poles[k, place]) if place < 2 else next(iter(waiting))
            loops += place == 2
            step = (0, 200, 0)[place]
            while point in waiting:
                arc = waiting.pop(point)
                wire[arc], order[arc] = (loops if place == 2 else 0), step
                point, step = starts[arc], step + 1
    return wire, order


def _finish(s: _Shell) -> ShellPlan:
    edges, faces, coedges, frames = s.edges, s.faces, s.coedges, s.frames
    edge, deviation = s.widened
    tolerance = edges["tolerance"].copy()
    tolerance[edge] = np.maximum(tolerance[edge], deviation)
    order = np.lexsort((coedges["order"], coedges["wire"], coedges["face"]))
    face, wire, along, form, pcurve = (
        coedges.whole(name)[order] for name in ("face", "wire", "edge", "form", "pcurve")
    )
    return ShellPlan(
        points=s.points["x"],
        frames=Frames(frames["origin"], frames["axis"], frames["zero"], frames["radii"]),
        edges=Edges(edges.whole("form"), edges.whole("curve"), edges["ranges"], edges.whole("ends"), tolerance),
        faces=Faces(
            faces.whole("form"),
            faces.whole("surface"),
            faces["reversed_"] > 0,
            faces.whole("role"),
            faces.whole("owner"),
            s.p.component[faces.whole("node")],
        ),
        coedges=Coedges(face, wire, along, coedges["reversed_"][order] > 0, form, pcurve),
        pcurve_lines=np.stack([s.lines["origin"], s.lines["direction"]], axis=1),
        pcurve_poles=np.concatenate(s.poles),
        tube_poles=s.p.tubes.poles,
        tolerance=s.tolerance,
        components=int(s.p.component.max()) + 1,
    )
