"""Surface isocurves {phi_i = a} on the boundary triangles, between the sharp features of the part.

A generic lattice plane crosses none or two edges of a boundary triangle, and the segment between them meets the lattice
lines {phi_i = a, phi_j = b} exactly where these cross the triangle: at the ends of the interior curves. How many nodes
come before each is known exactly from the floors of the other two coordinates at the start and at the node, so that the
nodes of a segment are ranked without comparing distances.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Int

from michell_cad.compiled import compiled
from michell_cad.isocurves.interior import Segments
from michell_cad.isocurves.lattice import PAIRS, EdgeCrossings, FaceCrossings, GridLevels
from michell_cad.tet_mesh import TetMesh

_EDGES = np.array([[0, 1], [0, 2], [1, 2]])
"""Edges of a triangle whose vertices ascend."""


@dataclass(frozen=True, eq=False)
class SurfaceSegments:
    """Segments of the surface isocurves.

    Parameters
    ----------
    segments : chain vertices are ``vertex_crossings`` entries.
    triangle, axis, value : (m,) int, the boundary triangle of each segment and its {phi_axis = value}.
    vertex_crossings : (n,) int, edge crossing at each chain vertex. At a sharp edge every segment end is a vertex of
        its own, so that chains end there.
    """

    segments: Segments
    triangle: Int[np.ndarray, " m"]
    axis: Int[np.ndarray, " m"]
    value: Int[np.ndarray, " m"]
    vertex_crossings: Int[np.ndarray, " n"]


def trace_surface(
    mesh: TetMesh,
    grid: GridLevels,
    faces: FaceCrossings,
    edges: EdgeCrossings,
    sharp: Bool[np.ndarray, " n_be"],
    boundary_nodes: Int[np.ndarray, " n_c"],
) -> SurfaceSegments:
    """Find the segments of the surface isocurves and the boundary nodes on them.

    Parameters
    ----------
    faces : crossings with the faces of the mesh; `boundary_nodes` gives the node at each, -1 for inner faces.
    edges : crossings with the boundary edges of the mesh, of which `sharp` are features.
    """
    corners = mesh.faces[mesh.boundary_faces]
    floors = grid.floors[corners]
    low = floors.min(1)
    counts = floors.max(1) - low
    n = int(counts.sum())
    first_segment = (np.cumsum(counts.ravel()) - counts.ravel()).reshape(-1, 3)
    triangle, axis, value = np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n, np.int64)
    edge, ends = np.empty((n, 2), np.int64), np.empty((n, 2), np.int64)
    triangle_edges = find_edges(mesh, corners[:, _EDGES])
    cut_triangles(floors, triangle_edges, edges.first, triangle, axis, value, edge, ends)
    offsets, nodes = _place_nodes(mesh, faces, edges, boundary_nodes, ends, axis, value, first_segment, low)
    # Chain vertices: crossings with smooth edges, and then every end at a sharp edge.
    smooth, vertex = np.unique(ends[~sharp[edge]], return_inverse=True)
    chain_ends = np.empty_like(ends)
    chain_ends[~sharp[edge]] = vertex
    chain_ends[sharp[edge]] = len(smooth) + np.arange(np.count_nonzero(sharp[edge]))
    vertex_crossings = np.concatenate([smooth, ends[sharp[edge]]])
    return SurfaceSegments(Segments(chain_ends, offsets, nodes), triangle, axis, value, vertex_crossings)


def _place_nodes(
    mesh: TetMesh,
    faces: FaceCrossings,
    edges: EdgeCrossings,
    boundary_nodes: np.ndarray,
    ends: np.ndarray,
    axis: np.ndarray,
    value: np.ndarray,
    first_segment: np.ndarray,
    low: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes of each segment, in order from its first end (as offsets and node numbers)."""
    start, finish = edges.floors[ends[:, 0]], edges.floors[ends[:, 1]]
    others = np.arange(3) != axis[:, None]
    offsets = np.concatenate([[0], np.cumsum((np.abs(finish - start) * others).sum(1))])
    nodes = np.full(offsets[-1], -1)
    outer = np.flatnonzero(boundary_nodes >= 0)
    triangle = np.searchsorted(mesh.boundary_faces, faces.face[outer])
    for pair, (i, j) in enumerate(PAIRS):
        mine = faces.pair[outer] == pair
        crossing, tri, k = outer[mine], triangle[mine], 2 - pair
        for along, across, line, other in ((i, j, faces.a, faces.b), (j, i, faces.b, faces.a)):
            # On the segment {phi_along = line}, the node is the crossing with {phi_across = other}.
            segment = first_segment[tri, along] + line[crossing] - 1 - low[tri, along]
            begin = start[segment, across]
            before = np.where(other[crossing] > begin, other[crossing] - begin - 1, begin - other[crossing])
            rank = before + np.abs(faces.floor[crossing] - start[segment, k])
            nodes[offsets[segment] + rank] = boundary_nodes[crossing]
    assert (nodes >= 0).all(), "a surface curve misses the end of an interior curve"
    return offsets, nodes


def _cut_triangles(
    floors: Any, triangle_edges: Any, first: Any, triangle: Any, axis: Any, value: Any, edge: Any, ends: Any
) -> None:
    """Fill, for all segments by triangle, axis and value, these three and the two crossed edges and crossings there.

    An edge is crossed when its ends lie on different sides of the plane. Its crossings with a coordinate have
    consecutive numbers from `first` on.
    """
    n = 0
    for t in range(len(floors)):
        for k in range(3):
            x, y, z = floors[t, 0, k], floors[t, 1, k], floors[t, 2, k]
            for v in range(min(x, y, z) + 1, max(x, y, z) + 1):
                triangle[n], axis[n], value[n] = t, k, v
                side = 0
                for e in range(3):
                    u, w = floors[t, _EDGES[e, 0], k], floors[t, _EDGES[e, 1], k]
                    if (u >= v) != (w >= v):
                        edge[n, side] = triangle_edges[t, e]
                        ends[n, side] = first[triangle_edges[t, e], k] + v - 1 - min(u, w)
                        side += 1
                n += 1


cut_triangles = compiled(_cut_triangles)


def find_edges(mesh: TetMesh, pairs: Int[np.ndarray, "... 2"]) -> Int[np.ndarray, "..."]:
    """Numbers of the boundary edges with the given (ascending) vertices."""
    n = len(mesh.vertices)
    keys = mesh.boundary_edges[:, 0] * n + mesh.boundary_edges[:, 1]
    return np.searchsorted(keys, pairs[..., 0] * n + pairs[..., 1])
