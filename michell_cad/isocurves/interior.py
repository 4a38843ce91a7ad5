"""Interior isocurves {phi_i = a, phi_j = b}: their segments in the tets, and the nodes on them.

The image of a tet is convex, so a generic lattice line crosses none or two of its faces: crossings with the same tet,
pair and values come in twos, and each two bound a segment. A node (tet, a, b, c) lies on it when c separates the third
coordinates of its ends. Each of the three families decides this from the same signs of the four faces of the tet
against the point (a, b, c), hence a node of one is a node of all three.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from michell_cad.compiled import compiled
from michell_cad.isocurves.lattice import FaceCrossings
from michell_cad.tet_mesh import TetMesh


@dataclass(frozen=True, eq=False)
class Segments:
    """Edges of the chains of a kind of curves, with the nodes on each.

    Parameters
    ----------
    ends : (m, 2) int, the two chain vertices of each segment.
    node_offsets : (m + 1,) int.
    nodes : (k,) int, nodes on the segments, each in order from its first end; those of segment s are
        ``nodes[node_offsets[s] : node_offsets[s + 1]]``.
    """

    ends: Int[np.ndarray, "m 2"]
    node_offsets: Int[np.ndarray, " m1"]
    nodes: Int[np.ndarray, " k"]


@dataclass(frozen=True, eq=False)
class InteriorNodes:
    """Points where three isocurves cross.

    Parameters
    ----------
    tets : (n,) int.
    values : (n, 3) int.
    points : (n, 3) float, mm.
    """

    tets: Int[np.ndarray, " n"]
    values: Int[np.ndarray, "n 3"]
    points: Float[np.ndarray, "n 3"]


def trace_interior(mesh: TetMesh, crossings: FaceCrossings) -> tuple[Segments, InteriorNodes]:
    """Link the face crossings by segments through the tets, and find the nodes on them."""
    sides = 2 * len(crossings.face) - np.count_nonzero(mesh.face_tets[crossings.face, 1] < 0)
    tets, ends = np.empty(sides // 2, np.int32), np.empty((sides // 2, 2), np.int32)
    n = link_crossings(
        mesh.tet_faces, mesh.face_tets, crossings.offsets, crossings.pair, crossings.a, crossings.b, tets, ends
    )
    assert 2 * n == sides, "a lattice line enters a tet without leaving it"
    offsets = np.concatenate([[0], np.cumsum(np.abs(crossings.floor[ends[:, 1]] - crossings.floor[ends[:, 0]]))])
    numbers, places = np.empty(offsets[-1], np.int32), np.empty((offsets[-1] // 3, 3))
    nodes = InteriorNodes(np.empty(len(places), np.int32), np.empty((len(places), 3), np.int32), places)
    n = number_nodes(
        tets,
        ends,
        offsets,
        crossings.pair,
        crossings.a,
        crossings.b,
        crossings.floor,
        crossings.level,
        crossings.points,
        numbers,
        nodes.tets,
        nodes.values,
        nodes.points,
    )
    assert 3 * n == offsets[-1], "a node is not shared by three curves"
    return Segments(ends, offsets, numbers), nodes


def _link_crossings(
    tet_faces: Any, face_tets: Any, offsets: Any, pair: Any, a: Any, b: Any, tets: Any, ends: Any
) -> int:
    """Find the segments, in the order of tet, pair, a, b: their tets and ends. Return their number, -1 if one is loose.

    The crossings of each face are in order, so that merging the four lists of a tet brings the two ends together.
    """
    n = 0
    at, stop = np.empty(4, np.int64), np.empty(4, np.int64)
    for t in range(len(tet_faces)):
        for k in range(4):
            at[k], stop[k] = offsets[tet_faces[t, k]], offsets[tet_faces[t, k] + 1]
        while True:
            one, other = -1, -1
            for k in range(4):
                if at[k] == stop[k]:
                    continue
                order = -1
                if one >= 0:
                    c, d = at[k], at[one]
                    order = pair[c] - pair[d]
                    if order == 0:
                        order = a[c] - a[d]
                    if order == 0:
                        order = b[c] - b[d]
                if order < 0:
                    one, other = k, -1
                elif order == 0:
                    other = k
            if one < 0:
                break
            if other < 0:
                return -1
            # A direction that does not depend on how the faces of the tet are numbered.
            c, d = at[one], at[other]
            c_first = face_tets[tet_faces[t, one], 0] == t
            d_first = face_tets[tet_faces[t, other], 0] == t
            if (d_first and not c_first) or (c_first == d_first and d < c):
                c, d = d, c
            tets[n], ends[n, 0], ends[n, 1] = t, c, d
            n += 1
            at[one] += 1
            at[other] += 1
    return n


def _number_nodes(
    tets: Any,
    ends: Any,
    offsets: Any,
    pair: Any,
    a: Any,
    b: Any,
    floor: Any,
    level: Any,
    points: Any,
    numbers: Any,
    node_tets: Any,
    node_values: Any,
    node_points: Any,
) -> int:
    """Number the nodes on all segments, and place each on the segment along which the levels change most.

    Every node (tet, a, b, c) lies on the segment (a, b) of the first pair, and gets its number there; the segments
    (a, c) and (b, c) of the same tet look it up. Returns the number of nodes, -1 if one of these is missing.
    """
    n_nodes, base, n_first = 0, 0, 0  # the segments of the first pair in this tet: base ... base + n_first
    first_node = np.empty(len(tets), np.int64)
    steepest = np.full(len(node_tets), -1.0)
    for s in range(len(tets)):
        c, d = ends[s]
        p = pair[c]
        if s == 0 or tets[s] != tets[s - 1]:
            base, n_first = s, 0
        drop = level[d] - level[c]
        rising = floor[d] > floor[c]
        if p == 0:
            n_first += 1
            first_node[s] = n_nodes
            n_nodes += offsets[s + 1] - offsets[s]
            if n_nodes > len(node_tets):
                return -1
        for local in range(offsets[s + 1] - offsets[s]):
            third = floor[c] + 1 + local if rising else floor[c] - local
            x, y, z = a[c], b[c], third
            home = s
            if p == 1:
                y, z = third, b[c]
            if p == 2:
                x, y, z = third, a[c], b[c]
            if p > 0:
                home = find_segment(ends, a, b, base, base + n_first, x, y)
                if home < 0:
                    return -1
            low, high = floor[ends[home, 0]], floor[ends[home, 1]]
            if low > high:
                low, high = high, low
            if z <= low or z > high:
                return -1
            node = first_node[home] + z - low - 1
            numbers[offsets[s] + local] = node
            if abs(drop) > steepest[node]:
                steepest[node] = abs(drop)
                node_tets[node] = tets[s]
                node_values[node, 0], node_values[node, 1], node_values[node, 2] = x, y, z
                fraction = (third - level[c]) / drop if drop != 0 else 0.5
                fraction = min(max(fraction, 0.0), 1.0)
                for k in range(3):
                    node_points[node, k] = points[c, k] + fraction * (points[d, k] - points[c, k])
    return n_nodes


def _find_segment(ends: Any, a: Any, b: Any, start: int, stop: int, x: int, y: int) -> int:
    """Segment in ``start : stop`` (sorted) with the values (x, y), or -1."""
    last = stop
    while start < stop:
        middle = (start + stop) // 2
        c = ends[middle, 0]
        if a[c] < x or (a[c] == x and b[c] < y):
            start = middle + 1
        else:
            stop = middle
    if start == last or a[ends[start, 0]] != x or b[ends[start, 0]] != y:
        return -1
    return start


find_segment = compiled(_find_segment)
link_crossings = compiled(_link_crossings)
number_nodes = compiled(_number_nodes)
