"""Triangles of one node's sphere between the circles of its members.

The convex hull of points on a sphere is their Delaunay triangulation. All points of a circle lie in one plane with no
point beyond it, so the polygon of every cap is a facet of the hull, and dropping these leaves exactly the sphere face,
with the boundary polygons as they are.
"""

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull

SPACING = 0.28
"""Angle between points inside the face, radians."""

CLEARANCE = 0.6
"""Points inside the face keep this distance from the circles (relative to `SPACING`)."""

LARGEST_CORRECTION = 0.08
"""Inner points move outward by at most this fraction of R to give the polyhedron the sphere's volume."""

ON_CAP = 1e-9
"""Cosine by which a point may miss the circle it lies on (rounding)."""

GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))


def lattice_points() -> Float[np.ndarray, "k 3"]:
    """Nearly even points on the unit sphere (Fibonacci lattice)."""
    n = int(4 * np.pi / (SPACING**2 * np.sqrt(3) / 2))
    i = np.arange(n) + 0.5
    z = 1 - 2 * i / n
    rho = np.sqrt(1 - z**2)
    return np.stack([rho * np.cos(GOLDEN_ANGLE * i), rho * np.sin(GOLDEN_ANGLE * i), z], axis=1)


_LATTICE = lattice_points()


def triangulate_sphere(
    boundary: Float[np.ndarray, "b 3"],
    directions: Float[np.ndarray, "k 3"],
    half_angles: Float[np.ndarray, " k"],
    arcs: Int[np.ndarray, "s 2"] | None = None,
) -> tuple[Float[np.ndarray, "i 3"], Int[np.ndarray, "t 3"]]:
    """Inner points (unit vectors) and outward triangles; indices beyond the boundary points are inner points.

    Parameters
    ----------
    boundary : unit vectors, the points of all circles and arcs.
    directions, half_angles : the caps.
    arcs : if caps overlap, all steps from point to point along the boundary, counter-clockwise around the caps.
    """
    cosine, sine = np.cos(half_angles), np.sin(half_angles)
    away = CLEARANCE * SPACING
    near = _LATTICE @ directions.T > cosine * np.cos(away) - sine * np.sin(away)
    inner = _LATTICE[~np.any(near, axis=1)]
    points = np.concatenate([boundary, inner])
    hull = ConvexHull(points)
    triangles = hull.simplices.astype(np.int64)
    a, b, c = points[triangles].transpose(1, 0, 2)
    inward = np.einsum("td,td->t", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    if arcs is None:
        inside = points @ directions.T >= cosine - ON_CAP
        kept = ~np.any(np.all(inside[triangles], axis=1), axis=1)
    else:
        kept = _outside_loops(triangles, hull.neighbors, inward, arcs, len(points))
    triangles[inward] = triangles[inward][:, ::-1]
    return inner, triangles[kept]


def _outside_loops(
    triangles: np.ndarray, neighbours: np.ndarray, inward: np.ndarray, arcs: np.ndarray, n: int
) -> np.ndarray:
    """Triangles on the right of the loops: the parts into which the loops cut the hull that have one along a loop."""
    opposite = triangles[:, [[1, 2], [2, 0], [0, 1]]]
    forward = np.where(inward[:, None, None], opposite[..., ::-1], opposite)
    code = forward[..., 0] * n + forward[..., 1]
    along, against = arcs[:, 0] * n + arcs[:, 1], arcs[:, 1] * n + arcs[:, 0]
    on_right = np.isin(code, against)
    free = ~(on_right | np.isin(code, along))
    t, side = np.nonzero(free)
    size = (len(triangles), len(triangles))
    _, part = connected_components(coo_matrix((np.ones(len(t)), (t, neighbours[t, side])), shape=size), directed=False)
    return np.isin(part, part[on_right.any(1)])


def match_volume(
    points: Float[np.ndarray, "p 3"], triangles: Int[np.ndarray, "t 3"], is_inner: Bool[np.ndarray, " p"], volume: float
) -> float:
    """Factor on the inner points (relative to the centre) at which the triangles and the centre enclose `volume`."""
    six = np.einsum("td,td->t", *_cross_pair(points, triangles))
    count = is_inner[triangles].sum(1)
    share = np.array([six[count == j].sum() for j in range(4)]) / 6
    factor = 1.0
    for _ in range(4):
        powers = factor ** np.arange(4)
        slope = share[1] + 2 * share[2] * factor + 3 * share[3] * factor**2
        if slope <= 0:
            return 1.0
        factor -= (share @ powers - volume) / slope
    return float(np.clip(factor, 1 - LARGEST_CORRECTION, 1 + LARGEST_CORRECTION))


def _cross_pair(points: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    a, b, c = points[triangles].transpose(1, 0, 2)
    return a, np.cross(b, c)
