"""Triangles of one node's sphere between the circles of its members.

The convex hull of points on a sphere is their Delaunay triangulation. All points of a circle lie in one plane with no
point beyond it, so the polygon of every cap is a facet of the hull, and dropping these leaves exactly the sphere face,
with the boundary polygons as they are.
"""

from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import ConvexHull

from michell_cad.cad.vectors import dot, triple
from michell_cad.compiled import compiled

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
    neighbours = hull.neighbors.astype(np.int64)
    turn_outward(points, triangles, neighbours, hull.equations)
    if arcs is None:
        return inner, triangles[outside_caps(points, triangles, directions, cosine)]
    along = np.sort(arcs[:, 0] * len(points) + arcs[:, 1])
    return inner, triangles[outside_loops(triangles, neighbours, along, len(points))]


def _turn_outward(points: Any, triangles: Any, neighbours: Any, normals: Any) -> None:
    """Turn the triangles of a hull so that their vertices count counter-clockwise around the outward normals.

    neighbours (t, 3) are across from the three vertices.
    """
    first, second = np.empty(3), np.empty(3)
    for t in range(len(triangles)):
        a, b, c = triangles[t]
        for i in range(3):
            first[i], second[i] = points[b, i] - points[a, i], points[c, i] - points[a, i]
        if triple(first, second, normals[t]) < 0:
            triangles[t, 0], triangles[t, 2] = triangles[t, 2], triangles[t, 0]
            neighbours[t, 0], neighbours[t, 2] = neighbours[t, 2], neighbours[t, 0]


def _outside_caps(points: Any, triangles: Any, directions: Any, cosine: Any) -> Any:
    """Triangles (as a mask) of which no cap has all three vertices."""
    kept = np.ones(len(triangles), np.bool_)
    inside = np.empty(len(points), np.bool_)
    for k in range(len(directions)):
        for i in range(len(points)):
            inside[i] = dot(points[i], directions[k]) >= cosine[k] - ON_CAP
        for t in range(len(triangles)):
            kept[t] &= not (inside[triangles[t, 0]] and inside[triangles[t, 1]] and inside[triangles[t, 2]])
    return kept


def _outside_loops(triangles: Any, neighbours: Any, along: Any, n: int) -> Any:
    """Triangles (as a mask) on the right of loops: the parts into which these cut the hull that have one along a loop.

    `along` has start * n + end of every step along the loops, ascending.
    """
    kept, blocked = np.zeros(len(triangles), np.bool_), np.zeros((len(triangles), 3), np.bool_)
    stack, count = np.empty(len(triangles), np.int64), 0
    for t in range(len(triangles)):
        for side in range(3):
            a, b = triangles[t, (side + 1) % 3], triangles[t, (side + 2) % 3]
            forward, backward = np.searchsorted(along, a * n + b), np.searchsorted(along, b * n + a)
            on_right = backward < len(along) and along[backward] == b * n + a
            blocked[t, side] = on_right or (forward < len(along) and along[forward] == a * n + b)
            if on_right and not kept[t]:
                kept[t], stack[count] = True, t
                count += 1
    while count:
        count -= 1
        t = stack[count]
        for side in range(3):
            other = neighbours[t, side]
            if not blocked[t, side] and not kept[other]:
                kept[other], stack[count] = True, other
                count += 1
    return kept


def match_volume(
    points: Float[np.ndarray, "p 3"], triangles: Int[np.ndarray, "t 3"], is_inner: Bool[np.ndarray, " p"], volume: float
) -> float:
    """Factor on the inner points (relative to the centre) at which the triangles and the centre enclose `volume`."""
    share = shares_of_volume(points, triangles, is_inner)
    factor = 1.0
    for _ in range(4):
        powers = factor ** np.arange(4)
        slope = share[1] + 2 * share[2] * factor + 3 * share[3] * factor**2
        if slope <= 0:
            return 1.0
        factor -= (share @ powers - volume) / slope
    return float(np.clip(factor, 1 - LARGEST_CORRECTION, 1 + LARGEST_CORRECTION))


def _shares_of_volume(points: Any, triangles: Any, is_inner: Any) -> Any:
    """Volume between the origin and the triangles with 0, 1, 2 and 3 inner points."""
    share = np.zeros(4)
    for a, b, c in triangles:
        share[int(is_inner[a]) + int(is_inner[b]) + int(is_inner[c])] += triple(points[b], points[c], points[a]) / 6
    return share


turn_outward = compiled(_turn_outward)
outside_caps = compiled(_outside_caps)
outside_loops = compiled(_outside_loops)
shares_of_volume = compiled(_shares_of_volume)
