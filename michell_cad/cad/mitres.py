"""Creased members of one node: where their equal tubes meet each other and the sphere of the node.

All creased members of a node have the same radius r, and their axes run through the node. A point of the surface of
their union belongs to the member whose direction is nearest, so that member e, at the angle u around its axis, begins
at
    v(u) = max(H, max_j r / tan(alpha_ej / 2) cos(u - u_j)),
H = sqrt(R^2 - r^2), where alpha_ej is the angle to member j and u_j the angle around e at which j lies. The pieces of
this envelope are arcs of the circle in which the tube leaves the sphere, and arcs of the ellipse in the plane that
bisects e and j: with b the bisector and w the common normal of both, x = r / sin(alpha / 2) cos(t) b + r sin(t) w,
where t = u - u_j seen from the one member and t = -(u - u_j) from the other.

With fillets of radius f, these are the offsets of the tubes and the sphere, r + f and R + f, see `creases`.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int

SPHERE = -1
"""Stands for the sphere where a number of a member would name a neighbour."""

SHORTEST_EDGE = 0.01
"""Edges of a mitre are at least this long (relative to r): what is shorter comes from members in special position."""

SAME_POINT = 1e-6
"""Corners computed from different members agree within this distance (relative to r)."""


@dataclass(frozen=True)
class Piece:
    """A piece of the boundary at which a mitred tube begins: from angle `start` to `stop` around it."""

    end: int
    neighbour: int
    start: float
    stop: float
    first: int
    last: int


@dataclass(frozen=True, eq=False)
class Mitre:
    """The corners (k, 3), relative to the node, and for each mitred end the pieces in ascending order of angle.

    The first piece of an end starts at angle 0, the last stops at 2 pi. Every piece between two members occurs twice,
    with the same two corners in opposite order.
    """

    corners: Float[np.ndarray, "k 3"]
    pieces: tuple[tuple[Piece, ...], ...]


@dataclass(frozen=True, eq=False)
class NodeMitre:
    """The mitred ends of one node and how they are cut; member k of `mitre` is `ends[k]`."""

    ends: Int[np.ndarray, " k"]
    mitre: Mitre


def cut_mitre(
    directions: Float[np.ndarray, "k 3"], normals: Float[np.ndarray, "k 3"], R: float, r: float
) -> Mitre | None:
    """Cut the mitred members of one node; None if an edge would be too short or members are in special position.

    Parameters
    ----------
    directions : unit vectors along the members.
    normals : unit vectors at angle 0 around each member.
    R, r : radii of the sphere and of all the tubes, mm.
    """
    H = np.sqrt(R**2 - r**2)
    binormals = np.cross(directions, normals)
    planes = _bisectors(directions, normals, binormals, r)
    breaks = [_envelope(e, *planes, H) for e in range(len(directions))]
    corners: list[np.ndarray] = []
    keys: list[frozenset] = []
    seen: list[int] = []

    def corner(point: np.ndarray, key: frozenset) -> int:
        for c, other in enumerate(corners):
            if keys[c] == key and np.linalg.norm(point - other) < SAME_POINT * r:
                seen[c] += 1
                return c
        corners.append(point)
        keys.append(key)
        seen.append(1)
        return len(corners) - 1

    paths: list[list[tuple[int, float, int]]] = []
    for e, found in enumerate(breaks):
        path = []
        for i, (u, neighbour) in enumerate(found):
            before = found[i - 1][1]
            height = _height(u, neighbour, e, planes, H)
            point = height * directions[e] + r * (np.cos(u) * normals[e] + np.sin(u) * binormals[e])
            path.append((neighbour, u, corner(point, frozenset((e, neighbour, before)))))
        paths.append(path)
    if any(count != len(key - {SPHERE}) for count, key in zip(seen, keys, strict=True)):
        return None
    pieces = _close_paths(paths, planes, directions, normals, binormals, H, r, corners)
    spans = np.array([(piece.stop - piece.start) for path in pieces for piece in path])
    if spans.min() < SHORTEST_EDGE:
        return None
    return Mitre(np.array(corners), pieces)


def _bisectors(
    directions: np.ndarray, normals: np.ndarray, binormals: np.ndarray, r: float
) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients (a, b)[e, j] of v = a cos u + b sin u on the plane that bisects ends e and j; 0 for e itself."""
    tangent = np.linalg.norm(directions[:, None] - directions, axis=2)
    np.fill_diagonal(tangent, 1.0)
    size = r * np.linalg.norm(directions[:, None] + directions, axis=2) / tangent
    along, across = normals @ directions.T, binormals @ directions.T
    toward = np.maximum(np.hypot(along, across), np.finfo(float).tiny)
    np.fill_diagonal(size, 0.0)
    return size * along / toward, size * across / toward


