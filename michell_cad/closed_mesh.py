"""A closed triangle mesh: what solids, plates and swept profiles are to printers, pictures and the solid check."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from michell_cad.arrays import freeze


@dataclass(frozen=True, eq=False)
class ClosedMesh:
    """A triangle mesh meant to be closed, see `is_watertight`; triangles turn counter-clockwise seen from outside.

    Parameters
    ----------
    vertices : (n, 3) float, mm.
    triangles : (t, 3) int.
    """

    vertices: Float[np.ndarray, "n 3"]
    triangles: Int[np.ndarray, "t 3"]

    def __post_init__(self) -> None:
        freeze(self, vertices=np.float64, triangles=np.int64)

    @cached_property
    def volume(self) -> float:
        """Enclosed volume, mm^3, by the divergence theorem."""
        a, b, c = (self.vertices - self.vertices.mean(0))[self.triangles].transpose(1, 0, 2)
        return float(np.einsum("td,td->", a, np.cross(b, c)) / 6)

    @cached_property
    def open_triangles(self) -> Int[np.ndarray, " k"]:
        """Triangles with an edge that has not exactly two triangles, which run along it in opposite directions."""
        t, n = self.triangles, len(self.vertices)
        edges = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
        low, high = edges.min(1), edges.max(1)
        key = np.sort(2 * (low * n + high) + (edges[:, 0] > low))
        # The usual case, for which one sort is enough: both directions of every edge are there, once each.
        upward, downward = key[::2], key[1::2]
        if len(upward) == len(downward) and not (upward & 1).any() and (downward == upward + 1).all():
            if (upward[1:] > downward[:-1]).all():
                return np.zeros(0, np.int64)
        code, back = edges[:, 0] * n + edges[:, 1], edges[:, 1] * n + edges[:, 0]
        order = np.argsort(code)
        ranked = code[order]
        once = np.ones(len(code), bool)
        once[order[1:]] &= ranked[1:] != ranked[:-1]
        once[order[:-1]] &= ranked[1:] != ranked[:-1]
        paired = ranked[np.minimum(np.searchsorted(ranked, back), len(ranked) - 1)] == back
        return np.flatnonzero(~(once & paired).reshape(3, -1).all(0))

    @cached_property
    def is_watertight(self) -> bool:
        """Whether every edge has exactly two triangles, which run along it in opposite directions."""
        return not len(self.open_triangles)

    @cached_property
    def euler_number(self) -> int:
        """Vertices - edges + triangles of a watertight mesh: 2 - 2 genus, summed over its connected pieces."""
        used = np.zeros(len(self.vertices), bool)
        used[self.triangles] = True
        return int(used.sum()) - len(self.triangles) // 2

    @cached_property
    def bodies(self) -> int:
        """Number of connected pieces that enclose volume; hollows, whose triangles face inwards, do not count."""
        t, n = self.triangles, len(self.vertices)
        ends = (t[:, [0, 1]].ravel(), t[:, [1, 2]].ravel())
        _, label = connected_components(coo_matrix((np.ones(len(ends[0])), ends), shape=(n, n)), directed=False)
        a, b, c = (self.vertices - self.vertices.mean(0))[t].transpose(1, 0, 2)
        six_volumes = np.bincount(label[t[:, 0]], np.einsum("td,td->t", a, np.cross(b, c)))
        return int((six_volumes > 0).sum())

    def depth(self, points: Float[np.ndarray, "k 3"]) -> Float[np.ndarray, " k"]:
        """Distance of points from the surface, mm, positive inside."""
        import igl

        winding = np.asarray(igl.fast_winding_number(self.vertices, self.triangles, points))
        squared, _, _ = igl.point_mesh_squared_distance(points, self.vertices, self.triangles)
        return np.where(winding > 0.5, 1.0, -1.0) * np.sqrt(np.asarray(squared))

    def nearest(self, points: Float[np.ndarray, "k 3"]) -> Float[np.ndarray, "k 3"]:
        """The points of the surface that are nearest to points."""
        import igl

        return np.asarray(igl.point_mesh_squared_distance(points, self.vertices, self.triangles)[2])
