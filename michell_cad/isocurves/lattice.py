"""Levels on a fine integer grid, and the exact predicates that decide where they meet the integer lattice.

Isocurves of a piecewise-linear map have the right topology (curves without loose ends, one node for all three
families) as soon as every decision is the one that a *generic* map would give. Two steps make the map generic:

1. Levels are rounded once to odd multiples of 2^-(bits + 1) cells. No vertex then lies on an integer, noise of a linear
   solver cannot move a vertex from one side to the other, and all predicates are exact in 64-bit integers.
2. What is still a tie (an integer point exactly on the image of an edge or face) is decided as if all three levels were
   lowered by (e1, e2, e3), e1 >> e2 >> e3 > 0 infinitesimal: simulation of simplicity (Edelsbrunner and Mücke 1990,
   doi:10.1145/77635.77639) with one shift for the whole map instead of one for each vertex. All predicates used are
   linear in that shift, so the first non-zero coefficient decides.

A lattice point (a, b) below always stands for the shifted one, (a + e_i, b + e_j).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from michell_cad.arrays import freeze, require
from michell_cad.compiled import compiled
from michell_cad.errors import InvalidInputError

PAIRS = ((0, 1), (0, 2), (1, 2))
"""The pairs (i, j) of coordinates that are integer along an interior curve; the third coordinate of pair p is 2 - p."""

PREDICATE_BITS = 20
"""A tet spans at most 2^20 grid steps, so that the largest product, 4 * (2^20 + 2)^3, stays below 2^63."""

MAX_CELLS_PER_TET = 256.0
"""Cells that one tet may span: the grid step is then 2^-12 cell. Wilder levels are an error in the making."""

MAX_LEVEL = 2.0**30
"""Levels below this keep the grid exact in 64-bit integers, and their floors in 32 bits."""

USUAL_CROSSINGS = 4
"""Room for crossings per face at first; the given problems have up to 2.2. It doubles until it is enough."""

MAX_CROSSINGS = 2**26
"""Room for crossings at most (52 bytes each)."""


@dataclass(frozen=True, eq=False)
class GridLevels:
    """Levels at the vertices in steps of ``2**-shift`` cells, all odd.

    Parameters
    ----------
    values : (n_v, 3) int, odd.
    shift : one cell is ``2**shift`` steps.
    """

    values: Int[np.ndarray, "n_v 3"]
    shift: int

    def __post_init__(self) -> None:
        freeze(self, values=np.int64)

    @property
    def cell(self) -> int:
        """Grid steps in a cell."""
        return 1 << self.shift

    @cached_property
    def floors(self) -> Int[np.ndarray, "n_v 3"]:
        """The largest integer below each level."""
        return self.values >> self.shift


def round_levels(levels: Float[np.ndarray, "n_v 3"], tets: Int[np.ndarray, "n_t 4"]) -> GridLevels:
    """Round levels to the finest grid on which the predicates of all tets are exact.

    Raises
    ------
    InvalidInputError
        If a level is not finite or beyond `MAX_LEVEL`, or a tet spans more than `MAX_CELLS_PER_TET` cells.
    """
    good = np.abs(levels) < MAX_LEVEL
    if not good.all():
        bad = np.flatnonzero(~good.all(1))
        raise InvalidInputError(
            f"levels must be finite and below {MAX_LEVEL:.3g} in size; {len(bad)} vertices are not, first "
            f"vertex {bad[0]}: {levels[bad[:1]]}"
        )
    extent, widest = widest_tet(np.ascontiguousarray(levels, np.float64), tets)
    require(
        extent <= MAX_CELLS_PER_TET,
        f"a tet may span {MAX_CELLS_PER_TET:g} cells of the parametrization at most; tet {widest} "
        f"spans {extent:.4g}. Use a finer mesh or a smaller resolution",
    )
    shift = PREDICATE_BITS - max(0, int(np.ceil(np.log2(max(extent, 1.0)))))
    return GridLevels(2 * np.rint(np.ldexp(levels, shift - 1)).astype(np.int64) + 1, shift)


def _widest_tet(levels: Any, tets: Any) -> tuple[float, int]:
    """The most cells that a tet spans along a coordinate, and the first such tet."""
    extent, widest = -1.0, 0
    for t in range(len(tets)):
        for i in range(3):
            p, q, r, s = levels[tets[t, 0], i], levels[tets[t, 1], i], levels[tets[t, 2], i], levels[tets[t, 3], i]
            span = max(p, q, r, s) - min(p, q, r, s)
            if span > extent:
                extent, widest = span, t
    return extent, widest


widest_tet = compiled(_widest_tet)


@dataclass(frozen=True, eq=False)
class FaceCrossings:
    """Where the lattice lines {phi_i = a, phi_j = b} cross the faces of a mesh, in the order of face, pair, a, b.

    Parameters
    ----------
    face : (n,) int.
    pair : (n,) int, index into `PAIRS`.
    a, b : (n,) int, values of the two coordinates.
    points : (n, 3) float, mm.
    floor : (n,) int, largest integer below the third coordinate of the crossing, exact.
    level : (n,) float, third coordinate of the crossing.
    offsets : (n_f + 1,) int; crossings of face f are ``offsets[f] : offsets[f + 1]``.
    """

    face: Int[np.ndarray, " n"]
    pair: Int[np.ndarray, " n"]
    a: Int[np.ndarray, " n"]
    b: Int[np.ndarray, " n"]
    points: Float[np.ndarray, "n 3"]
    floor: Int[np.ndarray, " n"]
    level: Float[np.ndarray, " n"]
    offsets: Int[np.ndarray, " n_f1"]


def cross_faces(
    vertices: Float[np.ndarray, "n_v 3"], faces: Int[np.ndarray, "n_f 3"], grid: GridLevels
) -> FaceCrossings:
    """Find all crossings of lattice lines with triangles.

    The line of the pair (i, j) through (a, b) crosses a face when (a, b) lies inside the image of the face in the plane
    (phi_i, phi_j): the three products w = orient2D(two corners, point) then have the same sign. They are the
    barycentric coordinates, times their sum, from which the point and the third coordinate (an exact fraction) follow.
    """
    # Counting first would cost a fifth of the search; room that is not filled costs nothing, since the system gives
    # memory when it is used. All is bound by memory: hence half-size integers, and floors of the levels at hand.
    offsets = np.zeros(len(faces) + 1, np.int64)
    room, n = USUAL_CROSSINGS * len(faces), -1
    while n < 0:
        require(
            room <= MAX_CROSSINGS,
            f"isocurves cross the {len(faces)} faces of the mesh more than {room // 2} times: the parametrization is "
            "too wild, or the resolution too high, for this mesh",
        )
        integers = tuple(np.empty(room, np.int32) for _ in range(5))
        points, level = np.empty((room, 3)), np.empty(room)
        n = find_crossings(vertices, faces, grid.values, grid.shift, *integers, points, level, offsets)
        room *= 2
    face, pair, a, b, floor = (array[:n] for array in integers)
    return FaceCrossings(face, pair, a, b, points[:n], floor, level[:n], offsets)


def _find_crossings(
    vertices: Any,
    faces: Any,
    values: Any,
    shift: int,
    face: Any,
    pair: Any,
    a: Any,
    b: Any,
    floor: Any,
    points: Any,
    level: Any,
    offsets: Any,
) -> int:
    """Fill the arrays of `FaceCrossings`, in the order of face, pair, a, b; the number of crossings, -1 if too many."""
    n = 0
    low, high = np.empty(3, np.int64), np.empty(3, np.int64)
    for f in range(len(faces)):
        offsets[f] = n
        u, v, w = faces[f, 0], faces[f, 1], faces[f, 2]
        for i in range(3):
            x, y, z = values[u, i], values[v, i], values[w, i]
            low[i], high[i] = min(x, y, z) >> shift, max(x, y, z) >> shift
        for p in range(3):
            i, j = PAIRS[p]
            k = 2 - p
            for first in range(low[i] + 1, high[i] + 1):
                x = first << shift
                x0, x1, x2 = values[u, i] - x, values[v, i] - x, values[w, i] - x
                for second in range(low[j] + 1, high[j] + 1):
                    y = second << shift
                    y0, y1, y2 = values[u, j] - y, values[v, j] - y, values[w, j] - y
                    w0, side0 = orient(x1, y1, x2, y2)
                    w1, side1 = orient(x2, y2, x0, y0)
                    if side0 == 0 or side0 != side1:
                        continue
                    w2, side2 = orient(x0, y0, x1, y1)
                    if side1 != side2:
                        continue
                    if n == len(face):
                        return -1
                    face[n], pair[n], a[n], b[n] = f, p, first, second
                    area = w0 + w1 + w2
                    for d in range(3):
                        points[n, d] = (w0 * vertices[u, d] + w1 * vertices[v, d] + w2 * vertices[w, d]) / area
                    floor[n], level[n] = third_coordinate(values[u], values[v], values[w], k, w1, w2, area, shift)
                    n += 1
    offsets[len(faces)] = n
    return n


def _orient(x0: int, y0: int, x1: int, y1: int) -> tuple[int, int]:
    """Return w = x0 y1 - x1 y0 and its sign, where a tie is decided by the shift of the origin by (e_i, e_j).

    d w / d e_i = y0 - y1 and d w / d e_j = x1 - x0 decide; both vanish for an edge without length, and then the face
    has no area and is not crossed.
    """
    w = x0 * y1 - x1 * y0
    decisive = w
    if decisive == 0:
        decisive = y0 - y1
    if decisive == 0:
        decisive = x1 - x0
    return w, (decisive > 0) - (decisive < 0)


def _third_coordinate(p: Any, q: Any, r: Any, k: int, w1: int, w2: int, area: int, shift: int) -> tuple[int, float]:
    """Floor (exact, ties by the shift) and value of coordinate k at the point with weights w / area between p, q, r."""
    numerator = w1 * (q[k] - p[k]) + w2 * (r[k] - p[k])
    if area < 0:
        numerator, area = -numerator, -area
    quotient = numerator // area
    remainder = numerator - quotient * area
    whole = p[k] + quotient
    cell = 1 << shift
    floor = whole >> shift
    if remainder == 0 and whole & (cell - 1) == 0:
        # The plane of the face passes through the lattice point; the shift (e1, e2, e3) moves it along axis k by
        # -(e . N) / N_k with N the normal of the image of the face.
        leading = 0
        for d in range(3):
            e, f = (d + 1) % 3, (d + 2) % 3
            N = (q[e] - p[e]) * (r[f] - p[f]) - (q[f] - p[f]) * (r[e] - p[e])
            if leading == 0:
                leading = N
            if d == k and (leading > 0) == (N > 0) and (leading < 0) == (N < 0):
                floor -= 1
    return floor, (whole + remainder / area) / cell


orient = compiled(_orient, inline=True)
third_coordinate = compiled(_third_coordinate)
find_crossings = compiled(_find_crossings)


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
