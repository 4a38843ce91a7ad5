"""Sharp-feature curves: the feature edges of the part, chained between corners, with a node at every surface curve."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

from michell_cad.isocurves.edge_crossings import EdgeCrossings
from michell_cad.isocurves.interior import Segments
from michell_cad.tet_mesh import TetMesh


@dataclass(frozen=True, eq=False)
class FeatureSegments:
    """Feature edges as segments of feature curves.

    Parameters
    ----------
    segments : one for each feature edge.
    vertices : (n,) int, mesh vertex of each chain vertex. A corner is a chain vertex of its own for every edge there.
    corners : (n_c,) int, mesh vertices that are corners, ascending.
    """

    segments: Segments
    vertices: Int[np.ndarray, " n"]
    corners: Int[np.ndarray, " n_c"]


def trace_features(
    mesh: TetMesh,
    edges: EdgeCrossings,
    sharp: Int[np.ndarray, " n_fe"],
    feature_nodes: Int[np.ndarray, " n_x"],
    corner_angle: float,
) -> FeatureSegments:
    """Split the feature graph at its corners and put the nodes on its edges.

    Parameters
    ----------
    edges : crossings of the boundary edges; `feature_nodes` gives the node at each, -1 where the edge is not sharp.
    sharp : numbers of the boundary edges that are features.
    corner_angle : radians; a chain that turns by more has a corner there.
    """
    ends = mesh.boundary_edges[sharp]
    corners = _find_corners(mesh, ends, corner_angle)
    is_corner = np.isin(ends, corners)
    smooth, vertex = np.unique(ends[~is_corner], return_inverse=True)
    chain_ends = np.empty_like(ends)
    chain_ends[~is_corner] = vertex
    chain_ends[is_corner] = len(smooth) + np.arange(np.count_nonzero(is_corner))
    crossing = np.flatnonzero(feature_nodes >= 0)
    segment = np.searchsorted(sharp, edges.edge[crossing])
    order = np.lexsort((edges.tie[crossing], edges.fraction[crossing], segment))
    offsets = np.concatenate([[0], np.cumsum(np.bincount(segment, minlength=len(sharp)))])
    segments = Segments(chain_ends, offsets, feature_nodes[crossing[order]])
    return FeatureSegments(segments, np.concatenate([smooth, ends[is_corner]]), corners)


def _find_corners(mesh: TetMesh, ends: np.ndarray, corner_angle: float) -> np.ndarray:
    """Vertices where other than two feature edges meet, or two that enclose a sharp bend."""
    degree = np.bincount(ends.ravel(), minlength=len(mesh.vertices))
    along = mesh.vertices[ends[:, 1]] - mesh.vertices[ends[:, 0]]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    # Of two unit vectors leaving a vertex, |sum|^2 = 2 + 2 cos(angle between) and the turn is pi - that angle.
    leaving = np.zeros_like(mesh.vertices)
    np.add.at(leaving, ends[:, 0], along)
    np.add.at(leaving, ends[:, 1], -along)
    turn_cosine = 1 - np.einsum("vd,vd->v", leaving, leaving) / 2
    bent = (degree == 2) & (turn_cosine < np.cos(corner_angle))
    return np.flatnonzero(((degree > 0) & (degree != 2)) | bent)
