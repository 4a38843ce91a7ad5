"""Closed meshes of swept profiles and of the bodies at their nodes, and their union by manifold3d.

A node is a sphere, or the convex hull of the profiles of its members a little way off: the same polyhedron in the mesh
and in CAD. The mesh of a sphere has the sphere's volume.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Literal

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import ConvexHull

from michell_cad.arrays import freeze
from michell_cad.cad.mesh import TrussMesh
from michell_cad.cad.shell_plan import FaceRole
from michell_cad.cad.sweeps import Stretch, Sweep
from michell_cad.errors import GeometryKernelError
from michell_cad.profiles import Profile
from michell_cad.truss import SizedTruss

if TYPE_CHECKING:
    from manifold3d import Manifold

NodeForm = Literal["sphere", "hull"]

LOSS = 4e-4
"""Part of the volume that the prisms between the rings of a mesh may lose or gain."""

MOST_RINGS = 8
"""Rings from station to station."""

BALL_SEGMENTS = 24
"""Segments around the mesh of a sphere."""

HULL_SHARE = 0.45
"""A hull reaches no farther along a member (relative to its length)."""

FLAT = 1e-7
"""Triangles of a hull whose planes differ by less make one face (relative to its size)."""


@dataclass(frozen=True, eq=False)
class Body:
    """A closed mesh.

    Parameters
    ----------
    vertices : (n, 3) float, mm.
    triangles : (t, 3) int, counter-clockwise seen from outside.
    role : of all triangles, `FaceRole.MEMBER` or `FaceRole.NODE`.
    owner : (t,) int, the member or node of each triangle.
    """

    vertices: Float[np.ndarray, "n 3"]
    triangles: Int[np.ndarray, "t 3"]
    role: FaceRole
    owner: Int[np.ndarray, " t"]

    def __post_init__(self) -> None:
        freeze(self, vertices=np.float64, triangles=np.int64, owner=np.int64)

    @cached_property
    def volume(self) -> float:
        """Enclosed volume, mm^3."""
        return TrussMesh(self.vertices, self.triangles, self.owner, self.owner).volume


@dataclass(frozen=True, eq=False)
class Hull:
    """A convex polyhedron around a node.

    Parameters
    ----------
    vertices : (n, 3) float, mm.
    faces : corners of its plane faces, counter-clockwise seen from outside.
    """

    vertices: Float[np.ndarray, "n 3"]
    faces: tuple[Int[np.ndarray, " k"], ...]

    def __post_init__(self) -> None:
        freeze(self, vertices=np.float64)


def mesh_sweep(sweep: Sweep, profile: Profile) -> Body:
    """The closed mesh of a sweep: rings of the profile's polygon, closed by two lids if the path is open."""
    frames, members = [], []
    for stretch in sweep.stretches:
        v, owner = _ring_places(stretch)
        frames.append(stretch.sections(v)[: len(owner)])
        members.append(owner)
    if not sweep.closed:
        frames.append(stretch.sections(stretch.stations[-1:]))
    F, owner = np.concatenate(frames), np.concatenate(members)
    polygon = np.asarray(profile.polygon)
    n, k = len(F), len(polygon)
    rings = F[:, None, 0] + polygon[:, :1] * F[:, None, 1] + polygon[:, 1:] * F[:, None, 2]
    number = np.arange(n * k).reshape(n, k)
    a, b = number[: len(owner)], np.roll(number, -1, axis=0)[: len(owner)]
    a_next, b_next = np.roll(a, -1, axis=1), np.roll(b, -1, axis=1)
    walls = np.stack([np.stack([a, a_next, b_next], -1), np.stack([a, b_next, b], -1)], axis=2).reshape(-1, 3)
    wall_owner = np.repeat(owner, 2 * k)
    if not sweep.closed:
        lid = _fill(polygon)
        walls = np.concatenate([walls, lid[:, ::-1], number[-1, lid]])
        wall_owner = np.concatenate([wall_owner, np.repeat(owner[[0, -1]], len(lid))])
    return Body(rings.reshape(-1, 3), walls, FaceRole.MEMBER, wall_owner)


