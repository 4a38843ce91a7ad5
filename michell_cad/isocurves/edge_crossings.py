"""Where the lattice planes {phi_i = a} cross edges of the mesh, by the exact predicates of `lattice`."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from michell_cad.compiled import compiled
from michell_cad.isocurves.lattice import GridLevels


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


def cross_edges(edges: Int[np.ndarray, "n_e 2"], grid: GridLevels) -> EdgeCrossings:
    """Find all crossings of lattice planes with edges."""
    u, v = edges.T
    counts = np.abs(grid.floors[v] - grid.floors[u]).ravel()
    ends = np.cumsum(counts)
    n = int(ends[-1]) if len(ends) else 0
    edge, axis, value, tie = (np.empty(n, np.int64) for _ in range(4))
    fraction, floors = np.empty(n), np.empty((n, 3), np.int64)
    fill_crossings(edges, grid.values, grid.floors, grid.shift, edge, axis, value, fraction, tie, floors)
    return EdgeCrossings((ends - counts).reshape(-1, 3), edge, axis, value, fraction, tie, floors)


def _fill_crossings(
    edges: Any,
    values: Any,
    floors: Any,
    shift: int,
    edge: Any,
    axis: Any,
    value: Any,
    fraction: Any,
    tie: Any,
    crossing_floors: Any,
) -> None:
    """Fill the arrays of `EdgeCrossings`, in the order of edge, coordinate and value."""
    n = 0
    for e in range(len(edges)):
        u, v = edges[e, 0], edges[e, 1]
        for i in range(3):
            denominator = values[v, i] - values[u, i]
            rising = 1 if denominator > 0 else -1
            for a in range(min(floors[u, i], floors[v, i]) + 1, max(floors[u, i], floors[v, i]) + 1):
                numerator = (a << shift) - values[u, i]
                edge[n], axis[n], value[n], fraction[n] = e, i, a, numerator / denominator
                # The shift of the lattice moves the crossing with coordinate i along the edge by e_i / denominator.
                tie[n] = rising * (3 - i)
                for k in range(3):
                    # phi_k there: its value at u plus a fraction of its step, with a positive denominator.
                    step = values[v, k] - values[u, k]
                    product, divisor = rising * numerator * step, rising * denominator
                    quotient = product // divisor
                    whole = values[u, k] + quotient
                    floor = whole >> shift
                    if product == quotient * divisor and whole == floor << shift:
                        # On a tie phi_k changes by e_i step / denominator - e_k: below, unless e_i dominates and step
                        # and denominator have the same sign.
                        if not (k > i and rising * step > 0):
                            floor -= 1
                    crossing_floors[n, k] = floor
                n += 1


fill_crossings = compiled(_fill_crossings)


def place_edge_crossings(
    edges: Int[np.ndarray, "n_e 2"], values: Float[np.ndarray, "n_v k"], crossings: EdgeCrossings
) -> Float[np.ndarray, "n k"]:
    """Values at the crossings, of functions given at the vertices and linear along the edges."""
    placed = np.empty((len(crossings.edge), values.shape[1]))
    interpolate(edges, np.ascontiguousarray(values, np.float64), crossings.edge, crossings.fraction, placed)
    return placed


def _interpolate(edges: Any, values: Any, edge: Any, fraction: Any, placed: Any) -> None:
    for n in range(len(edge)):
        u, v = edges[edge[n], 0], edges[edge[n], 1]
        for k in range(values.shape[1]):
            placed[n, k] = values[u, k] + fraction[n] * (values[v, k] - values[u, k])


interpolate = compiled(_interpolate)
