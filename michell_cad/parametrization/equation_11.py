"""Least-squares integration of a frame field: Eq. 11 of Arora et al. 2019.

Departures: Eq. 11 couples nothing across coordinates, so it is solved as three scalar systems instead of one quadratic
program of three times the size; and its sums are weighted by volume, so that the mesh does not matter.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from michell_cad.linear_solver import Factor, factorise
from michell_cad.tet_mesh import TetMesh

SMALLEST_WEIGHT = 0.1
"""Weights are volumes over their mean, but at least this: slivers without weight make the fold barrier slow or fail."""


@dataclass(frozen=True, eq=False)
class LeastSquaresMap:
    """The solution of Eq. 11, with what the fold barrier needs to go on from it.

    Parameters
    ----------
    phi : (n_v, 3) float, mm.
    weights : (n_t,) float, mean about 1: weight of each tet.
    factors : the three factorised systems; vertex 0 is pinned in each.
    """

    phi: Float[np.ndarray, "n_v 3"]
    weights: Float[np.ndarray, " n_t"]
    factors: tuple[Factor, Factor, Factor]

    def precondition(self, gradient: Float[np.ndarray, "n_v 3"]) -> Float[np.ndarray, "n_v 3"]:
        """Apply the inverse of the Hessian of Eq. 11 (up to a translation)."""
        step = np.zeros_like(gradient)
        for i, factor in enumerate(self.factors):
            step[1:, i] = 0.5 * factor.solve(np.ascontiguousarray(gradient[1:, i]))
        return step


def integrate_frames(mesh: TetMesh, frames: Float[np.ndarray, "n_t 3 3"], spacing_weight: float) -> LeastSquaresMap:
    """Minimise sum_t w_t (beta sum_i (g_i . r_i - 1)^2 + sum_{i != j} (g_i . r_j)^2), g_i = grad phi_i (Eq. 11).

    Parameters
    ----------
    mesh : TetMesh
    frames : (n_t, 3, 3), columns r_j.
    spacing_weight : the paper's beta.
    """
    weights = tet_weights(mesh)
    along = np.einsum("tad,tdj->taj", mesh.hat_gradients, frames, optimize=True)
    phi = np.zeros((len(mesh.vertices), 3))
    factors = []
    for i in range(3):
        penalty = np.ones(3)
        penalty[i] = spacing_weight
        scaled = along * penalty
        A = mesh.assemble(np.einsum("t,taj,tbj->tab", weights, scaled, along, optimize=True))
        b = np.bincount(mesh.tets.ravel(), (weights[:, None] * scaled[:, :, i]).ravel(), len(phi))
        factor = factorise(A[1:, 1:])
        phi[1:, i] = factor.solve(b[1:])
        factors.append(factor)
    return LeastSquaresMap(phi, weights, tuple(factors))


def tet_weights(mesh: TetMesh) -> Float[np.ndarray, " n_t"]:
    """Volumes of the tets over their mean, but at least `SMALLEST_WEIGHT`."""
    return np.maximum(mesh.volumes / mesh.volumes.mean(), SMALLEST_WEIGHT)
