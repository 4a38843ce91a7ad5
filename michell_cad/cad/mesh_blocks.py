"""Parts of a mesh while it grows, and what several kinds of nodes need."""

from dataclasses import dataclass

import numpy as np

from michell_cad.cad.mitre_cuts import SPHERE
from michell_cad.cad.prepared import PreparedTruss

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


def zip_rings(u_a: np.ndarray, a: np.ndarray, u_b: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Triangles between two rings that start at angle 0, given the angles of their vertices; a is the lower one."""
    triangles = []
    i = j = 0
    n_a, n_b = len(a), len(b)
    u_a, u_b = np.append(u_a, TURN), np.append(u_b, TURN)
    while i < n_a or j < n_b:
        if j == n_b or (i < n_a and u_a[i + 1] <= u_b[j + 1]):
            triangles.append((a[i % n_a], a[(i + 1) % n_a], b[j % n_b]))
            i += 1
        else:
            triangles.append((a[i % n_a], b[(j + 1) % n_b], b[j % n_b]))
            j += 1
    return np.array(triangles)


def mitre_area(p: PreparedTruss, i: int) -> tuple[float, int]:
    """Share of the mitred caps in the Gauss-Bonnet sum of a sphere, and the Euler number of the caps' union.

    The area of the sphere outside caps of half-angles a, over R^2, is 2 pi (2 - chi) + sum cos(a) dtheta - sum tau with
    chi the Euler number of the caps' union, dtheta the arcs of the boundary and tau its turns at the corners.
    """
    node = p.mitres[i]
    total = 0.0
    starts: dict[int, np.ndarray] = {}
    stops: dict[int, np.ndarray] = {}
    following: dict[int, int] = {}
    for k, e in enumerate(node.ends):
        for piece in node.mitre.pieces[k]:
            if piece.neighbour == SPHERE:
                total += float(np.cos(p.caps[e]) * (piece.stop - piece.start))
                d = p.directions[e]
                starts[piece.first] = -np.cross(d, node.mitre.corners[piece.first])
                stops[piece.last] = -np.cross(d, node.mitre.corners[piece.last])
                following[piece.last] = piece.first
    for c, arriving in starts.items():
        # Against the direction of the arcs: along the arc that starts here, then along the one that stops here.
        leaving = stops[c]
        normal = node.mitre.corners[c] / np.linalg.norm(node.mitre.corners[c])
        total -= float(np.arctan2(np.cross(arriving, leaving) @ normal, arriving @ leaving))
    loops = 0
    while following:
        loops += 1
        c = next(iter(following))
        while c in following:
            c = following.pop(c)
    groups = np.arange(len(node.ends))
    for k, path in enumerate(node.mitre.pieces):
        for piece in path:
            if piece.neighbour != SPHERE:
                groups[groups == groups[piece.neighbour]] = groups[k]
    return total, 2 * len(np.unique(groups)) - loops
