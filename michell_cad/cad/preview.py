"""A mesh to look at while a knob is turned: tubes or swept profiles, and the nodes, laid over each other.

It is not the solid: nothing is prepared, filleted or united, so that it takes milliseconds; see `mesh_truss` for that.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from michell_cad.arrays import freeze, require
from michell_cad.cad.sweep_hulls import GROWTH, SHARE
from michell_cad.cad.sweep_mesh import node_radii
from michell_cad.cad.sweep_paths import Paths, lay_paths
from michell_cad.cad.sweeps import lay_sections
from michell_cad.knobs import Knobs
from michell_cad.splines import fit_splines
from michell_cad.truss import SizedTruss, member_radius

RINGS = 5
"""Rings of points along a member."""

SIDES = 8

MOST_SIDES = 24
"""Of the profile of swept members."""

_GOLDEN = (1 + 5**0.5) / 2
_BALL = np.array([(x, y * _GOLDEN, 0) for x in (-1, 1) for y in (-1, 1)], float)
_BALL = np.concatenate([np.roll(_BALL, turn, axis=1) for turn in range(3)]) / np.sqrt(1 + _GOLDEN**2)
"""Corners of an icosahedron on the unit sphere."""


def _ball_triangles() -> np.ndarray:
    """Triangles of the icosahedron, outward: every three corners that are all neighbours."""
    near = np.linalg.norm(_BALL[:, None] - _BALL, axis=2) < 1.1
    n = len(_BALL)
    found = [
        (i, j, k) if np.linalg.det(_BALL[[i, j, k]]) > 0 else (i, k, j)
        for i in range(n)
        for j in range(i + 1, n)
        for k in range(j + 1, n)
        if near[i, j] and near[j, k] and near[i, k]
    ]
    return np.array(found)


_BALL_TRIANGLES = _ball_triangles()


@dataclass(frozen=True, eq=False)
class PreviewMesh:
    """Triangles to draw.

    Parameters
    ----------
    vertices : (n, 3) float, mm.
    triangles : (t, 3) int, counter-clockwise seen from outside.
    curve : (t,) int, the curve that each triangle belongs to; -1 at nodes.
    """

    vertices: Float[np.ndarray, "n 3"]
    triangles: Int[np.ndarray, "t 3"]
    curve: Int[np.ndarray, " t"]

    def __post_init__(self) -> None:
        freeze(self, vertices=np.float64, triangles=np.int64, curve=np.int64)


def preview_truss(sized: SizedTruss, knobs: Knobs, sides: int = SIDES) -> PreviewMesh:
    """A mesh of a sized truss to look at.

    Parameters
    ----------
    sized : SizedTruss
    knobs : its profile and its nodes are used.
    sides : of round members.
    """
    require(sides >= 3, f"a tube needs at least 3 sides, found {sides}")
    if knobs.swept:
        walls, nodes = _swept(sized, knobs)
    else:
        walls, nodes = _round_tubes(sized, sides), _balls(sized, knobs)
    (vertices, triangles, curve), (more_vertices, more_triangles) = walls, nodes
    return PreviewMesh(
        np.concatenate([vertices, more_vertices]),
        np.concatenate([triangles, len(vertices) + more_triangles]),
        np.concatenate([curve, np.full(len(more_triangles), -1)]),
    )


def _round_tubes(sized: SizedTruss, sides: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, triangles, and the curves of these, of a tube around each member."""
    truss = sized.truss
    splines, s = fit_splines(truss), np.linspace(0, 1, RINGS)
    d = splines.tangents(s)
    # One direction for all rings of a member, the axis farthest from its chord: the tube hardly twists.
    chord = np.abs(truss.nodes[truss.members[:, 1]] - truss.nodes[truss.members[:, 0]])
    away = np.eye(3)[chord.argmin(1)][:, None]
    x = away - (away * d).sum(-1, keepdims=True) * d
    x = x / np.linalg.norm(x, axis=-1, keepdims=True)
    angle = np.arange(sides) * 2 * np.pi / sides
    around = np.cos(angle)[:, None] * x[:, :, None] + np.sin(angle)[:, None] * np.cross(d, x)[:, :, None]
    r = member_radius(sized.radii[:, None], s)
    rings = splines.positions(s)[:, :, None] + r[..., None, None] * around
    number = np.arange(len(truss.members) * RINGS).reshape(-1, RINGS)
    first, curve = number[:, :-1].ravel(), np.repeat(truss.curve_of_member, RINGS - 1)
    return _walls(rings.reshape(-1, sides, 3), first, first + 1, curve)


