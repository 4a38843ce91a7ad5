"""Shell of filleted creases: the start of each tube, tori, strips and triangles of the ball, see `creases`."""

import numpy as np
from jaxtyping import Float, Int

from michell_cad.cad.creases import Creases
from michell_cad.cad.fits import Fitted, fit_polynomials, fit_sines
from michell_cad.cad.shell_plan import CurveForm, FaceRole, Strips, SurfaceForm
from michell_cad.cad.shell_tables import TURN, Arcs, ShellTables
from michell_cad.cad.spheres import fit_longitudes

STRIP_DEGREE, STRIP_SPANS = 5, 12
"""Splines along a strip: at 15 degrees between the tubes its edges then err by 2e-6 r, its middle by 3e-4 r."""

CROWDING = 0.6
"""Power of sin(alpha / 2) by which the knots of a strip crowd at the tip, where the ellipse bends most."""


AXES_TRIED = 24
"""Axes that are tried for the sphere of a triangle."""


def lay_creases(s: ShellTables, arcs: Arcs) -> None:
    """Lay the faces of all filleted creases; the arcs on the spheres exist already."""
    c = s.p.creases
    if not len(c.end):
        return
    touch = s.points.add(len(c.end), x=c.touch)
    following = np.empty(len(c.end), int)
    following[c.previous] = np.arange(len(c.end))
    across = _lay_arcs_across(s, c, touch)
    bottom = _lay_tori(s, c, arcs, touch, following, across)
    fitted, strips = _lay_strips(s, c, touch, following, across)
    _lay_cylinders(s, c, touch, bottom, fitted, strips)
    _lay_triangles(s, c, across)


def _offsets(s: ShellTables, c: Creases) -> tuple[np.ndarray, np.ndarray]:
    """Radius r + f of the tubes' offsets and height at which they meet that of the sphere, per piece."""
    offset = (s.r + s.f)[c.end]
    return offset, np.sqrt((s.R + s.f)[c.end] ** 2 - offset**2)


def _lay_arcs_across(s: ShellTables, c: Creases, touch: np.ndarray) -> np.ndarray:
    """Edges where the ball rests at a corner, from contact to contact."""
    f = s.f[c.arc_from]
    axis = np.cross(c.arc_start, c.arc_stop)
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    frame = s.frames.add(
        len(f), origin=c.center[c.arc_corner], axis=axis, zero=c.arc_start, radii=np.stack([f, f], axis=1)
    )
    to_tube = c.arc_to < c.sphere
    ends = np.stack([touch[c.touch_at(c.arc_corner, c.arc_from)], s.contact[c.arc_corner]], axis=1)
    ends[to_tube, 1] = touch[c.touch_at(c.arc_corner[to_tube], c.arc_to[to_tube])]
    ranges = np.stack([np.zeros(len(f)), c.arc_angles], axis=1)
    return s.add_edges(CurveForm.CONIC, frame, ranges, ends)


def _lay_tori(s, c, arcs, touch, following, across) -> np.ndarray:
    """Fillets between tubes and sphere; returns the edges on the tubes, -1 for pieces between tubes."""
    p = np.flatnonzero(c.on_sphere)
    e = c.end[p]
    offset, H = (x[p] for x in _offsets(s, c))
    n = len(p)
    center = s.X[e] + H[:, None] * s.d[e]
    circle = s.frames.add(n, origin=center, axis=s.d[e], zero=s.N[e], radii=np.stack([s.r[e], s.r[e]], axis=1))
    bottom = np.full(len(c.end), -1)
    ranges = np.stack([c.start[p], c.stop[p]], axis=1)
    bottom[p] = s.add_edges(CurveForm.CONIC, circle, ranges, np.stack([touch[p], touch[following[p]]], axis=1))
    surface = s.frames.add(n, origin=center, axis=s.d[e], zero=s.N[e], radii=np.stack([offset, s.f[e]], axis=1))
    face = s.faces.add(
        n, form=SurfaceForm.TORUS, surface=surface, reversed_=1, role=FaceRole.FILLET, owner=e, node=s.node[e]
    )
    s.run_line(face, 0, bottom[p], 0, (0, np.pi), (1, 0))
    s.run_line(face, 1, across[c.last_arc[p]], 0, np.stack([c.stop[p], np.zeros(n)], axis=1) + (0, np.pi), (0, 1))
    s.run_line(face, 20, across[c.first_arc[p]], 1, np.stack([c.start[p], np.zeros(n)], axis=1) + (0, np.pi), (0, 1))
    row = np.full(len(c.end), -1)
    row[p] = np.arange(n)
    k = np.flatnonzero(arcs.piece >= 0)
    at = row[arcs.piece[k]]
    top = np.pi + np.arctan2(H, offset)[at]
    s.run_line(face[at], 10 - arcs.ranges[k, 0], arcs.edge[k], 1, np.stack([np.zeros(len(k)), top], axis=1), (1, 0))
    return bottom


