"""The same solid as a watertight triangle mesh, made directly: no tessellation of the B-rep, no mesh boolean.

Circles become polygons of the circle's area (an inscribed 24-gon would lose 1.1 % of the volume), spheres become
polyhedra of the sphere's volume. Neighbouring pieces share the vertices of their common circle.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from michell_cad.arrays import freeze, require
from michell_cad.cad.mitres import SPHERE
from michell_cad.cad.prepared import PreparedTruss
from michell_cad.cad.shell_plan import FaceRole
from michell_cad.cad.sphere_mesh import match_volume, triangulate_sphere
from michell_cad.cad.tubes import SECTIONS

SEGMENTS = 16
"""Sides of the polygons."""

FEWEST_SEGMENTS = 8

FILLET_RINGS = 5
"""Bands of triangles on a fillet."""

TURN = 2 * np.pi


@dataclass(frozen=True, eq=False)
class TrussMesh:
    """A closed triangle mesh; triangles turn counter-clockwise seen from outside.

    Parameters
    ----------
    vertices : (n, 3) float, mm.
    triangles : (t, 3) int.
    role, owner : (t,) int, what each triangle belongs to, see `FaceRole`.
    """

    vertices: Float[np.ndarray, "n 3"]
    triangles: Int[np.ndarray, "t 3"]
    role: Int[np.ndarray, " t"]
    owner: Int[np.ndarray, " t"]

    def __post_init__(self) -> None:
        freeze(self, vertices=np.float64, triangles=np.int64, role=np.int64, owner=np.int64)

    @cached_property
    def volume(self) -> float:
        """Enclosed volume, mm^3, by the divergence theorem."""
        a, b, c = (self.vertices - self.vertices.mean(0))[self.triangles].transpose(1, 0, 2)
        return float(np.einsum("td,td->", a, np.cross(b, c)) / 6)

    @cached_property
    def open_triangles(self) -> Int[np.ndarray, " k"]:
        """Triangles with an edge that has not exactly two triangles, which run along it in opposite directions."""
        t, n = self.triangles, len(self.vertices)
        edges = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
        code, back = edges[:, 0] * n + edges[:, 1], edges[:, 1] * n + edges[:, 0]
        order = np.argsort(code)
        ranked = code[order]
        once = np.ones(len(code), bool)
        once[order[1:]] &= ranked[1:] != ranked[:-1]
        once[order[:-1]] &= ranked[1:] != ranked[:-1]
        # The usual case, at the price of one more sort: both directions of every edge are there, once each.
        if once.all() and np.array_equal(ranked, np.sort(back)):
            return np.zeros(0, np.int64)
        paired = ranked[np.minimum(np.searchsorted(ranked, back), len(ranked) - 1)] == back
        return np.flatnonzero(~(once & paired).reshape(3, -1).all(0))

    @cached_property
    def is_watertight(self) -> bool:
        """Whether every edge has exactly two triangles, which run along it in opposite directions."""
        return not len(self.open_triangles)

    @cached_property
    def euler_number(self) -> int:
        """Vertices - edges + triangles of a watertight mesh: 2 - 2 genus, summed over the bodies."""
        used = np.zeros(len(self.vertices), bool)
        used[self.triangles] = True
        return int(used.sum()) - len(self.triangles) // 2


class _Mesh:
    """Blocks of vertices and triangles while they grow."""

    def __init__(self) -> None:
        self.points: list[np.ndarray] = []
        self.count = 0
        self.triangles: list[np.ndarray] = []
        self.roles: list[np.ndarray] = []
        self.owners: list[np.ndarray] = []

    def add_points(self, points: np.ndarray) -> np.ndarray:
        flat = points.reshape(-1, 3)
        self.points.append(flat)
        self.count += len(flat)
        return (self.count - len(flat) + np.arange(len(flat))).reshape(points.shape[:-1])

    def add_triangles(self, triangles: np.ndarray, role: int, owner: np.ndarray | int) -> None:
        """`owner` has one entry for each entry of the leading axis of `triangles`."""
        n = triangles.reshape(-1, 3).shape[0]
        owner = np.asarray(owner)
        self.triangles.append(triangles.reshape(-1, 3))
        self.owners.append(np.repeat(owner, n // owner.size) if owner.ndim else np.full(n, owner))
        self.roles.append(np.full(n, role))


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
    mesh, p = _Mesh(), prepared
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
    outlines = {i: _add_mitre(mesh, p, i, tube_ring, angles, around) for i in p.mitres}
    _add_spheres(mesh, p, sphere_ring, around, outlines)
    return TrussMesh(
        np.concatenate(mesh.points),
        np.concatenate(mesh.triangles),
        np.concatenate(mesh.roles),
        np.concatenate(mesh.owners),
    )


def _bands(rings: np.ndarray) -> np.ndarray:
    """Triangles between consecutive rings, (..., k, n) -> (..., k - 1, n, 2, 3); outward if rings advance along d."""
    a, b = rings[..., :-1, :], rings[..., 1:, :]
    a_next, b_next = np.roll(a, -1, axis=-1), np.roll(b, -1, axis=-1)
    return np.stack([np.stack([a, a_next, b_next], axis=-1), np.stack([a, b_next, b], axis=-1)], axis=-2)


def _add_tubes(mesh: _Mesh, p: PreparedTruss, tube_ring: np.ndarray, angles: np.ndarray, area: float) -> None:
    n_m = len(p.tubes.straight)
    last = np.roll(tube_ring[1::2][:, ::-1], 1, axis=1)
    for straight in (False, True):
        members = np.flatnonzero(p.tubes.straight == straight)
        if not len(members):
            continue
        rings = [tube_ring[2 * members][:, None]]
        if not straight:
            t = np.linspace(0, 1, 2 * SECTIONS - 1)[1:-1]
            rings.append(mesh.add_points(p.tubes.surface_points(angles, t, area)[members]))
        rings.append(last[members][:, None])
        mesh.add_triangles(_bands(np.concatenate(rings, axis=1)), FaceRole.MEMBER, np.arange(n_m)[members])


def _add_fillets(mesh, p, tube_ring, around, area) -> np.ndarray:
    """Bands of the fillets; returns the rings on the spheres (those of mitred ends are not used)."""
    sphere_ring = tube_ring.copy()
    e = np.flatnonzero(p.sizes.fillet > 0)
    if not len(e):
        return sphere_ring
    r, f, H = p.sizes.end_radius[e, None], p.sizes.fillet[e, None], p.sizes.reach[e, None]
    turned = np.linspace(0, 1, FILLET_RINGS + 1)[1:] * np.arctan2(H, r + f)
    axial, radial = H - f * np.sin(turned), r + f - f * np.cos(turned)
    X, d = p.sized.truss.nodes[p.node_of_end[e]], p.directions[e]
    center = X[:, None] + axial[..., None] * d[:, None]
    rings = mesh.add_points(center[:, :, None] + area * radial[..., None, None] * around[e][:, None])
    inward = np.concatenate([tube_ring[e][:, None], rings], axis=1)
    mesh.add_triangles(_bands(inward[:, ::-1]), FaceRole.FILLET, e)
    sphere_ring[e] = rings[:, -1]
    return sphere_ring


@dataclass(frozen=True, eq=False)
class _Outline:
    """Vertices of the mitred arcs on one sphere."""

    vertices: np.ndarray
    points: np.ndarray
    arcs: np.ndarray
    area: float
    loops: int


def _add_mitre(mesh, p, i: int, tube_ring, angles, around) -> _Outline:
    """Cylinders of the mitred ends of node i; returns where they meet the sphere."""
    node, X = p.mitres[i], p.sized.truss.nodes[i]
    mitre, ends = node.mitre, node.ends
    corners = mesh.add_points(X + mitre.corners)
    used: dict[int, np.ndarray] = {}
    lines: dict[tuple, np.ndarray] = {}
    step = TURN / len(angles)
    on_sphere: dict[int, np.ndarray] = {}
    arcs: list[np.ndarray] = []
    for k, e in enumerate(ends):
        r, d, N = p.sizes.end_radius[e], p.directions[e], p.normals[e]
        B, H = np.cross(d, N), p.sizes.radius[i] * np.cos(p.caps[e])
        path_u, path_v = [], []
        for piece in mitre.pieces[k]:
            n = max(1, int(np.ceil((piece.stop - piece.start) / step - 1e-9)))
            u = piece.start + (piece.stop - piece.start) * np.arange(n) / n
            key = (min(k, piece.neighbour), max(k, piece.neighbour), *sorted((piece.first, piece.last)))
            if piece.neighbour == SPHERE:
                key = (k, SPHERE, piece.first, piece.last)
            if key not in lines:
                inner = u[1:]
                height = np.full(len(inner), H)
                if piece.neighbour != SPHERE:
                    across = d - p.directions[ends[piece.neighbour]]
                    arm = np.cos(inner)[:, None] * N + np.sin(inner)[:, None] * B
                    height = -r * (arm @ across) / (d @ across)
                arm = np.cos(inner)[:, None] * N + np.sin(inner)[:, None] * B
                points = height[:, None] * d + r * arm
                line = mesh.add_points(X + points)
                used.update(zip(line.tolist(), points, strict=True))
                lines[key] = line
                inner_line = line
            else:
                inner_line = lines[key][::-1]
            path_u.append(u)
            path_v.append(np.concatenate([[corners[piece.first]], inner_line]))
            if piece.neighbour == SPHERE:
                for c in (piece.first, piece.last):
                    on_sphere[int(corners[c])] = mitre.corners[c]
                on_sphere.update((int(v), used[int(v)]) for v in inner_line)
                chain = np.concatenate([[corners[piece.first]], inner_line, [corners[piece.last]]])
                arcs.append(np.stack([chain[:-1], chain[1:]], axis=1))
        bottom_u, bottom = np.concatenate(path_u), np.concatenate(path_v)
        mesh.add_triangles(_zip_rings(bottom_u, bottom, angles, tube_ring[e]), FaceRole.MITRE, int(e))
    vertices = np.array(list(on_sphere), int)
    points = np.array(list(on_sphere.values())).reshape(-1, 3)
    area, loops = _mitre_area(p, i)
    return _Outline(vertices, points, np.concatenate([np.zeros((0, 2), int), *arcs]), area, loops)


def _zip_rings(u_a: np.ndarray, a: np.ndarray, u_b: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Triangles between two rings that start at angle 0, given the angles of their vertices; a is the lower one."""
    triangles = []
    i = j = 0
    n_a, n_b = len(a), len(b)
    u_a, u_b = np.append(u_a, TURN), np.append(u_b, TURN)
    while i < n_a or j < n_b:
        if j == n_b or (i < n_a and u_a[i + 1] <= u_b[j + 1]):
            triangles.append((a[i % n_a], a[(i + 1) % n_a], b[j % n_b]))
            i += 1
        else:
            triangles.append((a[i % n_a], b[(j + 1) % n_b], b[j % n_b]))
            j += 1
    return np.array(triangles)