def _walls(
    rings: np.ndarray, first: np.ndarray, second: np.ndarray, curve: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Walls between pairs of rings (n, k, 3), each of a curve."""
    sides = rings.shape[1]
    number = np.arange(rings.shape[0] * sides).reshape(-1, sides)
    a, b = number[first], number[second]
    a_next, b_next = np.roll(a, -1, axis=1), np.roll(b, -1, axis=1)
    triangles = np.stack([np.stack([a, a_next, b_next], -1), np.stack([a, b_next, b], -1)], axis=2)
    return rings.reshape(-1, 3), triangles.reshape(-1, 3), np.repeat(curve, 2 * sides)


def _balls(sized: SizedTruss, knobs: Knobs) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of a ball at each node."""
    radii = node_radii(sized, knobs.node_ratio)
    centers, r = sized.truss.nodes[list(radii)], np.array(list(radii.values()))
    balls = centers[:, None] + r[:, None, None] * _BALL
    triangles = len(_BALL) * np.arange(len(r))[:, None, None] + _BALL_TRIANGLES
    return balls.reshape(-1, 3), triangles.reshape(-1, 3)


def _swept(
    sized: SizedTruss, knobs: Knobs
) -> tuple[tuple[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """Walls along the paths of the profile, and what is at the nodes."""
    polygon = np.asarray(knobs.shape.polygon)
    polygon = polygon[:: -(-len(polygon) // MOST_SIDES)]
    paths = lay_paths(sized, knobs.shape.reach)
    sections = lay_sections(paths, sized.truss)
    following = np.arange(1, len(sections) + 1)
    following[paths.offsets[1:] - 1] = np.where(paths.closed, paths.offsets[:-1], -1)
    first = np.flatnonzero(following >= 0)
    walls = _walls(_place(polygon, sections), first, following[first], paths.curves[paths.path[first]])
    return walls, _hulls(sized, knobs, paths, sections) if knobs.node_form == "hull" else _balls(sized, knobs)


def _place(polygon: np.ndarray, sections: np.ndarray) -> np.ndarray:
    """Points of a polygon (k, 2) in sections (n, 3, 3): X + x A + y B."""
    X, A, B = (sections[:, None, k] for k in range(3))
    return X + polygon[:, :1] * A + polygon[:, 1:] * B


def _hulls(sized: SizedTruss, knobs: Knobs, paths: Paths, sections: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of the hulls of the profiles at each node and a little way off, as in `sweep_hulls`."""
    from manifold3d import Manifold

    truss, radii = sized.truss, node_radii(sized, knobs.node_ratio)
    shortest = np.full(len(truss.nodes), np.inf)
    np.minimum.at(shortest, truss.members, truss.lengths[:, None])
    at = np.flatnonzero(paths.nodes >= 0)
    node = paths.nodes[at]
    way = np.minimum([radii[n] for n in node.tolist()], SHARE * shortest[node])[:, None]
    is_open = ~paths.closed[paths.path[at]]
    back = np.where(is_open & np.isin(at, paths.offsets[:-1]), 0, 1)[:, None] * way * paths.arriving[at]
    ahead = np.where(is_open & np.isin(at, paths.offsets[1:] - 1), 0, 1)[:, None] * way * paths.leaving[at]
    rings = _place(GROWTH * np.asarray(knobs.shape.polygon), sections[at])
    around = np.concatenate([rings, rings - back[:, None], rings + ahead[:, None]], axis=1)
    order = np.argsort(node, kind="stable")
    bounds = np.flatnonzero(np.diff(node[order])) + 1
    groups: list[np.ndarray] = [group.reshape(-1, 3) for group in np.split(around[order], bounds)]
    meshes = [Manifold.hull_points(group).to_mesh64() for group in groups]
    vertices = [np.asarray(mesh.vert_properties)[:, :3] for mesh in meshes]
    starts = np.cumsum([0, *(len(some) for some in vertices)])[:-1]
    triangles = [np.asarray(m.tri_verts).astype(np.int64) + k for m, k in zip(meshes, starts, strict=True)]
    return np.concatenate(vertices), np.concatenate(triangles)
