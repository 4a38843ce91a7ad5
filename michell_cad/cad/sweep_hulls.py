"""Nodes as convex hulls of the profiles that meet there: polyhedra, the same in the mesh and in CAD."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from michell_cad.arrays import freeze
from michell_cad.cad.sweeps import Sweep
from michell_cad.profiles import Profile
from michell_cad.truss import SizedTruss

SHARE = 0.45
"""A hull reaches no farther along a member (relative to its length)."""

GROWTH = 1.02
"""Profiles are larger by this factor in a hull, so that its faces and those of the members are not the same."""

SLIVER = 1e-4
"""A triangle is a sliver if it is less high than this (relative to its longest edge)."""

FLAT = 1e-7
"""Triangles of a hull that differ less from one plane make one face (relative to its size)."""


@dataclass(frozen=True, eq=False)
class Hull:
    """A convex polyhedron.

    Parameters
    ----------
    vertices : (n, 3) float, mm.
    faces : (k,) int each, corners of its plane faces, counter-clockwise seen from outside.
    """

    vertices: Float[np.ndarray, "n 3"]
    faces: tuple[np.ndarray, ...]

    def __post_init__(self) -> None:
        freeze(self, vertices=np.float64)


def lay_hulls(
    sweeps: Sequence[Sweep], profile: Profile, radii: Mapping[int, float], sized: SizedTruss
) -> dict[int, Hull]:
    """The hulls of the nodes: of the profiles at the node itself and its radius farther along each member."""
    polygon = GROWTH * np.asarray(profile.polygon)
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
                        places.append(v[k] + step * min(radii[node], SHARE * lengths[member]))
                F = stretch.sections(np.clip(places, v[0], v[-1]))
                ring = F[:, None, 0] + polygon[:, :1] * F[:, None, 1] + polygon[:, 1:] * F[:, None, 2]
                points[node].append(ring.reshape(-1, 3))
    return {node: hull_of(np.concatenate(some)) for node, some in points.items()}


def hull_of(points: Float[np.ndarray, "n 3"]) -> Hull:
    """The convex hull of points, with coplanar triangles united."""
    from manifold3d import Manifold

    mesh = Manifold.hull_points(points).to_mesh64()
    vertices, triangles = np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).astype(np.int64)
    group = _coplanar(vertices, triangles)
    faces: list[np.ndarray] = []
    for number in range(group.max() + 1):
        some = triangles[group == number]
        outline = _outline(some)
        faces += [outline] if outline is not None and _is_flat(vertices[outline]) else list(some)
    used = np.unique(np.concatenate(faces))
    return Hull(vertices[used], tuple(np.searchsorted(used, face) for face in faces))


def _coplanar(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Numbers of the faces that the triangles of a closed mesh make: neighbours in one plane are of one face."""
    n = len(triangles)
    edges = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
    order = np.lexsort(np.sort(edges, axis=1).T)
    one, other = (order[k::2] // 3 for k in (0, 1))
    far = triangles[other, (order[1::2] % 3 + 2) % 3]
    corners = vertices[triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(across, axis=1)
    solid = ((vertices[far] - corners[one, 0]) * across[one]).sum(1)
    # The height over the larger of the two triangles: a sliver has no plane of its own. It goes with the neighbour at
    # its longest edge alone, so that it does not make one face of two.
    height = np.abs(solid) / np.maximum(area[one], area[other])
    length = np.linalg.norm(vertices[edges[:, 1]] - vertices[edges[:, 0]], axis=1)
    longest = length.reshape(-1, 3).max(1)
    limit = FLAT * float(np.ptp(vertices, axis=0).max())
    fair = (area > SLIVER * longest**2)[:, None].repeat(3, axis=1).ravel() | (length == longest.repeat(3))
    flat = (height <= limit) & fair[order[0::2]] & fair[order[1::2]]
    graph = coo_matrix((np.ones(int(flat.sum())), (one[flat], other[flat])), shape=(n, n))
    return connected_components(graph, directed=False)[1]


def _is_flat(corners: np.ndarray) -> bool:
    """Whether a polygon is plane: neighbours in one plane may still add up to a bend."""
    middle = corners.mean(0)
    normal = np.cross(corners - middle, np.roll(corners, -1, axis=0) - middle).sum(0)
    return bool(
        np.abs((corners - middle) @ normal).max() <= FLAT * np.linalg.norm(normal) * np.ptp(corners, axis=0).max()
    )


def _outline(triangles: np.ndarray) -> np.ndarray | None:
    """The corners around triangles of one face in order; None if they are not a disc."""
    edges = {(a, b) for t in triangles.tolist() for a, b in zip(t, t[1:] + t[:1], strict=True)}
    following = dict(edge for edge in edges if edge[::-1] not in edges)
    outline = [min(following)]
    while (corner := following[outline[-1]]) != outline[0] and len(outline) <= len(following):
        outline.append(corner)
    rim = sum(edge[::-1] not in edges for edge in edges)
    return np.array(outline) if len(outline) == len(following) == rim else None
