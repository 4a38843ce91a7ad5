"""Assemble the shell: every edge is made once and shared by its two faces, so that the shell is closed by construction.

Per node a sphere face; per filleted end a torus face; per mitred end a cylinder face from the mitre out to where it has
parted from its rivals; per member a tube face. Curves along the sphere are circles, cut at corners of mitres and where
the seam of the sphere meets them.
"""

import numpy as np

from michell_cad.cad.fits import Fitted
from michell_cad.cad.prepared import PreparedTruss
from michell_cad.cad.shell_creases import lay_creases
from michell_cad.cad.shell_mitres import lay_mitres
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
from michell_cad.cad.shell_tables import TURN, Arcs, ShellTables
from michell_cad.cad.spheres import fit_longitudes


def assemble_shell(prepared: PreparedTruss) -> ShellPlan:
    """Lay out points, edges and faces of all solids of a prepared truss."""
    shell = ShellTables(prepared)
    _lay_circles(shell)
    arcs = _lay_arcs(shell)
    _lay_fillets(shell, arcs)
    lay_mitres(shell, arcs)
    lay_creases(shell, arcs)
    _lay_tubes(shell, arcs)
    _lay_spheres(shell, arcs)
    return _finish(shell)


def _lay_circles(s: ShellTables) -> None:
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


def _lay_arcs(s: ShellTables) -> Arcs:
    """Edges on the spheres: whole circles, or arcs between corners of mitres, cut where a seam meets them."""
    filleted = np.flatnonzero(~s.plain & ~s.creased)
    whole = np.flatnonzero(~s.creased)
    vertex = np.arange(s.n_e)
    rho, h = s.R * np.sin(s.a), s.R * np.cos(s.a)
    on_sphere = s.X + h[:, None] * s.d + rho[:, None] * s.N
    vertex[filleted] = s.points.add(len(filleted), x=on_sphere[filleted])
    end, ranges = [whole], [np.tile([0.0, TURN], (len(whole), 1))]
    ends = [np.stack([vertex[whole], vertex[whole]], axis=1)]
    piece = [np.full(len(whole), -1)]
    for i, node in s.p.mitres.items():
        if s.f[node.ends[0]] > 0:
            continue
        X = s.p.sized.truss.nodes[i]
        s.corners[i] = s.points.add(len(node.mitre.corners), x=X + node.mitre.corners)
        pieces = [piece for path in node.mitre.pieces for piece in path if piece.neighbour < 0]
        if pieces:
            end.append(node.ends[[piece.end for piece in pieces]])
            ranges.append(np.array([(piece.start, piece.stop) for piece in pieces]))
            ends.append(s.corners[i][[(piece.first, piece.last) for piece in pieces]])
            piece.append(np.full(len(pieces), -1))
    creases = s.p.creases
    at = np.flatnonzero(creases.on_sphere)
    touched, place = np.unique(np.stack([creases.first[at], creases.last[at]], axis=1), return_inverse=True)
    X, R = s.p.sized.truss.nodes[creases.node[touched]], s.p.sizes.radius[creases.node[touched]]
    away = creases.center[touched] - X
    s.contact = np.full(len(creases.node), -1)
    s.contact[touched] = s.points.add(
        len(touched), x=X + R[:, None] * away / np.linalg.norm(away, axis=1, keepdims=True)
    )
    end.append(creases.end[at])
    ranges.append(np.stack([creases.start[at], creases.stop[at]], axis=1))
    ends.append(s.contact[touched][place.reshape(-1, 2)])
    piece.append(at)
    end, ranges, ends, piece = (np.concatenate(parts) for parts in (end, ranges, ends, piece))
    cuts, end, ranges, ends, piece = _cut_at_seams(s, end, ranges, ends, piece)
    curve = np.where(s.plain[end], end, s.n_e + end)
    edge = s.add_edges(CurveForm.CONIC, curve, ranges, ends)
    return Arcs(end, ranges, ends, piece, edge, cuts)


def _cut_at_seams(s: ShellTables, end, ranges, ends, piece):
    """Split the arcs that the seams of the spheres meet; `cuts` (n_n, 2) are the new points."""
    seams = s.p.seams
    node, pole = np.nonzero((seams.cap >= 0) & seams.found[:, None])
    by_node = np.argsort(s.node, kind="stable")
    first_end = np.searchsorted(s.node[by_node], np.arange(len(seams.found)))
    wanted, angles = by_node[first_end[node] + seams.cap[node, pole]], seams.angle[node, pole]
    of_end: dict[int, list[int]] = {}
    for k in np.flatnonzero(np.isin(end, wanted)).tolist():
        of_end.setdefault(int(end[k]), []).append(k)
    arcs = np.array(
        [
            next(k for k in of_end[e] if ranges[k, 0] < angle < ranges[k, 1])
            for e, angle in zip(wanted.tolist(), angles.tolist(), strict=True)
        ],
        int,
    )
    e = end[arcs]
    rho, h = (s.R * np.sin(s.a))[e, None], (s.R * np.cos(s.a))[e, None]
    q = np.cos(angles)[:, None] * s.N[e] + np.sin(angles)[:, None] * s.B[e]
    new = s.points.add(len(arcs), x=s.X[e] + h * s.d[e] + rho * q)
    upper, upper_ends = ranges[arcs].copy(), ends[arcs].copy()
    upper[:, 0], upper_ends[:, 0] = angles, new
    ranges, ends = ranges.copy(), ends.copy()
    ranges[arcs, 1], ends[arcs, 1] = angles, new
    cuts = np.full(seams.cap.shape, -1)
    cuts[node, pole] = new
    ranges, ends = np.concatenate([ranges, upper]), np.concatenate([ends, upper_ends])
    return cuts, np.r_[end, e], ranges, ends, np.r_[piece, piece[arcs]]


