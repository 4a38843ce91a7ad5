"""Closed meshes of swept profiles and of the bodies at their nodes, and their union by manifold3d.

A node is a sphere, or the convex hull of the profiles of its members a little way off: the same polyhedron in the mesh
and in CAD. The mesh of a sphere has the sphere's volume.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, Int

from michell_cad.arrays import freeze
from michell_cad.cad.mesh import TrussMesh
from michell_cad.cad.shell_plan import FaceRole
from michell_cad.cad.sweep_hulls import Hull
from michell_cad.cad.sweeps import Stretch, Sweep
from michell_cad.errors import GeometryKernelError
from michell_cad.profiles import Profile
from michell_cad.truss import SizedTruss

if TYPE_CHECKING:
    from manifold3d import Manifold

LOSS = 4e-4
"""Part of the volume that the prisms between the rings of a mesh may lose or gain."""

MOST_RINGS = 8
"""Rings from station to station."""

BALL_SEGMENTS = 24
"""Segments around the mesh of a sphere."""


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
    vertices, triangles, kept = _weld(np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts, np.int64))
    return TrussMesh(vertices, triangles, role[source[kept]], owner[source[kept]])


def _weld(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices that an STL file cannot tell apart made one; the triangles that are left, and their old numbers.

    Where faces nearly coincide, the union has slivers between such vertices. They vanish: triangles with two corners in
    one place, and pairs of triangles with the same corners, which face each other.
    """
    _, first, number = np.unique(vertices.astype(np.float32), axis=0, return_index=True, return_inverse=True)
    T = number.reshape(-1)[triangles]
    kept = np.flatnonzero((T != np.roll(T, 1, axis=1)).all(1))
    _, group, count = np.unique(np.sort(T[kept], axis=1), axis=0, return_inverse=True, return_counts=True)
    kept = kept[count[group.reshape(-1)] == 1]
    return vertices[first], T[kept], kept


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