def _mitre_area(p: PreparedTruss, i: int) -> tuple[float, int]:
    """Share of the mitred caps in the Gauss-Bonnet sum of a sphere, and the Euler number of the caps' union.

    The area of the sphere outside caps of half-angles a, over R^2, is 2 pi (2 - chi) + sum cos(a) dtheta - sum tau with
    chi the Euler number of the caps' union, dtheta the arcs of the boundary and tau its turns at the corners.
    """
    node = p.mitres[i]
    total = 0.0
    starts: dict[int, np.ndarray] = {}
    stops: dict[int, np.ndarray] = {}
    following: dict[int, int] = {}
    for k, e in enumerate(node.ends):
        for piece in node.mitre.pieces[k]:
            if piece.neighbour == SPHERE:
                total += float(np.cos(p.caps[e]) * (piece.stop - piece.start))
                d = p.directions[e]
                starts[piece.first] = -np.cross(d, node.mitre.corners[piece.first])
                stops[piece.last] = -np.cross(d, node.mitre.corners[piece.last])
                following[piece.last] = piece.first
    for c, arriving in starts.items():
        # Against the direction of the arcs: along the arc that starts here, then along the one that stops here.
        leaving = stops[c]
        normal = node.mitre.corners[c] / np.linalg.norm(node.mitre.corners[c])
        total -= float(np.arctan2(np.cross(arriving, leaving) @ normal, arriving @ leaving))
    loops = 0
    while following:
        loops += 1
        c = next(iter(following))
        while c in following:
            c = following.pop(c)
    groups = np.arange(len(node.ends))
    for k, path in enumerate(node.mitre.pieces):
        for piece in path:
            if piece.neighbour != SPHERE:
                groups[groups == groups[piece.neighbour]] = groups[k]
    return total, 2 * len(np.unique(groups)) - loops


def _add_spheres(mesh: _Mesh, p: PreparedTruss, sphere_ring, around, outlines) -> None:
    node, X = p.node_of_end, p.sized.truss.nodes
    order = np.argsort(node, kind="stable")
    nodes, first = np.unique(node[order], return_index=True)
    cosine, sine = np.cos(p.caps), np.sin(p.caps)
    all_points = np.concatenate(mesh.points)
    for i, ends in zip(nodes.tolist(), np.split(order, first[1:]), strict=True):
        R = p.sizes.radius[i]
        plain = ends[~p.sizes.mitred[ends]]
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