def _lay_fillets(s: ShellTables, arcs: Arcs) -> None:
    e = np.flatnonzero((s.f > 0) & ~s.creased)
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
    k = np.flatnonzero(face_of_end[arcs.end] >= 0)
    top = np.zeros(s.n_e)
    top[e] = np.pi + gamma
    origin = np.stack([np.zeros(len(k)), top[arcs.end[k]]], axis=1)
    s.run_line(face_of_end[arcs.end[k]], 10 - arcs.ranges[k, 0], arcs.edge[k], 1, origin, (1, 0))
    s.run_line(face, 20, seam, 1, (0, 0), (0, 1))


def _lay_tubes(s: ShellTables, arcs: Arcs) -> None:
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


def _lay_spheres(s: ShellTables, arcs: Arcs) -> None:
    seams = s.p.seams
    nodes = np.flatnonzero(seams.found)
    n = len(nodes)
    X, R = s.p.sized.truss.nodes[nodes], s.p.sizes.radius[nodes]
    axis, zero = seams.axis[nodes], seams.zero[nodes]
    frame = s.frames.add(n, origin=X, axis=axis, zero=zero, radii=np.stack([R, R], axis=1))
    face = s.faces.add(
        n, form=SurfaceForm.SPHERE, surface=frame, reversed_=0, role=FaceRole.NODE, owner=nodes, node=nodes
    )
    poles = arcs.cuts[nodes]
    for pole, sign in enumerate((-1, 1)):
        free = np.flatnonzero(poles[:, pole] < 0)
        point = s.points.add(len(free), x=X[free] + sign * R[free, None] * axis[free])
        poles[free, pole] = point
        edge = s.add_edges(CurveForm.NONE, 0, (0, TURN), np.stack([point, point], axis=1))
        s.run_line(face[free], (0, 200)[pole], edge, pole, (0, sign * np.pi / 2), (1, 0))
    meridian = s.frames.add(n, origin=X, axis=np.cross(zero, axis), zero=zero, radii=np.stack([R, R], axis=1))
    seam_edge = s.add_edges(CurveForm.CONIC, meridian, seams.latitudes[nodes], poles)
    s.run_line(face, 100, seam_edge, 0, (TURN, 0), (0, 1))
    s.run_line(face, 300, seam_edge, 1, (0, 0), (0, 1))
    row_of_node = np.full(len(s.p.sized.truss.nodes), -1)
    row_of_node[nodes] = np.arange(n)
    row = row_of_node[s.node[arcs.end]]
    wire, order = _chain_loops(arcs, row, poles)
    frames = np.stack([zero, np.cross(axis, zero), axis], axis=1)
    circles = np.stack([s.N, s.B, s.d], axis=1)[arcs.end]
    fitted = fit_longitudes(frames[row], R[row], circles, s.a[arcs.end], arcs.ranges)
    s.widen(arcs.edge, fitted.deviation)
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
    s.run_fitted(face_of_arc, wire, order, arcs.edge, 1, fitted)


def _find_islands(fitted: Fitted, row: np.ndarray, wire: np.ndarray) -> np.ndarray:
    """Arcs of wires, other than the first of their face, that have the face inside: positive area of the parameters."""
    share = np.zeros(len(row))
    for number, poles in enumerate(fitted.poles):
        u, v = poles[..., 0], poles[..., 1]
        # The arcs are run against their direction.
        share[fitted.fit == number] = -((u[:, 1:] + u[:, :-1]) / 2 * np.diff(v, axis=1)).sum(1)
    area = np.zeros((row.max() + 1, wire.max() + 1))
    np.add.at(area, (row, wire), share)
    return (wire > 0) & (area[row, wire] > 0)


def _chain_loops(arcs: Arcs, row: np.ndarray, poles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
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


def _finish(s: ShellTables) -> ShellPlan:
    edges, faces, coedges, frames = s.edges, s.faces, s.coedges, s.frames
    tolerance = edges["tolerance"].copy()
    for edge, deviation in s.widened:
        np.maximum.at(tolerance, edge, deviation)
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
        pcurve_poles=tuple(np.concatenate(poles) for poles in s.poles),
        strips=s.strips,
        tube_poles=tuple(s.p.tubes.poles),
        tolerance=s.tolerance,
        components=int(s.p.component.max()) + 1,
    )