class _Pairs:
    """Pieces between two tubes seen from the lower end, and the geometry of their strips.

    The ball's centre is tip cos(t) d + (r + f) (cos(t) a + sin(t) w) with a the unit vector from the axis of tube
    `one` or `two`, in the plane of both, and w = d x a of the first.
    """

    def __init__(self, s: ShellTables, c: Creases) -> None:
        self.piece = np.flatnonzero(c.neighbour > c.end)
        self.piece = self.piece[~c.on_sphere[self.piece]]
        self.one, self.two = c.end[self.piece], c.neighbour[self.piece]
        d, e = s.d[self.one], s.d[self.two]
        self.sine = np.linalg.norm(d - e, axis=1) / 2
        cosine = np.linalg.norm(d + e, axis=1) / 2
        self.tip = (s.r + s.f)[self.one] * cosine / self.sine
        # From each axis towards the other one.
        self.toward = [_unit(e - (d * e).sum(1, keepdims=True) * d), _unit(d - (d * e).sum(1, keepdims=True) * e)]
        self.normal = np.cross(d, self.toward[0])
        self.middle = [
            np.arctan2((a * s.B[k]).sum(1), (a * s.N[k]).sum(1))
            for a, k in zip(self.toward, (self.one, self.two), strict=True)
        ]
        start, stop = c.start[self.piece], c.stop[self.piece]
        shift = self.middle[0] + TURN * np.round(((start + stop) / 2 - self.middle[0]) / TURN)
        self.range = np.stack([start - shift, stop - shift], axis=1)


def _unit(x: np.ndarray) -> np.ndarray:
    return x / np.linalg.norm(x, axis=-1, keepdims=True)


def _lay_strips(s, c, touch, following, across):
    """Strips between two tubes; returns their edges on the tubes, (n, 2), and their pairs."""
    p = _Pairs(s, c)
    n, first = len(p.piece), c.first[p.piece]
    last = c.last[p.piece]
    r = s.r[p.one]
    edges = []
    for side, e in enumerate((p.one, p.two)):
        major = p.tip[:, None] * s.d[e] + r[:, None] * p.toward[side]
        length = np.linalg.norm(major, axis=1)
        zero = major / length[:, None]
        frame = s.frames.add(
            n, origin=s.X[e], axis=np.cross(zero, p.normal), zero=zero, radii=np.stack([length, r], axis=1)
        )
        ends = np.stack([touch[c.touch_at(first, e)], touch[c.touch_at(last, e)]], axis=1)
        edges.append(s.add_edges(CurveForm.CONIC, frame, p.range, ends))
    strips, missed = fit_strips(s, p)
    s.strips = strips
    face = s.faces.add(
        n,
        form=SurfaceForm.STRIP,
        surface=np.arange(n),
        reversed_=0,
        role=FaceRole.FILLET,
        owner=p.one,
        node=s.node[p.one],
    )
    across_first, across_last = c.first_arc[p.piece], c.last_arc[p.piece]
    s.run_fitted(face, 0, 0, across[across_first], 0, _run_across(c.arc_angles[across_first], p.range[:, 0]))
    s.run_line(face, 1, edges[1], 0, (1, 0), (0, 1))
    s.run_fitted(face, 0, 2, across[across_last], 1, _run_across(c.arc_angles[across_last], p.range[:, 1]))
    s.run_line(face, 3, edges[0], 1, (0, 0), (0, 1))
    for edge in edges:
        s.widen(edge, missed)
    return edges, p


def _run_across(angle: Float[np.ndarray, " n"], t: Float[np.ndarray, " n"]) -> Fitted:
    """Pcurves of arcs over a strip at parameter t: of a rational quadratic arc, at the angle theta from its start.

    tan((theta - angle / 2) / 2) = tan(angle / 4) (2 x - 1) with x from 0 to 1.
    """

    def locate(place: np.ndarray) -> np.ndarray:
        theta = (place - 0.5) * angle[:, None]
        x = (1 + np.tan(theta / 2) / np.tan(angle / 4)[:, None]) / 2
        return np.stack([x, np.broadcast_to(t[:, None], x.shape)], axis=-1)

    return fit_polynomials(locate)


