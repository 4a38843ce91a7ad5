"""Rows of balls that stand for members, and which of them overlap, compiled: what `clearance` looks at.

Balls are sorted into a grid of cells as wide as the reach of the largest one, so that its rivals are in 27 cells.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from michell_cad.arrays import freeze
from michell_cad.cad.vectors import distance
from michell_cad.compiled import compiled

CELLS_PER_BALL = 8
"""The grid has at most so many cells for each ball; beyond, its cells are wider."""


@dataclass(frozen=True, eq=False)
class Balls:
    """Balls, and the grid that holds them.

    Parameters
    ----------
    owner : (n,) int, member of each ball.
    points, radii : (n, 3) and (n,) float, mm.
    low, cell : corner of the grid, and edge of its cells, mm.
    shape : (3,) int, cells along each axis.
    starts, order : the balls in cell c are order[starts[c] : starts[c + 1]]; cells along the last axis are neighbours.
    """

    owner: Int[np.ndarray, " n"]
    points: Float[np.ndarray, "n 3"]
    radii: Float[np.ndarray, " n"]
    low: Float[np.ndarray, " 3"]
    cell: float
    shape: Int[np.ndarray, " 3"]
    starts: Int[np.ndarray, " c1"]
    order: Int[np.ndarray, " n"]

    def __post_init__(self) -> None:
        freeze(self, owner=np.int64, points=np.float64, radii=np.float64, low=np.float64)
        freeze(self, shape=np.int64, starts=np.int64, order=np.int64)

    @staticmethod
    def of(owner: Int[np.ndarray, " n"], points: Float[np.ndarray, "n 3"], radii: Float[np.ndarray, " n"]) -> "Balls":
        """Sort balls into a grid; at least one."""
        low = points.min(0)
        size = np.ptp(points, axis=0)
        cell = 2 * float(radii.max())
        shape = (size / cell).astype(np.int64) + 1
        while shape.prod(dtype=float) > CELLS_PER_BALL * len(points) + 1:
            cell *= 1.25
            shape = (size / cell).astype(np.int64) + 1
        at = ((points - low) / cell).astype(np.int64)
        number = (at[:, 0] * shape[1] + at[:, 1]) * shape[2] + at[:, 2]
        starts, order = sort_into_cells(number, int(shape.prod()))
        return Balls(owner, points, radii, low, cell, shape, starts, order)

    @property
    def grid(self) -> tuple[Any, ...]:
        """What the compiled loops need to know."""
        return self.owner, self.points, self.radii, self.low, self.cell, self.shape, self.starts, self.order

    def overlaps(
        self,
        share: float,
        members: Int[np.ndarray, "n_m 2"],
        nodes: Float[np.ndarray, "n_n 3"],
        room: Float[np.ndarray, "n_m 2"],
    ) -> tuple[Int[np.ndarray, "k 2"], Float[np.ndarray, " k"]]:
        """Pairs of balls of different members that are nearer than the share of the sum of their radii, and depths.

        Of members with a common node, only pairs count that are farther from it than the larger of both members' room
        there and the larger radius.
        """
        pairs, depth, count = np.empty((len(self.owner), 2), np.int64), np.empty(len(self.owner)), -1
        while True:
            count = find_overlaps(*self.grid, share, members, nodes, room, pairs, depth)
            if count <= len(pairs):
                return pairs[:count], depth[:count]
            pairs, depth = np.empty((count, 2), np.int64), np.empty(count)

    def inside(
        self,
        share: float,
        members: Int[np.ndarray, "n_m 2"],
        chosen: Int[np.ndarray, " k"],
        nodes: Float[np.ndarray, "n_n 3"],
        spheres: Float[np.ndarray, " n_n"],
    ) -> tuple[Int[np.ndarray, " j"], Int[np.ndarray, " j"], Float[np.ndarray, " j"]]:
        """Chosen nodes and members of other nodes of which a ball is too near to the node's sphere, and depths."""
        n = len(self.owner)
        node, ball, depth = np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n)
        while True:
            count = find_inside(*self.grid, share, members, chosen, nodes, spheres, node, ball, depth)
            if count <= len(node):
                return node[:count], self.owner[ball[:count]], depth[:count]
            node, ball, depth = np.empty(count, np.int64), np.empty(count, np.int64), np.empty(count)