def _ring_places(stretch: Stretch) -> tuple[np.ndarray, np.ndarray]:
    """Parameters of the rings of a stretch, and the member behind each but the last."""
    v, members = stretch.stations, stretch.members
    if stretch.degree == 1:
        # A prism has rings at the ends of its members only, so that each keeps its own triangles.
        kept = np.concatenate([[True], members[1:] != members[:-1]])
        return np.append(v[:-1][kept], v[-1]), members[kept]
    # Of the error of one prism from station to station, two prisms keep a quarter, n prisms the n-th part squared.
    halved = np.sort(np.concatenate([v, (v[1:] + v[:-1]) / 2]))
    volume = _prism_volumes(stretch.sections(halved)).reshape(-1, 2).sum(1)
    error = 4 / 3 * np.abs(volume - _prism_volumes(stretch.sections(v))).sum() / volume.sum()
    count = int(np.clip(np.ceil(np.sqrt(error / LOSS)), 1, MOST_RINGS))
    t = np.arange(count) / count
    return np.append((v[:-1, None] + t * np.diff(v)[:, None]).ravel(), v[-1]), np.repeat(members, count)


def _prism_volumes(F: np.ndarray) -> np.ndarray:
    """Volumes between consecutive sections, over the profile's area: mean vector of area times the step."""
    S = np.cross(F[:, 1], F[:, 2])
    return ((S[1:] + S[:-1]) / 2 * np.diff(F[:, 0], axis=0)).sum(1)


def _fill(polygon: np.ndarray) -> np.ndarray:
    """Triangles over the corners of a simple polygon, counter-clockwise."""
    from manifold3d import triangulate

    return np.asarray(triangulate([polygon]), np.int64)


def node_radii(sized: SizedTruss, node_ratio: float) -> dict[int, float]:
    """The radius of the sphere at each node that has members, mm."""
    thick = np.zeros(len(sized.truss.nodes))
    np.maximum.at(thick, sized.truss.members, sized.radii[:, [0, 2]])
    return {int(i): float(node_ratio * thick[i]) for i in np.flatnonzero(thick)}


def mesh_ball(center: Float[np.ndarray, " 3"], radius: float, node: int) -> Body:
    """The mesh of a sphere, of its volume."""
    from manifold3d import Manifold

    ball = Manifold.sphere(radius, BALL_SEGMENTS)
    mesh = ball.to_mesh64()
    grown = (4 / 3 * np.pi * radius**3 / ball.volume()) ** (1 / 3)
    triangles = np.asarray(mesh.tri_verts).astype(np.int64)
    vertices = center + grown * np.asarray(mesh.vert_properties)[:, :3]
    return Body(vertices, triangles, FaceRole.NODE, np.full(len(triangles), node))


def lay_hulls(
    sweeps: Sequence[Sweep], profile: Profile, radii: Mapping[int, float], sized: SizedTruss
) -> dict[int, Hull]:
    """The hulls of the nodes: of the profiles at the node itself and its radius farther along each member."""
    polygon = np.asarray(profile.polygon)
    points: dict[int, list[np.ndarray]] = {node: [] for node in radii}
    lengths = sized.truss.lengths
    for sweep in sweeps:
        for stretch in sweep.stretches:
            v, at = stretch.stations, np.flatnonzero(stretch.nodes >= 0)
            for k in at.tolist():
                node = int(stretch.nodes[k])
                places = [v[k]]
                for step, inside in ((-1, k > 0), (1, k < len(v) - 1)):
                    if inside:
                        member = stretch.members[k - (step < 0)]
                        places.append(v[k] + step * min(radii[node], HULL_SHARE * lengths[member]))
                F = stretch.sections(np.clip(places, v[0], v[-1]))
                ring = F[:, None, 0] + polygon[:, :1] * F[:, None, 1] + polygon[:, 1:] * F[:, None, 2]
                points[node].append(ring.reshape(-1, 3))
    return {node: _hull(np.concatenate(some)) for node, some in points.items()}


