"""Members that stay in the part: where a spline leaves it, the nearest points of the surface lead it back.

Cleaning moves nodes along the surface, and a chord over a hollow (a fillet, a hole) then runs outside.
"""

from dataclasses import replace

import igl
import numpy as np

from michell_cad.splines import fit_splines
from michell_cad.tet_mesh import TetMesh
from michell_cad.truss.values import Truss

OUTSIDE = 0.03
"""A member is led back where it is farther outside than this (relative to the spacing): well below its radius."""

_PLACES = np.array([0.25, 0.5, 0.75])
"""Where along a member it is looked at, and led."""


def keep_inside(truss: Truss, mesh: TetMesh) -> Truss:
    """Give members that leave the part waypoints: their quarter points, those outside moved to the surface.

    Members that have waypoints already stay as they are.
    """
    points = fit_splines(truss).positions(_PLACES)
    found = igl.signed_distance(points.reshape(-1, 3), mesh.vertices, mesh.boundary_triangles)
    distance, nearest = np.asarray(found[0]), np.asarray(found[2])
    out = distance.reshape(-1, len(_PLACES)) > OUTSIDE * truss.spacing
    waypoints, offsets = np.asarray(truss.waypoints), np.asarray(truss.waypoint_offsets)
    counts = np.diff(offsets)
    led = out.any(1) & (counts == 0)
    points = np.where(out[:, :, None], nearest.reshape(points.shape), points)
    parts = [points[m] if led[m] else waypoints[offsets[m] : offsets[m + 1]] for m in range(len(led))]
    counts = np.where(led, len(_PLACES), counts)
    return replace(truss, waypoints=np.concatenate(parts), waypoint_offsets=np.concatenate([[0], np.cumsum(counts)]))
