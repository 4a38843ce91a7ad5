"""Bounds on the spacing: an energy of any stage, and a penalty on cell edges outside of given bounds.

Source: none; Arora et al. 2019 bound nothing. The largest cell edge is up to 147,000 times the median in their maps and
still up to 69 times with the fold barrier alone. To an energy E of a map phi is added, tet by tet with weight w,

    k w sum_i (max(0, log(h_i / high)^2, log(low / h_i)^2)),  h_i = |b_i|, b_i the columns of (grad phi)^-1,

which is smooth once; low and high are the bounds times the median edge, drawn in by `_MARGIN`. k grows from round to
round until all edges are within the bounds. This is no guarantee: where the boundary of the part, or a twist of the
stress, makes the curves fan out, bounds near one may need folds, and no map has them. What is left outside is reported.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from michell_cad.linear_solver import factorise
from michell_cad.minimize import minimize
from michell_cad.parametrization.equation_11 import free_vertices
from michell_cad.parametrization.jacobians import MapDerivative, cofactors, determinants, product, transposed
from michell_cad.parametrization.quality import count_double_wound_edges
from michell_cad.tet_mesh import TetMesh

SpacingBounds = tuple[float, float]
"""Smallest and largest edge of a cell over the median edge."""

Energy = Callable[[np.ndarray], tuple[float, np.ndarray]]

_MARGIN = 0.1
"""The penalty starts where this fraction of the way (in the logarithm) from the median to a bound is left."""
_STIFFNESSES = (10.0, 100.0, 1e3, 1e4)
"""k, round by round, when energy and weights are of order one per tet."""
_ITERATIONS, _MEMORY, _TOLERANCE = 80, 10, 1e-4


def outside_bounds(
    edges: Float[np.ndarray, "n_t 3"], bounds: SpacingBounds, volumes: Float[np.ndarray, " n_t"]
) -> float:
    """Fraction of the volume in tets with an edge of the cell (of any family) outside of the bounds."""
    ratio = edges / np.median(edges)
    outside = ((ratio < bounds[0]) | (ratio > bounds[1])).any(1)
    return float(volumes[outside].sum() / volumes.sum())


def cell_edges(derivative: MapDerivative, phi: Float[np.ndarray, "n_v 3"]) -> Float[np.ndarray, "3 n_t"]:
    """Edges h_i of the cells in each tet."""
    J = derivative.jacobians(phi)
    C = cofactors(J)
    return np.sqrt((C * C).sum(1)) / np.abs(determinants(J, C))


def bound_spacing(
    mesh: TetMesh,
    phi: Float[np.ndarray, "n_v 3"],
    bounds: SpacingBounds,
    energy: Energy,
    stiffness: Float[np.ndarray, " n_t"],
    weights: Float[np.ndarray, " n_t"],
) -> Float[np.ndarray, "n_v 3"]:
    """Minimise `energy` and the penalty of this module from a map without folds, round by round.

    Of the map to start from and those of all rounds the one is returned that has least outside of the bounds.

    Parameters
    ----------
    mesh : TetMesh
    phi : the map to start from, where `energy` is finite.
    bounds : SpacingBounds
    energy : value and gradient, infinite for maps with folds.
    stiffness : about the second derivative of the energy by grad phi in each tet.
    weights : w, mean about one.
    """
    derivative = MapDerivative(mesh)
    found = [(outside_bounds(cell_edges(derivative, phi).T, bounds, mesh.volumes), phi)]
    for k in _STIFFNESSES:
        penalty = SpacingPenalty.of_map(derivative, phi, bounds, k * weights)
        step = _preconditioner(mesh, stiffness + penalty.stiffness(phi))

        def total(phi: np.ndarray, penalty: "SpacingPenalty" = penalty) -> tuple[float, np.ndarray]:
            value, gradient = energy(phi)
            if not np.isfinite(value):
                return value, gradient
            more, slope = penalty(phi)
            return value + more, gradient + slope

        phi, _ = minimize(total, phi, step, memory=_MEMORY, iterations=_ITERATIONS, tolerance=_TOLERANCE)
        if count_double_wound_edges(mesh, phi):
            break
        found.append((outside_bounds(cell_edges(derivative, phi).T, bounds, mesh.volumes), phi))
        if found[-1][0] == 0:
            break
    return min(found, key=lambda entry: entry[0])[1]


@dataclass(frozen=True, eq=False)
class SpacingPenalty:
    """Value and gradient of the penalty of this module.

    Parameters
    ----------
    derivative : MapDerivative
    low, high : bounds of the logarithm of the edges.
    weights : (n_t,) float, k w.
    """

    derivative: MapDerivative
    low: float
    high: float
    weights: Float[np.ndarray, " n_t"]

    @staticmethod
    def of_map(
        derivative: MapDerivative, phi: Float[np.ndarray, "n_v 3"], bounds: SpacingBounds, weights: np.ndarray
    ) -> "SpacingPenalty":
        """The penalty with bounds relative to the median edge of a map."""
        middle = np.log(np.median(cell_edges(derivative, phi)))
        low, high = middle + (1 - _MARGIN) * np.log(bounds)
        return SpacingPenalty(derivative, float(low), float(high), weights)

    def __call__(self, phi: Float[np.ndarray, "n_v 3"]) -> tuple[float, Float[np.ndarray, "n_v 3"]]:
        J = self.derivative.jacobians(phi)
        C = cofactors(J)
        det = determinants(J, C)
        squares = (C * C).sum(1)  # |C_i|^2 = (h_i det)^2
        excess = self._excess(0.5 * np.log(squares) - np.log(np.abs(det)))
        # d log h_i = b_i . d b_i / h_i^2 and d B = -B dJ B: from the gradient Q by B follows that by J, -B' Q B'.
        Q = 2 * self.weights * excess * transposed(C) * det / squares
        P = -product(product(C / det, Q), C / det)
        return float(self.weights @ (excess**2).sum(0)), self.derivative.pull_back(P)

    def stiffness(self, phi: Float[np.ndarray, "n_v 3"]) -> Float[np.ndarray, " n_t"]:
        """About the second derivative by grad phi in each tet: that of k w log^2 where an edge is out of bounds."""
        return 2 * self.weights * (self._excess(np.log(cell_edges(self.derivative, phi))) != 0).any(0)

    def _excess(self, logarithm: np.ndarray) -> np.ndarray:
        return np.maximum(logarithm - self.high, 0) - np.maximum(self.low - logarithm, 0)


def _preconditioner(mesh: TetMesh, stiffness: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """The inverse of sum_t s_t |grad f|^2, per tet and without volumes, as the energies are."""
    free = free_vertices(mesh)
    factor = factorise(mesh.laplacian(stiffness / mesh.volumes)[free][:, free])

    def precondition(gradient: np.ndarray) -> np.ndarray:
        step = np.zeros_like(gradient)
        step[free] = factor.solve(np.ascontiguousarray(gradient[free]))
        return step

    return precondition
