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

import numpy as np
from jaxtyping import Float, Int

from michell_cad.arrays import freeze, require

PAIRS = ((0, 1), (0, 2), (1, 2))
"""The pairs (i, j) of coordinates that are integer along an interior curve; the third coordinate of pair p is 2 - p."""

PREDICATE_BITS = 20
"""A tet spans at most 2^20 grid steps, so that the largest product, 4 * (2^20 + 2)^3, stays below 2^63."""

MAX_CELLS_PER_TET = 256.0
"""Cells that one tet may span: the grid step is then 2^-12 cell. Wilder levels are an error in the making."""

MAX_LEVEL = 2.0**31
"""Levels below this keep the grid exact in 64-bit integers."""

MAX_CROSSINGS = 2**24
"""Candidates of one pair that are examined at once (about 150 bytes each, 2.5 GB)."""


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
    bad = ~(np.abs(levels) < MAX_LEVEL).all(1)
    require(
        not bad.any(),
        f"levels must be finite and below {MAX_LEVEL:.3g} in size; {bad.sum()} vertices are not, first "
        f"vertex {int(np.argmax(bad))}: {levels[bad][:1]}",
    )
    widest = np.zeros(len(tets))
    for level in levels.T:
        corners = [level[corner] for corner in tets.T]
        upper = np.maximum(np.maximum(corners[0], corners[1]), np.maximum(corners[2], corners[3]))
        lower = np.minimum(np.minimum(corners[0], corners[1]), np.minimum(corners[2], corners[3]))
        np.maximum(widest, upper - lower, out=widest)
    extent = widest.max()
    require(
        extent <= MAX_CELLS_PER_TET,
        f"a tet may span {MAX_CELLS_PER_TET:g} cells of the parametrization at most; tet {int(np.argmax(widest))} "
        f"spans {extent:.4g}. Use a finer mesh or a smaller resolution",
    )
    shift = PREDICATE_BITS - max(0, int(np.ceil(np.log2(max(extent, 1.0)))))
    return GridLevels(2 * np.rint(np.ldexp(levels, shift - 1)).astype(np.int64) + 1, shift)


@dataclass(frozen=True, eq=False)
class FaceCrossings:
    """Where the lattice lines {phi_i = a, phi_j = b} cross the faces of a mesh.

    Parameters
    ----------
    face : (n,) int.
    pair : (n,) int, index into `PAIRS`.
    a, b : (n,) int, values of the two coordinates.
    weights : (n, 3) float, barycentric coordinates in the face.
    floor : (n,) int, largest integer below the third coordinate of the crossing, exact.
    level : (n,) float, third coordinate of the crossing.
    """

    face: Int[np.ndarray, " n"]
    pair: Int[np.ndarray, " n"]
    a: Int[np.ndarray, " n"]
    b: Int[np.ndarray, " n"]
    weights: Float[np.ndarray, "n 3"]
    floor: Int[np.ndarray, " n"]
    level: Float[np.ndarray, " n"]


@dataclass(frozen=True, eq=False)
class EdgeCrossings:
    """Where the lattice planes {phi_i = a} cross edges (u, v) of a mesh; numbered by edge, coordinate and value.

    Parameters
    ----------
    first : (n_e, 3) int, number of the first crossing of each edge with each coordinate.
    edge, axis, value : (n,) int.
    fraction : (n,) float, position from u (0) to v (1). Exact fractions below 2^21 differ as floats when they differ.
    tie : (n,) int, orders crossings of one edge with the same fraction.
    floors : (n, 3) int, largest integers below the coordinates of the crossing, exact (entry `axis`: value - 1).
    """

    first: Int[np.ndarray, "n_e 3"]
    edge: Int[np.ndarray, " n"]
    axis: Int[np.ndarray, " n"]
    value: Int[np.ndarray, " n"]
    fraction: Float[np.ndarray, " n"]
    tie: Int[np.ndarray, " n"]
    floors: Int[np.ndarray, "n 3"]


def cross_faces(faces: Int[np.ndarray, "n_f 3"], grid: GridLevels) -> FaceCrossings:
    """Find all crossings of lattice lines with triangles.

    The line of the pair (i, j) through (a, b) crosses a face when (a, b) lies inside the image of the face in the plane
    (phi_i, phi_j): the three products w = orient2D(two corners, point) then have the same sign. They are the
    barycentric coordinates, times their sum, from which the third coordinate follows as an exact fraction.
    """
    corner_floors = [grid.floors[corner] for corner in faces.T]
    low = np.minimum(np.minimum(corner_floors[0], corner_floors[1]), corner_floors[2])
    spans = np.maximum(np.maximum(corner_floors[0], corner_floors[1]), corner_floors[2]) - low
    parts = [_cross_pair(faces, grid, low, spans, pair) for pair in range(3)]
    return FaceCrossings(*(np.concatenate([part[field] for part in parts]) for field in range(7)))


