"""Interior isocurves {phi_i = a, phi_j = b}: their segments in the tets, and the nodes on them.

The image of a tet is convex, so a generic lattice line crosses none or two of its faces: crossings with the same tet,
pair and values come in twos, and each two bound a segment. A node (tet, a, b, c) lies on it when c separates the third
coordinates of its ends. Each of the three families decides this from the same signs of the four faces of the tet
against the point (a, b, c), hence a node of one is a node of all three.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from michell_cad.isocurves.lattice import PAIRS, FaceCrossings, expand
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


def trace_interior(
    mesh: TetMesh, crossings: FaceCrossings, points: Float[np.ndarray, "n_c 3"]
) -> tuple[Segments, InteriorNodes]:
    """Link the face crossings (at `points`) by segments through the tets, and find the nodes on them."""
    tets, ends = _link(mesh, crossings)
    start, finish = ends.T
    steps = crossings.floor[finish] - crossings.floor[start]
    segment, local = expand(np.abs(steps))
    rising = steps[segment] > 0
    first = crossings.floor[start[segment]]
    third = np.where(rising, first + 1 + local, first - local)
    values = np.empty((len(segment), 3), np.int64)
    for pair, (i, j) in enumerate(PAIRS):
        mine = crossings.pair[start[segment]] == pair
        crossing = start[segment[mine]]
        values[mine, i], values[mine, j], values[mine, 2 - pair] = (
            crossings.a[crossing],
            crossings.b[crossing],
            third[mine],
        )
    order = lexicographic_order(np.column_stack([tets[segment], values]))
    triples = order.reshape(-1, 3)
    assert (values[triples] == values[triples[:, :1]]).all(), "a node is not shared by three curves"
    numbers = np.empty(len(segment), np.int64)
    numbers[triples] = np.arange(len(triples))[:, None]
    # The family along which the levels change most within the tet places the node best.
    drop = (crossings.level[finish] - crossings.level[start])[segment]
    best = np.take_along_axis(triples, np.abs(drop[triples]).argmax(1)[:, None], axis=1)[:, 0]
    low, change = crossings.level[start[segment[best]]], drop[best]
    fraction = np.divide(third[best] - low, change, out=np.full(len(best), 0.5), where=change != 0)
    fraction = np.clip(fraction, 0, 1)[:, None]
    a, b = points[start[segment[best]]], points[finish[segment[best]]]
    nodes = InteriorNodes(tets[segment[best]], values[best], a + fraction * (b - a))
    offsets = np.concatenate([[0], np.cumsum(np.abs(steps))])
    return Segments(ends, offsets, numbers), nodes


def _link(mesh: TetMesh, crossings: FaceCrossings) -> tuple[np.ndarray, np.ndarray]:
    """Tets of the segments, and the two crossings that each segment joins."""
    sides = mesh.face_tets[crossings.face]
    inner = np.flatnonzero(sides[:, 1] >= 0)
    tets = np.concatenate([sides[:, 0], sides[inner, 1]])
    crossing = np.concatenate([np.arange(len(sides)), inner])
    key = np.column_stack([tets, crossings.pair[crossing], crossings.a[crossing], crossings.b[crossing]])
    order = lexicographic_order(key)
    twos = order.reshape(-1, 2)
    assert (key[twos[:, 0]] == key[twos[:, 1]]).all(), "a lattice line enters a tet without leaving it"
    return tets[twos[:, 0]], crossing[twos]


def lexicographic_order(rows: Int[np.ndarray, "n k"]) -> Int[np.ndarray, " n"]:
    """Order that sorts integer rows by their first column, then their second, and so on.

    The rows are packed in one 64-bit key where they fit, which sorts several times faster than `np.lexsort`.
    """
    if not len(rows):
        return np.zeros(0, np.int64)
    low = rows.min(0)
    widths = rows.max(0) - low + 1
    if np.prod(widths.astype(float)) < 2**62:
        key = np.zeros(len(rows), np.int64)
        for column, width in zip((rows - low).T, widths, strict=True):
            key = key * width + column
        return np.argsort(key, kind="stable")
    return np.lexsort(rows.T[::-1])
