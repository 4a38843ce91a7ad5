"""Triangles of filleted creases: grids over the tori and strips, and over the triangles of the ball, see `creases`.

Grids share the points along their common edges: `bands` steps across a fillet, and along a piece about as many as the
polygons of the tubes have.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int

from michell_cad.cad.creases import Creases
from michell_cad.cad.mesh_blocks import TURN, Blocks, Outline, mitre_area, widened_arc, zip_rings
from michell_cad.cad.nodes import angles_between
from michell_cad.cad.prepared import PreparedTruss
from michell_cad.cad.shell_plan import FaceRole


@dataclass(eq=False)
class _Lines:
    """Vertices along the two sides of every piece, from its first corner to its last: on the tube, and opposite."""

    angles: list[np.ndarray]
    tube: list[np.ndarray]
    opposite: list[np.ndarray]


def add_creases(
    mesh: Blocks,
    p: PreparedTruss,
    tube_ring: Int[np.ndarray, "n_e n"],
    angles: Float[np.ndarray, " n"],
    area: float,
    bands: int,
) -> dict[int, Outline]:
    """Add all creases between the spheres and the rings at the start of the tubes; returns what bounds the spheres."""
    c = p.creases
    if not len(c.end):
        return {}
    touch = mesh.add_points(_swell(p, c.end, c.touch, area))
    X, R = p.sized.truss.nodes[c.node], p.sizes.radius[c.node]
    away = c.center - X
    contact = mesh.add_points(X + R[:, None] * away / np.linalg.norm(away, axis=1, keepdims=True))
    arcs = _add_arcs(mesh, p, c, touch, contact, bands)
    lines = _add_grids(mesh, p, c, touch, arcs, TURN / len(angles), area, bands)
    _add_triangles(mesh, p, c, arcs, bands)
    by_end = np.split(np.arange(len(c.end)), np.flatnonzero(np.diff(c.end)) + 1)
    for pieces in by_end:
        e = int(c.end[pieces[0]])
        u = np.concatenate([lines.angles[k][:-1] for k in pieces])
        bottom = np.concatenate([lines.tube[k][:-1] for k in pieces])
        mesh.add_triangles(zip_rings(u, bottom, angles, tube_ring[e]), FaceRole.MITRE, e)
    return _outlines(mesh, p, c, lines)


def _swell(p: PreparedTruss, end: np.ndarray, points: np.ndarray, area: float) -> np.ndarray:
    """Points on tubes, moved away from the axis so that polygons get the area of the circle."""
    away = points - p.sized.truss.nodes[p.node_of_end[end]]
    d = p.directions[end]
    return points + (area - 1) * (away - np.einsum("nd,nd->n", away, d)[:, None] * d)


def _slerp(a: np.ndarray, b: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Unit vectors at fractions of the way from a to b (..., 3), as a new last axis but one."""
    omega = 2 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))[..., None, None]
    x = share[..., None]
    return (np.sin((1 - x) * omega) * a[..., None, :] + np.sin(x * omega) * b[..., None, :]) / np.sin(omega)


def _add_arcs(mesh, p, c: Creases, touch, contact, bands: int) -> np.ndarray:
    """Vertices of the arcs at the corners, (n_a, bands + 1), both ends included."""
    inner = _slerp(c.arc_start, c.arc_stop, np.arange(1, bands) / bands)
    f = p.sizes.fillet[c.arc_from, None] * widened_arc(c.arc_angles[:, None], bands)[:, :-1]
    ids = mesh.add_points(c.center[c.arc_corner, None] + f[..., None] * inner)
    last = contact[c.arc_corner]
    to_tube = np.flatnonzero(c.arc_to < c.sphere)
    last[to_tube] = touch[c.touch_at(c.arc_corner[to_tube], c.arc_to[to_tube])]
    return np.column_stack([touch[c.touch_at(c.arc_corner, c.arc_from)], ids, last])


def _add_grids(mesh, p, c: Creases, touch, arcs, step: float, area: float, bands: int) -> _Lines:
    """Grids of all pieces; those between two tubes are laid from the lower end."""
    low = np.flatnonzero(c.end < c.neighbour)
    counts = np.maximum(1, np.ceil((c.stop - c.start)[low] / step - 1e-9)).astype(int)
    twin = np.full(len(c.end), -1)
    between = low[~c.on_sphere[low]]
    twin[between] = c.touch_at(c.last[between], c.neighbour[between])
    nothing = np.zeros(0, int)
    lines = _Lines([nothing] * len(c.end), [nothing] * len(c.end), [nothing] * len(c.end))
    for n in np.unique(counts):
        pieces = low[counts == n]
        share = np.arange(n + 1) / n
        grid = np.empty((len(pieces), n + 1, bands + 1), int)
        grid[:, 0], grid[:, -1] = arcs[c.first_arc[pieces]], arcs[c.last_arc[pieces]]
        u = c.start[pieces, None] + (c.stop - c.start)[pieces, None] * share
        if n > 1:
            grid[:, 1:-1] = mesh.add_points(_blend(p, c, pieces, u[:, 1:-1], area, bands))
        corners = np.stack([grid[:, :-1, :-1], grid[:, :-1, 1:], grid[:, 1:, 1:], grid[:, 1:, :-1]], axis=-1)
        mesh.add_triangles(corners[..., [[0, 1, 2], [0, 2, 3]]], FaceRole.FILLET, c.end[pieces])
        for k, piece in enumerate(pieces.tolist()):
            lines.angles[piece], lines.tube[piece], lines.opposite[piece] = u[k], grid[k, :, 0], grid[k, :, -1]
            if twin[piece] >= 0:
                other = twin[piece]
                lines.angles[other] = c.start[other] + (c.stop - c.start)[other] * share
                lines.tube[other] = grid[k, ::-1, -1]
    return lines


