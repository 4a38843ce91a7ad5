"""Parts of a mesh while it grows, and what several kinds of nodes need."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from michell_cad.cad.mitre_cuts import SPHERE
from michell_cad.cad.prepared import PreparedTruss
from michell_cad.cad.vectors import cross, dot, triple
from michell_cad.compiled import compiled

TURN = 2 * np.pi


class Blocks:
    """Blocks of vertices and triangles while they grow."""

    def __init__(self) -> None:
        self.points: list[np.ndarray] = []
        self.count = 0
        self.triangles: list[np.ndarray] = []
        self.roles: list[np.ndarray] = []
        self.owners: list[np.ndarray] = []

    def add_points(self, points: np.ndarray) -> np.ndarray:
        flat = points.reshape(-1, 3)
        self.points.append(flat)
        self.count += len(flat)
        return (self.count - len(flat) + np.arange(len(flat))).reshape(points.shape[:-1])

    def add_triangles(self, triangles: np.ndarray, role: int, owner: np.ndarray | int) -> None:
        """`owner` has one entry for each entry of the leading axis of `triangles`."""
        n = triangles.reshape(-1, 3).shape[0]
        owner = np.asarray(owner)
        self.triangles.append(triangles.reshape(-1, 3))
        self.owners.append(np.repeat(owner, n // owner.size) if owner.ndim else np.full(n, owner))
        self.roles.append(np.full(n, role))


@dataclass(frozen=True, eq=False)
class Outline:
    """Vertices of the mitred arcs on one sphere."""

    vertices: np.ndarray
    points: np.ndarray
    arcs: np.ndarray
    area: float
    loops: int


def widened_arc(angle: np.ndarray, bands: int) -> np.ndarray:
    """Factors on the radius of an arc at its 1st to last point, for a polygon with the area of the sector.

    The last point stays on the arc, the others move out: `angle` (n, 1) is cut in `bands` steps.
    """
    step = angle / bands
    factor = np.sqrt(step / np.sin(step))
    return np.concatenate([np.repeat(factor, bands - 1, axis=1), np.ones_like(factor)], axis=1)


def _zip_rings(u_a: Any, a: Any, u_b: Any, b: Any) -> Any:
    """Triangles between two rings that start at angle 0, given the angles of their vertices; a is the lower one."""
    n_a, n_b = len(a), len(b)
    triangles = np.empty((n_a + n_b, 3), np.int64)
    i = j = 0
    while i < n_a or j < n_b:
        next_a, next_b = u_a[i + 1] if i + 1 < n_a else TURN, u_b[j + 1] if j + 1 < n_b else TURN
        row = triangles[i + j]
        if j == n_b or (i < n_a and next_a <= next_b):
            row[0], row[1], row[2] = a[i % n_a], a[(i + 1) % n_a], b[j % n_b]
            i += 1
        else:
            row[0], row[1], row[2] = a[i % n_a], b[(j + 1) % n_b], b[j % n_b]
            j += 1
    return triangles


def mitre_area(p: PreparedTruss, i: int) -> tuple[float, int]:
    """Share of the mitred caps in the Gauss-Bonnet sum of a sphere, and the Euler number of the caps' union.

    The area of the sphere outside caps of half-angles a, over R^2, is 2 pi (2 - chi) + sum cos(a) dtheta - sum tau with
    chi the Euler number of the caps' union, dtheta the arcs of the boundary and tau its turns at the corners.
    """
    node = p.mitres[i]
    pieces = [piece for path in node.mitre.pieces for piece in path]
    links = np.array([(piece.end, piece.neighbour, piece.first, piece.last) for piece in pieces])
    widths = np.array([piece.stop - piece.start for piece in pieces])
    return sum_arcs(links, widths, node.mitre.corners, p.directions[node.ends], np.cos(p.caps[node.ends]))


def _sum_arcs(links: Any, widths: Any, corners: Any, d: Any, cosine: Any) -> tuple[float, int]:
    """See `mitre_area`; links (end, neighbour, first corner, last corner) and widths are those of the pieces."""
    k, n = len(d), len(corners)
    begins, stops, following = np.full(n, -1), np.full(n, -1), np.full(n, -1)
    groups, arriving, leaving = np.arange(k), np.empty(3), np.empty(3)
    total, loops, unions = 0.0, 0, k
    for piece in range(len(links)):
        e, j, first, last = links[piece]
        if j == SPHERE:
            total += cosine[e] * widths[piece]
            begins[first], stops[last], following[last] = e, e, first
        elif groups[e] != groups[j]:
            old, unions = groups[j], unions - 1
            for other in range(k):
                if groups[other] == old:
                    groups[other] = groups[e]
    for c in range(n):
        if begins[c] >= 0:
            # Against the direction of the arcs: along the arc that starts here, then along the one that stops here.
            x = corners[c]
            cross(x, d[begins[c]], arriving)
            cross(x, d[stops[c]], leaving)
            total -= np.arctan2(triple(arriving, leaving, x) / np.sqrt(dot(x, x)), dot(arriving, leaving))
    for c in range(n):
        loops += following[c] >= 0
        at = c
        while following[at] >= 0:
            ahead = following[at]
            following[at], at = -1, ahead
    return total, 2 * unions - loops


zip_rings = compiled(_zip_rings)
sum_arcs = compiled(_sum_arcs)
