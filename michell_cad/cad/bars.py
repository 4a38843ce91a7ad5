"""The truss as separate solids: one bar for each curve, and one body for each node (`node_bodies`).

A bar runs along its whole curve: the tubes of its members, joined inside the nodes by short cores (`bar_pieces`), and
closed by plane discs where the curve ends. A node is its sphere with all fillets, closed by discs where the tubes
begin. So bars and nodes overlap inside the nodes, and united they are the one solid.

A member of two curves belongs to the bar of the curve that names it (`Truss.curve_of_member`). Where a curve lacks a
member for that reason, or turns so sharply at a node that no core can follow, it has more than one bar.

Every piece of a bar is a face with a seam, and the circles between pieces are edges that they share. Where a closed bar
closes, the seams of the two pieces do not meet: the circle there is cut in two arcs, at both seams.
"""

import numpy as np
from jaxtyping import Int

from michell_cad.cad.bar_pieces import Chains, Pieces, lay_pieces
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


def plan_bars(prepared: PreparedTruss) -> tuple[ShellPlan, Int[np.ndarray, " n_b"]]:
    """The bars as a plan with one component each, and the curve of each bar."""
    pieces, chains, gap = lay_pieces(prepared)
    return _plan(pieces, chains, gap), chains.curve


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
