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
from michell_cad.isocurves.edge_crossings import EdgeCrossings
from michell_cad.isocurves.interior import Segments
from michell_cad.isocurves.lattice import PAIRS, FaceCrossings, GridLevels
from michell_cad.tet_mesh import TetMesh


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
    floors = grid.floors[mesh.boundary_triangles]
    low = np.minimum(np.minimum(floors[:, 0], floors[:, 1]), floors[:, 2])
    counts = np.maximum(np.maximum(floors[:, 0], floors[:, 1]), floors[:, 2]) - low
    n = int(counts.sum())
    first_segment = (np.cumsum(counts.ravel()) - counts.ravel()).reshape(-1, 3)
    triangle, axis, value = np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n, np.int64)
    edge, ends, offsets = np.empty((n, 2), np.int64), np.empty((n, 2), np.int64), np.zeros(n + 1, np.int64)
    triangle_edges = mesh.boundary_triangle_edges
    cut_triangles(floors, triangle_edges, edges.first, edges.floors, triangle, axis, value, edge, ends, offsets)
    nodes = np.full(offsets[-1], -1)
    face = (faces.offsets, faces.pair, faces.a, faces.b, faces.floor)
    rank_nodes(mesh.boundary_faces, *face, boundary_nodes, ends, edges.floors, offsets, first_segment, low, nodes)
    assert (nodes >= 0).all(), "a surface curve misses the end of an interior curve"
    # Chain vertices: crossings with smooth edges, which join two segments, and then every end at a sharp edge.
    is_smooth, at_sharp = ~sharp[edges.edge], sharp[edge]
    smooth = np.flatnonzero(is_smooth)
    chain_ends = (np.cumsum(is_smooth) - 1)[ends]
    chain_ends[at_sharp] = len(smooth) + np.arange(np.count_nonzero(at_sharp))
    vertex_crossings = np.concatenate([smooth, ends[at_sharp]])
    return SurfaceSegments(Segments(chain_ends, offsets, nodes), triangle, axis, value, vertex_crossings)


def _cut_triangles(
    floors: Any,
    triangle_edges: Any,
    first: Any,
    crossing_floors: Any,
    triangle: Any,
    axis: Any,
    value: Any,
    edge: Any,
    ends: Any,
    offsets: Any,
) -> None:
    """Fill, for all segments by triangle, axis and value, these three, the two crossed edges and the crossings there.

    An edge is crossed when its ends lie on different sides of the plane. Its crossings with a coordinate have
    consecutive numbers from `first` on. A segment has as many nodes as integers lie between its ends in the other two
    coordinates; `offsets` gets their running sum.
    """
    n = 0
    for t in range(len(floors)):
        for k in range(3):
            x, y, z = floors[t, 0, k], floors[t, 1, k], floors[t, 2, k]
            for v in range(min(x, y, z) + 1, max(x, y, z) + 1):
                triangle[n], axis[n], value[n] = t, k, v
                side = 0
                for e in range(3):
                    u, w = floors[t, e, k], floors[t, (e + 1) % 3, k]
                    if (u >= v) != (w >= v):
                        edge[n, side] = triangle_edges[t, e]
                        ends[n, side] = first[triangle_edges[t, e], k] + v - 1 - min(u, w)
                        side += 1
                n_nodes = 0
                for i in range(3):
                    if i != k:
                        n_nodes += abs(crossing_floors[ends[n, 1], i] - crossing_floors[ends[n, 0], i])
                offsets[n + 1] = offsets[n] + n_nodes
                n += 1


def _rank_nodes(
    boundary_faces: Any,
    face_offsets: Any,
    pair: Any,
    a: Any,
    b: Any,
    floor: Any,
    boundary_nodes: Any,
    ends: Any,
    crossing_floors: Any,
    offsets: Any,
    first_segment: Any,
    low: Any,
    nodes: Any,
) -> None:
    """Put every boundary node in its place on the two segments that cross there, in order from their first ends."""
    for t in range(len(boundary_faces)):
        for c in range(face_offsets[boundary_faces[t]], face_offsets[boundary_faces[t] + 1]):
            i, j = PAIRS[pair[c]]
            k = 2 - pair[c]
            for way in range(2):
                # On the segment {phi_along = line}, the node is the crossing with {phi_across = other}.
                along, across, line, other = (i, j, a[c], b[c]) if way == 0 else (j, i, b[c], a[c])
                segment = first_segment[t, along] + line - 1 - low[t, along]
                start = ends[segment, 0]
                begin = crossing_floors[start, across]
                before = other - begin - 1 if other > begin else begin - other
                rank = before + abs(floor[c] - crossing_floors[start, k])
                nodes[offsets[segment] + rank] = boundary_nodes[c]


cut_triangles = compiled(_cut_triangles)
rank_nodes = compiled(_rank_nodes)
