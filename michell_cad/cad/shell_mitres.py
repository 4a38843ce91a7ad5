"""Shell of sharp mitres: cylinders cut by the planes that bisect neighbouring members (nodes without fillets)."""

import numpy as np

from michell_cad.cad.fits import fit_sines
from michell_cad.cad.mitre_cuts import SPHERE
from michell_cad.cad.mitres import Piece
from michell_cad.cad.shell_plan import CurveForm, FaceRole, SurfaceForm
from michell_cad.cad.shell_tables import TURN, Arcs, ShellTables


def lay_mitres(s: ShellTables, arcs: Arcs) -> None:
    """Cylinders from the mitres to the circles of the tubes."""
    for i, node in s.p.mitres.items():
        ends = node.ends.tolist()
        if s.f[ends[0]] > 0:
            continue
        creases = _lay_creases(s, i)
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
                fitted = fit_sines(np.array([t_range]), np.array([middle + turns]), np.array([sign]), np.array([size]))
                s.run_fitted(face, 0, piece.start, edge, not forward, fitted)
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


def _rival(s: ShellTables, e: int, other: int) -> tuple[float, float]:
    """Angle around end e at which the other end lies, and the distance r / tan(alpha / 2) of their tip."""
    toward = s.d[other] - (s.d[other] @ s.d[e]) * s.d[e]
    half = np.arctan2(np.linalg.norm(s.d[e] - s.d[other]), np.linalg.norm(s.d[e] + s.d[other]))
    return float(np.arctan2(toward @ s.B[e], toward @ s.N[e])), float(s.r[e] / np.tan(half))


def _lay_creases(s: ShellTables, i: int) -> dict[tuple[int, int, int, int], tuple[np.ndarray, tuple[float, float]]]:
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