def _hull(points: np.ndarray) -> Hull:
    """The convex hull with its coplanar triangles united."""
    middle = points.mean(0)
    hull = ConvexHull(points - middle)
    size = float(np.ptp(points, axis=0).max())
    triangles, planes = hull.simplices.astype(np.int64), hull.equations
    corners = (points - middle)[triangles]
    outward = (np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) * planes[:, :3]).sum(1) > 0
    triangles[~outward] = triangles[~outward, ::-1]
    plane = np.full(len(planes), -1)
    for t, equation in enumerate(planes):
        if plane[t] < 0:
            alike = np.abs(planes - equation).max(1) <= FLAT * np.array([1.0, size]).max()
            plane[alike & (plane < 0)] = t
    faces = [_outline(triangles[plane == t]) for t in np.unique(plane)]
    used, number = np.unique(np.concatenate(faces), return_inverse=True)
    bounds = np.cumsum([0, *map(len, faces)])
    return Hull(points[used], tuple(number[a:b] for a, b in pairwise(bounds.tolist())))


def _outline(triangles: np.ndarray) -> np.ndarray:
    """The corners around connected triangles of one plane, in order."""
    following: dict[int, int] = {}
    edges = {(a, b) for t in triangles.tolist() for a, b in zip(t, t[1:] + t[:1], strict=True)}
    for a, b in edges:
        if (b, a) not in edges:
            following[a] = b
    start = min(following)
    outline = [start]
    while (corner := following[outline[-1]]) != start:
        outline.append(corner)
    return np.array(outline)


def mesh_hull(hull: Hull, node: int) -> Body:
    """The triangles of a hull: a fan on each face."""
    fans = [np.stack([np.full(len(f) - 2, f[0]), f[1:-1], f[2:]], axis=1) for f in hull.faces]
    triangles = np.concatenate(fans)
    return Body(hull.vertices, triangles, FaceRole.NODE, np.full(len(triangles), node))


def unite_bodies(bodies: Sequence[Body]) -> TrussMesh:
    """The union of closed meshes; every triangle keeps its owner.

    Raises
    ------
    GeometryKernelError
        If a mesh is not closed.
    """
    from manifold3d import Manifold, OpType

    first = Manifold.reserve_ids(len(bodies))
    mesh = Manifold.batch_boolean([_manifold(body, first + k) for k, body in enumerate(bodies)], OpType.Add).to_mesh64()
    run = np.repeat(np.asarray(mesh.run_original_id, np.int64) - first, np.diff(np.asarray(mesh.run_index)) // 3)
    sizes = np.array([len(body.triangles) for body in bodies])
    source = (np.cumsum(sizes) - sizes)[run] + np.asarray(mesh.face_id).astype(np.int64)
    owner = np.concatenate([body.owner for body in bodies])
    role = np.repeat([int(body.role) for body in bodies], sizes)
    return TrussMesh(
        np.asarray(mesh.vert_properties)[:, :3],
        np.asarray(mesh.tri_verts).astype(np.int64),
        role[source],
        owner[source],
    )


def _manifold(body: Body, number: int) -> "Manifold":
    from manifold3d import Error, Manifold, Mesh64

    count = len(body.triangles)
    one = Manifold(
        Mesh64(
            np.array(body.vertices),
            body.triangles.astype(np.uint64),
            run_index=np.array([0, 3 * count], np.uint64),
            run_original_id=np.array([number], np.uint32),
            face_id=np.arange(count, dtype=np.uint64),
        )
    )
    if one.status() != Error.NoError or one.is_empty():
        raise GeometryKernelError(
            f"the mesh of {'node' if body.role == FaceRole.NODE else 'a curve through member'} {int(body.owner[0])} is "
            f"not closed ({one.status()}): use a smaller radius"
        )
    return one
