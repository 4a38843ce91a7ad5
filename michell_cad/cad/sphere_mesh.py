"""Triangles of one node's sphere between the circles of its members.

The convex hull of points on a sphere is their Delaunay triangulation. All points of a circle lie in one plane with no
point beyond it, so the polygon of every cap is a facet of the hull, and dropping these leaves exactly the sphere face,
with the boundary polygons as they are.
"""

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import ConvexHull

SPACING = 0.24
"""Angle between points inside the face, radians."""

CLEARANCE = 0.6
"""Points inside the face keep this distance from the circles (relative to `SPACING`)."""

LARGEST_CORRECTION = 0.05
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
    corner: Bool[np.ndarray, " b"],
    directions: Float[np.ndarray, "k 3"],
    half_angles: Float[np.ndarray, " k"],
) -> tuple[Float[np.ndarray, "i 3"], Int[np.ndarray, "t 3"]]:
    """Inner points (unit vectors) and outward triangles; indices beyond the boundary points are inner points.

    Parameters
    ----------
    boundary : unit vectors, the points of all circles and arcs.
    corner : which of them are corners between two arcs.
    directions, half_angles : the caps.
    """
    cosine, sine = np.cos(half_angles), np.sin(half_angles)
    away = CLEARANCE * SPACING
    near = _LATTICE @ directions.T > cosine * np.cos(away) - sine * np.sin(away)
    inner = _LATTICE[~near.any(1)]
    points = np.concatenate([boundary, inner])
    hull = ConvexHull(points)
    triangles = hull.simplices
    a, b, c = points[triangles].transpose(1, 0, 2)
    inward = np.einsum("td,td->t", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    triangles[inward] = triangles[inward][:, ::-1]
    inside = points @ directions.T >= cosine - ON_CAP
    covered = inside[triangles].all(1).any(1)
    is_corner = np.concatenate([corner, np.zeros(len(inner), bool)])
    between = is_corner[triangles].all(1) & ~covered
    if between.any():
        middle = points[triangles[between]].sum(1)
        middle /= np.linalg.norm(middle, axis=1, keepdims=True)
        covered[between] = (middle @ directions.T > cosine).any(1)
    return inner, triangles[~covered].astype(np.int64)


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