def _sort_into_cells(number: Any, cells: int) -> tuple[Any, Any]:
    """Where the things in each cell begin, and the things in the order of their cells."""
    starts, order = np.zeros(cells + 1, np.int64), np.empty(len(number), np.int64)
    for c in number:
        starts[c + 1] += 1
    for c in range(cells):
        starts[c + 1] += starts[c]
    at = starts.copy()
    for i, c in enumerate(number):
        order[at[c]] = i
        at[c] += 1
    return starts, order


def _find_overlaps(
    owner: Any,
    points: Any,
    radii: Any,
    low: Any,
    cell: float,
    shape: Any,
    starts: Any,
    order: Any,
    share: float,
    members: Any,
    nodes: Any,
    room: Any,
    pairs: Any,
    depth: Any,
) -> int:
    """See `Balls.overlaps`; writes what there is room for and returns how many pairs there are."""
    count, reach = 0, share * 2 * radii.max()
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    for a in range(len(owner)):
        cell_range(points[a], reach, low, cell, shape, first, last)
        for i in range(first[0], last[0]):
            for j in range(first[1], last[1]):
                row = (i * shape[1] + j) * shape[2]
                for b in order[starts[row + first[2]] : starts[row + last[2]]]:
                    if b <= a or owner[b] == owner[a]:
                        continue
                    deep = share * (radii[a] + radii[b]) - distance(points[a], points[b])
                    if deep > 0 and is_apart(a, b, owner, points, radii, members, nodes, room):
                        if count < len(pairs):
                            pairs[count, 0], pairs[count, 1], depth[count] = a, b, deep
                        count += 1
    return count


def _is_apart(a: int, b: int, owner: Any, points: Any, radii: Any, members: Any, nodes: Any, room: Any) -> bool:
    """Whether two balls are not at a common node of their members."""
    m, n = owner[a], owner[b]
    for i in range(2):
        for j in range(2):
            if members[m, i] == members[n, j]:
                X = nodes[members[m, i]]
                near = min(distance(points[a], X), distance(points[b], X))
                if near < max(room[m, i], room[n, j]) + max(radii[a], radii[b]):
                    return False
    return True


def _find_inside(
    owner: Any,
    points: Any,
    radii: Any,
    low: Any,
    cell: float,
    shape: Any,
    starts: Any,
    order: Any,
    share: float,
    members: Any,
    chosen: Any,
    nodes: Any,
    spheres: Any,
    node: Any,
    ball: Any,
    depth: Any,
) -> int:
    """See `Balls.inside`; writes what there is room for and returns how many pairs there are."""
    count, largest = 0, radii.max()
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    for n in chosen:
        cell_range(nodes[n], share * (spheres[n] + largest), low, cell, shape, first, last)
        for i in range(first[0], last[0]):
            for j in range(first[1], last[1]):
                row = (i * shape[1] + j) * shape[2]
                for b in order[starts[row + first[2]] : starts[row + last[2]]]:
                    m = owner[b]
                    deep = share * (spheres[n] + radii[b]) - distance(nodes[n], points[b])
                    if deep > 0 and members[m, 0] != n and members[m, 1] != n:
                        if count < len(node):
                            node[count], ball[count], depth[count] = n, b, deep
                        count += 1
    return count


def _cell_range(point: Any, reach: float, low: Any, cell: float, shape: Any, first: Any, last: Any) -> None:
    """Write the range of cells along each axis within reach of a point; an empty one where there are none."""
    for x in range(3):
        first[x] = min(max(int(np.floor((point[x] - reach - low[x]) / cell)), 0), shape[x])
        last[x] = max(min(int(np.floor((point[x] + reach - low[x]) / cell)) + 1, shape[x]), first[x])


sort_into_cells = compiled(_sort_into_cells)
cell_range = compiled(_cell_range)
is_apart = compiled(_is_apart)
find_overlaps = compiled(_find_overlaps)
find_inside = compiled(_find_inside)