def fit_strips(s: ShellTables, p: _Pairs) -> tuple[Strips, Float[np.ndarray, " n"]]:
    """Splines of the strips, and by how much their edges miss the ellipses, in mm.

    Across, the three homogeneous poles are (x_1, 1), (c w + f m, w), (x_2, 1) with the contacts x_i = c + f a_i of the
    ball, m the unit vector halfway between a_1 and a_2, and w = |a_1 + a_2| / 2.
    """
    x = np.linspace(0, 1, STRIP_SPANS + 1)
    crowd = (p.sine**CROWDING)[:, None]
    low, high = np.arctan2(np.sin(p.range), crowd * np.cos(p.range)).T
    turn = low[:, None] + (high - low)[:, None] * x
    breaks = np.arctan2(crowd * np.sin(turn), np.cos(turn))
    breaks[:, [0, -1]] = p.range
    k = STRIP_DEGREE
    knots = np.concatenate([breaks[:, :1].repeat(k, 1), breaks, breaks[:, -1:].repeat(k, 1)], axis=1)
    places = np.mean([knots[:, i + 1 : knots.shape[1] - k + i] for i in range(k)], axis=0)
    to_poles = np.linalg.inv(spline_basis(knots, places))
    rows, weight = _across(s, p, places)
    poles = np.einsum("npq,nqrd->nrpd", to_poles, rows)
    weights = np.einsum("npq,nq->np", to_poles, weight)
    poles[:, 1] /= weights[..., None]
    between = (places[:, 1:] + places[:, :-1]) / 2
    wanted, _ = _across(s, p, between)
    found = np.einsum("nqp,nrpd->nqrd", spline_basis(knots, between), poles[:, [0, 2]])
    missed = np.linalg.norm(found - wanted[:, :, [0, 2]], axis=-1).max((1, 2)) if len(poles) else np.zeros(0)
    return Strips(poles, weights, knots, k), missed