def _cross_pair(faces: np.ndarray, grid: GridLevels, low: np.ndarray, spans: np.ndarray, pair: int) -> tuple:
    i, j = PAIRS[pair]
    hit = np.flatnonzero(spans[:, i] * spans[:, j])
    counts = spans[hit, i] * spans[hit, j]
    require(
        counts.sum() < MAX_CROSSINGS,
        f"the levels cross the faces of the mesh {counts.sum()} times for one pair of coordinates, more than "
        f"{MAX_CROSSINGS}: the parametrization is too wild, or the resolution too high, for this mesh",
    )
    owner, local = expand(counts)
    face = hit[owner]
    a = low[face, i] + 1 + local // spans[face, j]
    b = low[face, j] + 1 + local % spans[face, j]
    corners = faces[face].T
    x = grid.values[:, i][corners] - (a << grid.shift)
    y = grid.values[:, j][corners] - (b << grid.shift)
    w = x[[1, 2, 0]] * y[[2, 0, 1]] - x[[2, 0, 1]] * y[[1, 2, 0]]
    sign = np.sign(w)
    # d w / d e_i = y_from - y_to and d w / d e_j = x_to - x_from decide a tie; both vanish for an edge without length,
    # and then the face has no area and is not crossed.
    edge, k = np.nonzero(sign == 0)
    start, end = (edge + 1) % 3, (edge + 2) % 3
    by_i = np.sign(y[start, k] - y[end, k])
    sign[edge, k] = np.where(by_i != 0, by_i, np.sign(x[end, k] - x[start, k]))
    inside = (sign[0] != 0) & (sign[0] == sign[1]) & (sign[1] == sign[2])
    face, a, b, w = face[inside], a[inside], b[inside], w[:, inside]
    floor, level = _third_coordinates(faces[face], grid, pair, w)
    return face, np.full(len(face), pair), a, b, (w / w.sum(0)).T, floor, level


def _third_coordinates(corners: np.ndarray, grid: GridLevels, pair: int, w: np.ndarray) -> tuple:
    """Floor (exact, ties by the shift) and value of the third coordinate at the points with weights w / sum(w)."""
    k = 2 - pair
    z = grid.values[:, k][corners.T]
    area = w.sum(0)
    numerator = np.sign(area) * (w[1] * (z[1] - z[0]) + w[2] * (z[2] - z[0]))
    quotient, remainder = np.divmod(numerator, np.abs(area))
    whole = z[0] + quotient
    floor = whole >> grid.shift
    tie = np.flatnonzero((remainder == 0) & (whole & (grid.cell - 1) == 0))
    if len(tie):
        # The plane of the face passes through the lattice point; the shift (e1, e2, e3) moves it along axis k by
        # -(e . N) / N_k with N the normal of the image of the face.
        p, q, r = grid.values[corners[tie].T]
        N = np.cross(q - p, r - p)
        first = N[np.arange(len(tie)), (N != 0).argmax(1)]
        floor[tie] -= np.sign(first) == np.sign(N[:, k])
    return floor, (whole + remainder / np.abs(area)) / grid.cell


def cross_edges(edges: Int[np.ndarray, "n_e 2"], grid: GridLevels) -> EdgeCrossings:
    """Find all crossings of lattice planes with edges."""
    u, v = edges.T
    counts = np.abs(grid.floors[v] - grid.floors[u])
    owner, local = expand(counts.ravel())
    edge, axis = owner // 3, owner % 3
    value = np.minimum(grid.floors[u[edge], axis], grid.floors[v[edge], axis]) + 1 + local
    start, end = grid.values[u[edge]], grid.values[v[edge]]
    mine = np.arange(len(edge)), axis
    numerator = (value << grid.shift) - start[mine]
    denominator = end[mine] - start[mine]
    rising = np.sign(denominator)
    # phi at the crossing: start + numerator (end - start) / denominator, with a positive denominator for divmod.
    step = end - start
    quotient, remainder = np.divmod((rising * numerator)[:, None] * step, np.abs(denominator)[:, None])
    whole = start + quotient
    floors = whole >> grid.shift
    on_lattice = (remainder == 0) & (whole & (grid.cell - 1) == 0)
    # On a tie the other coordinate k changes by e_i step_k / denominator - e_k: below, unless e_i dominates and step_k
    # and the denominator have the same sign.
    above = (np.arange(3) > axis[:, None]) & (np.sign(step) == rising[:, None])
    floors -= on_lattice & ~above
    first = (np.cumsum(counts.ravel()) - counts.ravel()).reshape(-1, 3)
    # The crossing with coordinate i moves along the edge by e_i / denominator.
    return EdgeCrossings(first, edge, axis, value, numerator / denominator, rising * (3 - axis), floors)


def expand(counts: Int[np.ndarray, " n"]) -> tuple[Int[np.ndarray, " m"], Int[np.ndarray, " m"]]:
    """Number of the owner, and running number within the owner, of ``counts[k]`` items for each owner k."""
    owner = np.repeat(np.arange(len(counts)), counts)
    ends = np.cumsum(counts)
    return owner, np.arange(len(owner)) - (ends - counts)[owner]