def _blend(p: PreparedTruss, c: Creases, pieces: np.ndarray, u: np.ndarray, area: float, bands: int) -> np.ndarray:
    """Points of the blends at the angles u of tubes, from the tube to the other side, (n, k, bands + 1, 3)."""
    e, other = c.end[pieces], np.minimum(c.neighbour[pieces], c.sphere - 1)
    d, N = p.directions[e, None], p.normals[e, None]
    arm = np.cos(u)[..., None] * N + np.sin(u)[..., None] * np.cross(d, N)
    f, r = p.sizes.fillet[e, None, None], p.sizes.end_radius[e, None, None]
    R = p.sizes.radius[p.node_of_end[e], None, None]
    across = d - p.directions[other, None]
    on_sphere = c.on_sphere[pieces, None, None]
    slope = np.where(on_sphere, 1.0, (d * across).sum(-1, keepdims=True))
    height = np.where(
        on_sphere, np.sqrt((R + f) ** 2 - (r + f) ** 2), -(r + f) * (arm * across).sum(-1, keepdims=True) / slope
    )
    ball = height * d + (r + f) * arm
    axis = p.directions[other, None]
    far_arm = ball - (ball * axis).sum(-1, keepdims=True) * axis
    target = -np.where(on_sphere, ball / (R + f), far_arm / (r + f))
    angle = angles_between(-arm, target)
    widened = widened_arc(angle.reshape(-1, 1), bands).reshape(*angle.shape, bands)
    out = f[..., None] * np.concatenate([np.ones_like(widened[..., :1]), widened], axis=-1)[..., None]
    points = ball[..., None, :] + out * _slerp(-arm, target, np.arange(bands + 1) / bands)
    points[:, :, 0] += ((area - 1) * r) * arm
    swollen = points[:, :, -1] + (area - 1) * r * far_arm / (r + f)
    points[:, :, -1] = np.where(on_sphere, points[:, :, -1], swollen)
    return points + p.sized.truss.nodes[p.node_of_end[e], None, None]


def _add_triangles(mesh, p, c: Creases, arcs: np.ndarray, bands: int) -> None:
    """Triangles of the ball, as triangular grids of `bands` rows; they face the ball's centre."""
    if not len(c.triangle_arcs):
        return
    sides, vectors = [], []
    for k in range(3):
        forward = c.triangle_forward[:, k]
        ids = arcs[c.triangle_arcs[:, k]]
        sides.append(np.where(forward[:, None], ids, ids[:, ::-1]))
        ends = c.arc_start[c.triangle_arcs[:, k]], c.arc_stop[c.triangle_arcs[:, k]]
        vectors.append(np.where(forward[:, None], ends[0], ends[1]))
    a, b, third = vectors
    corner = c.arc_corner[c.triangle_arcs[:, 0]]
    f = p.sizes.fillet[c.arc_from[c.triangle_arcs[:, 0]]]
    left, right = sides[0], sides[2][:, ::-1]
    rows = [left[:, :1]]
    for i in range(1, bands):
        share = np.array([i / bands])
        ends = _slerp(a, b, share)[:, 0], _slerp(a, third, share)[:, 0]
        inner = _slerp(*ends, np.arange(1, i) / i)
        ids = mesh.add_points(c.center[corner, None] + f[:, None, None] * inner)
        rows.append(np.concatenate([left[:, [i]], ids, right[:, [i]]], axis=1))
    rows.append(sides[1])
    triangles = []
    for upper, lower in pairwise(rows):
        n = upper.shape[1]
        triangles += [np.stack([upper[:, j], lower[:, j + 1], lower[:, j]], axis=1) for j in range(n)]
        triangles += [np.stack([upper[:, j], upper[:, j + 1], lower[:, j + 1]], axis=1) for j in range(n - 1)]
    mesh.add_triangles(np.stack(triangles, axis=1), FaceRole.FILLET, c.arc_from[c.triangle_arcs[:, 0]])


def _outlines(mesh: Blocks, p: PreparedTruss, c: Creases, lines: _Lines) -> dict[int, Outline]:
    """The sides of the pieces along the sphere of each node."""
    points = np.concatenate(mesh.points)
    pieces: dict[int, list[int]] = {int(i): [] for i in np.unique(c.node)}
    for k in np.flatnonzero(c.on_sphere):
        pieces[int(c.node[c.first[k]])].append(int(k))
    result = {}
    for i, mine in pieces.items():
        chains = [lines.opposite[k] for k in mine]
        arcs = [np.stack([chain[:-1], chain[1:]], axis=1) for chain in chains]
        vertices = np.unique(np.concatenate([np.zeros(0, int), *chains]))
        around = points[vertices] - p.sized.truss.nodes[i]
        result[i] = Outline(vertices, around, np.concatenate([np.zeros((0, 2), int), *arcs]), *mitre_area(p, i))
    return result