def _across(s: ShellTables, p: _Pairs, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Homogeneous poles across the strips at t, (n, k, 3, 3), and the weights in the middle, (n, k)."""
    cosine, sine = np.cos(t)[..., None], np.sin(t)[..., None]
    arms = [cosine * a[:, None] + sine * p.normal[:, None] for a in p.toward]
    f, r = s.f[p.one, None, None], s.r[p.one, None, None]
    center = p.tip[:, None, None] * cosine * s.d[p.one, None] + (r + f) * arms[0] + s.X[p.one, None]
    weight = np.linalg.norm(arms[0] + arms[1], axis=-1, keepdims=True) / 2
    middle = center * weight - f * (arms[0] + arms[1]) / (2 * weight)
    return np.stack([center - f * arms[0], middle, center - f * arms[1]], axis=2), weight[..., 0]


def spline_basis(knots: Float[np.ndarray, "n k"], x: Float[np.ndarray, "n j"]) -> Float[np.ndarray, "n j c"]:
    """Values at x of the basis splines of degree `STRIP_DEGREE` on clamped knots, row by row (Cox and de Boor)."""
    t, x = knots[:, None], np.clip(x, knots[:, :1], knots[:, -1:])[..., None]
    interior = (t[..., :-1] <= x) & (x < t[..., 1:])
    last = (x == t[..., -1:]) & (t[..., 1:] == t[..., -1:]) & (t[..., :-1] < t[..., 1:])
    basis = (interior | last).astype(float)
    for k in range(1, STRIP_DEGREE + 1):
        rise, fall = t[..., k:-1] - t[..., : -k - 1], t[..., k + 1 :] - t[..., 1:-k]
        up = np.where(rise > 0, (x - t[..., : -k - 1]) / np.where(rise > 0, rise, 1), 0)
        down = np.where(fall > 0, (t[..., k + 1 :] - x) / np.where(fall > 0, fall, 1), 0)
        basis = up * basis[..., :-1] + down * basis[..., 1:]
    return basis


def _lay_cylinders(s, c, touch, bottom, strip_edges, pairs) -> None:
    """The start of each creased tube, from its creases to where it has parted from its rivals."""
    e = np.unique(c.end)
    frame = s.frames.add(
        len(e), origin=s.X[e], axis=s.d[e], zero=s.N[e], radii=np.stack([s.r[e], np.zeros(len(e))], axis=1)
    )
    face = s.faces.add(
        len(e), form=SurfaceForm.CYLINDER, surface=frame, reversed_=0, role=FaceRole.MITRE, owner=e, node=s.node[e]
    )
    face_of_end = np.full(s.n_e, -1)
    face_of_end[e] = face
    p = np.flatnonzero(c.on_sphere)
    _, H = _offsets(s, c)
    s.run_line(face_of_end[c.end[p]], c.start[p], bottom[p], 0, np.stack([np.zeros(len(p)), H[p]], axis=1), (1, 0))
    _run_ellipses(s, c, face_of_end, strip_edges, pairs)
    # The seam starts at the piece that begins at angle 0.
    foot = np.flatnonzero(c.start == 0)
    foot = foot[np.argsort(c.end[foot])]
    height = np.einsum("nd,nd->n", c.touch[foot] - s.X[e], s.d[e])
    line = s.frames.add(len(e), origin=s.X[e] + s.r[e, None] * s.N[e], axis=s.d[e], zero=s.N[e], radii=(1, 1))
    seam = s.add_edges(CurveForm.LINE, line, np.stack([height, s.reach[e]], axis=1), np.stack([touch[foot], e], axis=1))
    s.run_line(face, 10, seam, 0, (TURN, 0), (0, 1))
    s.run_line(face, 11, s.tube_edge[e], 1, np.stack([np.zeros(len(e)), s.reach[e]], axis=1), (1, 0))
    s.run_line(face, 12, seam, 1, (0, 0), (0, 1))


def _run_ellipses(s: ShellTables, c: Creases, face_of_end, strip_edges, p: _Pairs) -> None:
    """The edges of the strips along the cylinders: forward on the first tube, backward on the second."""
    twin = c.touch_at(c.last[p.piece], p.two)
    starts = [c.start[p.piece], c.start[twin]]
    for side, (e, sign) in enumerate(((p.one, 1.0), (p.two, -1.0))):
        # The angle is middle + sign t, up to whole turns.
        begin = p.range[:, 0] if side == 0 else p.range[:, 1]
        turns = TURN * np.round((starts[side] - p.middle[side] - sign * begin) / TURN)
        fitted = fit_sines(p.range, p.middle[side] + turns, np.full(len(e), sign), p.tip)
        s.run_fitted(face_of_end[e], 0, starts[side], strip_edges[side], side, fitted)
        s.widen(strip_edges[side], s.r[e] * fitted.deviation)


def _lay_triangles(s: ShellTables, c: Creases, across: np.ndarray) -> None:
    """Triangles of the ball, away from the poles of its sphere and from longitude 0."""
    sides: Int[np.ndarray, "n 3"] = c.triangle_arcs
    n, some = len(sides), sides[:, 0]
    axis, zero = _turn_away(c.arc_start[sides], c.arc_stop[sides])
    corner, f = c.arc_corner[some], s.f[c.arc_from[some]]
    surface = s.frames.add(n, origin=c.center[corner], axis=axis, zero=zero, radii=np.stack([f, f], axis=1))
    node = c.node[corner]
    face = s.faces.add(
        n,
        form=SurfaceForm.SPHERE,
        surface=surface,
        reversed_=1,
        role=FaceRole.FILLET,
        owner=c.arc_from[some],
        node=node,
    )
    sphere = np.stack([zero, np.cross(axis, zero), axis], axis=1)
    for k in range(3):
        side = sides[:, k]
        N = c.arc_start[side]
        normal = _unit(np.cross(N, c.arc_stop[side]))
        circle = np.stack([N, np.cross(normal, N), normal], axis=1)
        ranges = np.stack([np.zeros(n), c.arc_angles[side]], axis=1)
        fitted = fit_longitudes(sphere, f, circle, np.full(n, np.pi / 2), ranges)
        s.run_fitted(face, 0, k, across[side], ~c.triangle_forward[:, k], fitted)
        s.widen(across[side], fitted.deviation)


def _turn_away(start: Float[np.ndarray, "n 3 3"], stop: Float[np.ndarray, "n 3 3"]) -> tuple[np.ndarray, np.ndarray]:
    """Axis and direction of longitude 0 of a sphere on which triangles, given by their sides, stay near the equator."""
    points = _unit(np.concatenate([start, stop, start + stop], axis=1))
    middle = _unit(points[:, :6].sum(1))
    x = _unit(np.cross(middle, np.eye(3)[np.abs(middle).argmin(1)]))
    turn = np.linspace(0, np.pi, AXES_TRIED, endpoint=False)[:, None, None]
    axes = np.cos(turn) * x + np.sin(turn) * np.cross(middle, x)
    highest = np.abs(np.einsum("nkd,jnd->jnk", points, axes)).max(2)
    return axes[highest.argmin(0), np.arange(len(middle))], -middle
