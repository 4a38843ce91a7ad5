"""Members that stay in the part: where a spline leaves it, the nearest points of the surface lead it back.

Cleaning moves nodes along the surface, and a chord over a hollow (a fillet, a hole) then runs outside.
"""

import igl
import numpy as np

from michell_cad.splines import bezier, fit_splines
from michell_cad.tet_mesh import TetMesh
from michell_cad.truss.values import Truss
from michell_cad.truss.waypoints import add_waypoints

OUTSIDE = 0.03
"""A member is led back where it is farther outside than this (relative to the spacing): well below its radius."""

_PLACES = np.array([0.25, 0.5, 0.75])
"""Where along a member it is looked at, and led: parameters of its only piece, which has no waypoints."""

_SUSPECT = 0.03
"""A member is looked at more closely where its middle is outside by this fraction of `OUTSIDE`; most are not, and the
distances are what this stage costs."""


def keep_inside(truss: Truss, mesh: TetMesh) -> Truss:
    """Give members that leave the part waypoints: their quarter points, those outside moved to the surface.

    Members that have waypoints already stay as they are.
    """
    bare = np.flatnonzero(np.diff(np.asarray(truss.waypoint_offsets)) == 0)
    splines = fit_splines(truss)
    points = bezier(splines.control_points[splines.offsets[bare]][:, None], _PLACES)
    distance, _ = _signed_distance(mesh, points[:, 1])
    suspect = distance > _SUSPECT * OUTSIDE * truss.spacing
    bare, points = bare[suspect], points[suspect]
    distance, nearest = _signed_distance(mesh, points.reshape(-1, 3))
    out = distance.reshape(-1, len(_PLACES)) > OUTSIDE * truss.spacing
    points = np.where(out[:, :, None], nearest.reshape(points.shape), points)
    led = out.any(1)
    return add_waypoints(truss, bare[led], points[led], np.ones((int(led.sum()), len(_PLACES)), bool))


def _signed_distance(mesh: TetMesh, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distances to the surface, mm, positive outside, and the nearest points of the surface."""
    if not len(points):
        return np.zeros(0), np.zeros((0, 3))
    found = igl.signed_distance(points, mesh.vertices, mesh.boundary_triangles)
    return np.asarray(found[0]), np.asarray(found[2])