def _height(u: float, neighbour: int, e: int, planes: tuple[np.ndarray, np.ndarray], H: float) -> float:
    if neighbour == SPHERE:
        return H
    return planes[0][e, neighbour] * np.cos(u) + planes[1][e, neighbour] * np.sin(u)


def _envelope(e: int, a: np.ndarray, b: np.ndarray, H: float) -> list[tuple[float, int]]:
    """Breakpoints of the envelope around end e: (angle, neighbour from there on), ascending; empty if all sphere."""
    a, b = a[e], b[e]
    size = np.hypot(a, b)
    rivals = [int(j) for j in np.flatnonzero(size > H) if j != e]
    angles: list[float] = []
    for i, j in enumerate(rivals):
        middle, half = np.arctan2(b[j], a[j]), np.arccos(H / size[j])
        angles += [middle - half, middle + half]
        for k in rivals[i + 1 :]:
            zero = np.arctan2(-(a[j] - a[k]), b[j] - b[k])
            angles += [zero, zero + np.pi]
    if not angles:
        return []
    u = np.unique(np.mod(angles, 2 * np.pi))
    middle = (u + np.r_[u[1:], u[0] + 2 * np.pi]) / 2
    heights = [np.full(len(u), H)] + [a[j] * np.cos(middle) + b[j] * np.sin(middle) for j in rivals]
    top = np.array([SPHERE, *rivals])[np.argmax(heights, axis=0)]
    changes = top != np.roll(top, 1)
    return [(float(x), int(j)) for x, j in zip(u[changes], top[changes], strict=True)]


def _close_paths(paths, planes, directions, normals, binormals, H, r, corners):
    """Pieces between consecutive breakpoints, cut where an end or its neighbour has its angle 0."""
    k = len(paths)
    zero: list[int] = []
    for e in range(k):
        neighbour = paths[e][-1][0] if paths[e] else SPHERE
        height = _height(0.0, neighbour, e, planes, H)
        zero.append(len(corners))
        corners.append(height * directions[e] + r * normals[e])
    result = []
    for e in range(k):
        path = paths[e]
        turns = [(j, u, c, path[(i + 1) % len(path)]) for i, (j, u, c) in enumerate(path)]
        pieces: list[Piece] = []
        if not path:
            result.append((Piece(e, SPHERE, 0.0, 2 * np.pi, zero[e], zero[e]),))
            continue
        for j, u, c, (_, stop, last) in turns:
            stop = stop if stop > u else stop + 2 * np.pi
            marks = [(u, c), (stop, last)]
            if stop > 2 * np.pi:
                marks.append((2 * np.pi, zero[e]))
            if j != SPHERE and paths[j] and paths[j][-1][0] == e:
                foot = corners[zero[j]]
                where = np.mod(np.arctan2(foot @ binormals[e], foot @ normals[e]), 2 * np.pi)
                marks.append((where if where > u else where + 2 * np.pi, zero[j]))
            marks.sort()
            for (u_0, c_0), (u_1, c_1) in pairwise(marks):
                shift = 2 * np.pi if u_0 >= 2 * np.pi else 0.0
                pieces.append(Piece(e, j, u_0 - shift, u_1 - shift, c_0, c_1))
        result.append(tuple(sorted(pieces, key=lambda piece: piece.start)))
    return tuple(result)


def corner_angles(
    directions: Float[np.ndarray, "k 3"], normals: Float[np.ndarray, "k 3"], R: float, r: float
) -> list[Float[np.ndarray, " _"]]:
    """Angles around each end, from its normal, at which its envelope changes from one neighbour to another."""
    planes = _bisectors(directions, normals, np.cross(directions, normals), r)
    H = np.sqrt(R**2 - r**2)
    return [np.array([u for u, _ in _envelope(e, *planes, H)]) for e in range(len(directions))]
