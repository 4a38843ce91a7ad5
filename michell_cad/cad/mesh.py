"""The same solid as a watertight triangle mesh, made directly: no tessellation of the B-rep, no mesh boolean.

Circles become polygons of the circle's area (an inscribed 24-gon would lose 1.1 % of the volume), spheres become
polyhedra of the sphere's volume. Neighbouring pieces share the vertices of their common circle.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

from michell_cad.arrays import freeze, require
from michell_cad.cad.mesh_blocks import TURN, Blocks, widened_arc
from michell_cad.cad.mesh_creases import add_creases
from michell_cad.cad.mesh_mitres import add_mitre
from michell_cad.cad.prepared import PreparedTruss
from michell_cad.cad.shell_plan import FaceRole
from michell_cad.cad.sphere_mesh import match_volume, triangulate_sphere
from michell_cad.closed_mesh import ClosedMesh

SEGMENTS = 16
"""Sides of the polygons."""

FEWEST_SEGMENTS = 8

FILLET_BANDS = 3
"""Bands of triangles on a fillet."""


@dataclass(frozen=True, eq=False)
class TrussMesh(ClosedMesh):
    """The mesh of a truss.

    Parameters
    ----------
    vertices, triangles : see `ClosedMesh`.
    role, owner : (t,) int, what each triangle belongs to, see `FaceRole`.
    """

    role: Int[np.ndarray, " t"]
    owner: Int[np.ndarray, " t"]

    def __post_init__(self) -> None:
        super().__post_init__()
        freeze(self, role=np.int64, owner=np.int64)


def mesh_truss(prepared: PreparedTruss, segments: int = SEGMENTS) -> TrussMesh:
    """Mesh the solid of a prepared truss.

    Parameters
    ----------
    prepared : PreparedTruss
    segments : sides of the polygon that stands for a circle, at least 8.

    Returns
    -------
    TrussMesh
        Watertight, unless circles of some node touch each other; `build_solid` checks it and helps such nodes.
    """
    require(segments >= FEWEST_SEGMENTS, f"segments must be at least {FEWEST_SEGMENTS}, found {segments}")
    mesh, p = Blocks(), prepared
    angles = np.arange(segments) * TURN / segments
    area = np.sqrt(TURN / segments / np.sin(TURN / segments))
    X, d, N = p.sized.truss.nodes[p.node_of_end], p.directions, p.normals
    B = np.cross(d, N)
    around = np.cos(angles)[:, None] * N[:, None] + np.sin(angles)[:, None] * B[:, None]
    sizes = p.sizes
    start = X + sizes.reach[:, None] * d
    tube_ring = mesh.add_points(start[:, None] + area * sizes.end_radius[:, None, None] * around)
    _add_tubes(mesh, p, tube_ring, angles, area)
    sphere_ring = _add_fillets(mesh, p, tube_ring, around, area)
    sharp = [i for i, node in p.mitres.items() if not sizes.fillet[node.ends[0]] > 0]
    outlines = {i: add_mitre(mesh, p, i, tube_ring, angles, around) for i in sharp}
    outlines |= add_creases(mesh, p, tube_ring, angles, area, FILLET_BANDS)
    _add_spheres(mesh, p, sphere_ring, around, outlines)
    tables = [np.concatenate(blocks) for blocks in (mesh.points, mesh.triangles, mesh.roles, mesh.owners)]
    for table in tables:
        table.flags.writeable = False  # so that they are not copied
    return TrussMesh(*tables)


def _bands(rings: np.ndarray) -> np.ndarray:
    """Triangles between consecutive rings, (..., k, n) -> (..., k - 1, n, 2, 3); outward if rings advance along d."""
    a, b = rings[..., :-1, :], rings[..., 1:, :]
    a_next, b_next = np.roll(a, -1, axis=-1), np.roll(b, -1, axis=-1)
    return np.stack([np.stack([a, a_next, b_next], axis=-1), np.stack([a, b_next, b], axis=-1)], axis=-2)


def _add_tubes(mesh: Blocks, p: PreparedTruss, tube_ring: np.ndarray, angles: np.ndarray, area: float) -> None:
    n_m = len(p.tubes.straight)
    last = np.roll(tube_ring[1::2][:, ::-1], 1, axis=1)
    counts = np.where(p.tubes.straight, 0, 2 * p.tubes.sections - 3)
    for count in np.unique(counts).tolist():
        members = np.flatnonzero(counts == count)
        rings = [tube_ring[2 * members][:, None]]
        if count:
            rings.append(mesh.add_points(_tube_rings(p, members, count, angles, area)))
        rings.append(last[members][:, None])
        mesh.add_triangles(_bands(np.concatenate(rings, axis=1)), FaceRole.MEMBER, np.arange(n_m)[members])


def _tube_rings(p: PreparedTruss, members: np.ndarray, count: int, angles: np.ndarray, area: float) -> np.ndarray:
    """Points of the rings inside the tubes, (n, count, segments, 3).

    The frusta between rings would lose volume where a tube bulges: the squared radius g of a ring is raised by
    (2 g - g_before - g_after) / 12, which makes the trapezoidal rule that the frusta stand for as exact as Simpson's.
    """
    t = np.linspace(0, 1, count + 2)
    tubes = p.tubes.some(members)
    spine = tubes.spine_points(t[1:-1])[:, :, None]
    square = tubes.radii_at(t) ** 2
    grown = np.sqrt(1 + (2 * square[:, 1:-1] - square[:, :-2] - square[:, 2:]) / (12 * square[:, 1:-1]))
    return spine + (area * grown)[..., None, None] * (tubes.surface_points(angles, t[1:-1]) - spine)


def _add_fillets(mesh, p, tube_ring, around, area) -> np.ndarray:
    """Bands of the fillets; returns the rings on the spheres (those of creased ends are not used)."""
    sphere_ring = tube_ring.copy()
    e = np.flatnonzero((p.sizes.fillet > 0) & ~p.sizes.creased)
    if not len(e):
        return sphere_ring
    r, f, H = p.sizes.end_radius[e, None], p.sizes.fillet[e, None], p.sizes.reach[e, None]
    turned = np.linspace(0, 1, FILLET_BANDS + 1)[1:] * np.arctan2(H, r + f)
    ball = f * widened_arc(turned[:, -1:], FILLET_BANDS)
    axial, radial = H - ball * np.sin(turned), r + f - ball * np.cos(turned)
    X, d = p.sized.truss.nodes[p.node_of_end[e]], p.directions[e]
    center = X[:, None] + axial[..., None] * d[:, None]
    rings = mesh.add_points(center[:, :, None] + area * radial[..., None, None] * around[e][:, None])
    inward = np.concatenate([tube_ring[e][:, None], rings], axis=1)
    mesh.add_triangles(_bands(inward[:, ::-1]), FaceRole.FILLET, e)
    sphere_ring[e] = rings[:, -1]
    return sphere_ring


def _add_spheres(mesh: Blocks, p: PreparedTruss, sphere_ring, around, outlines) -> None:
    node, X = p.node_of_end, p.sized.truss.nodes
    order = np.argsort(node, kind="stable")
    nodes, first = np.unique(node[order], return_index=True)
    cosine, sine = np.cos(p.caps), np.sin(p.caps)
    all_points = np.concatenate(mesh.points)
    for i, ends in zip(nodes.tolist(), np.split(order, first[1:]), strict=True):
        R = p.sizes.radius[i]
        plain = ends[~p.sizes.creased[ends]]
        d = p.directions[plain, None]
        unit = cosine[plain, None, None] * d + sine[plain, None, None] * around[plain]
        boundary, ids = [unit.reshape(-1, 3)], [sphere_ring[plain].ravel()]
        arcs = None
        solid_angle, euler = 2 * np.pi * (2.0 - len(plain)) + (TURN * cosine[plain]).sum(), 0
        if i in outlines:
            outline = outlines[i]
            boundary.append(outline.points / np.linalg.norm(outline.points, axis=1, keepdims=True))
            ids.append(outline.vertices)
            rings = sphere_ring[plain]
            circles = np.stack([rings, np.roll(rings, -1, axis=1)], axis=-1).reshape(-1, 2)
            arcs = np.concatenate([circles, outline.arcs])
            solid_angle += outline.area
            euler = outline.loops
        solid_angle -= 2 * np.pi * euler
        ids = np.concatenate(ids)
        if arcs is not None:
            place = np.argsort(ids, kind="stable")
            arcs = place[np.searchsorted(ids, arcs, sorter=place)]
        inner, triangles = triangulate_sphere(np.concatenate(boundary), p.directions[ends], p.caps[ends], arcs)
        points = np.concatenate([all_points[ids] - X[i], R * inner])
        is_inner = np.arange(len(points)) >= len(ids)
        factor = match_volume(points, triangles, is_inner, R**3 * solid_angle / 3) if len(inner) else 1.0
        ids = np.concatenate([ids, mesh.add_points(X[i] + factor * R * inner)])
        mesh.add_triangles(ids[triangles], FaceRole.NODE, i)
