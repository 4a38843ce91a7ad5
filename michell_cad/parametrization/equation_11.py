"""Least-squares integration of a frame field: Eq. 11 of Arora et al. 2019.

Departures: Eq. 11 couples nothing across coordinates, so it is solved as three scalar systems instead of one quadratic
program of three times the size; and its sums are weighted by volume, so that the mesh does not matter.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from michell_cad.linear_solver import Factor, factorise
from michell_cad.tet_mesh import TetMesh

SMALLEST_WEIGHT = 0.1
"""Weights are volumes over their mean, but at least this: slivers without weight make the fold barrier slow or fail."""
STIFFEST = 1e9
"""... up to slivers with this stiffness, w |grad|^2 over the median: beyond it systems are indefinite by rounding."""


@dataclass(frozen=True, eq=False)
class LeastSquaresMap:
    """The solution of Eq. 11, with what the fold barrier needs to go on from it.

    Parameters
    ----------
    phi : (n_v, 3) float, mm.
    weights : (n_t,) float, mean about 1: weight of each tet.
    factors : the three factorised systems of the free vertices.
    free : all vertices but one in each connected part; without these pins Eq. 11 leaves its translation open.
    """

    phi: Float[np.ndarray, "n_v 3"]
    weights: Float[np.ndarray, " n_t"]
    factors: tuple[Factor, ...]
    free: Int[np.ndarray, " n_free"] | slice

    def precondition(self, gradient: Float[np.ndarray, "n_v 3"]) -> Float[np.ndarray, "n_v 3"]:
        """Apply the inverse of the Hessian of Eq. 11 (up to a translation of each part)."""
        step = np.zeros_like(gradient)
        for i, factor in enumerate(self.factors):
            step[self.free, i] = 0.5 * factor.solve(np.ascontiguousarray(gradient[self.free, i]))
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
    free = free_vertices(mesh)
    factors: list[Factor] = []
    for i in range(3):
        penalty = np.ones(3)
        penalty[i] = spacing_weight
        scaled = along * penalty
        A = mesh.assemble(np.einsum("t,taj,tbj->tab", weights, scaled, along, optimize=True))
        b = np.bincount(mesh.tets.ravel(), (weights[:, None] * scaled[:, :, i]).ravel(), len(phi))
        factor = factorise(A[free][:, free], factors[0].ordering if factors else None)
        phi[free, i] = factor.solve(b[free])
        factors.append(factor)
    return LeastSquaresMap(centre_parts(mesh, phi), weights, tuple(factors), free)


def free_vertices(mesh: TetMesh) -> Int[np.ndarray, " n_free"] | slice:
    """All vertices but the first of each connected part; a slice where that does, which sparse matrices take faster."""
    _, pinned = np.unique(mesh.component_of_vertex, return_index=True)
    return slice(1, None) if len(pinned) == 1 else np.delete(np.arange(len(mesh.vertices)), pinned)


def centre_parts(mesh: TetMesh, phi: Float[np.ndarray, "n_v 3"]) -> Float[np.ndarray, "n_v 3"]:
    """Where the mesh has several connected parts, move the means of phi over each of them to zero.

    Nothing in the method says how the coordinates of one part lie to those of another. With all in the same place the
    longest part has the cells that the resolution asks for, however far apart the parts are.
    """
    part = mesh.component_of_vertex
    if not part.any():
        return phi
    volumes = np.bincount(part, mesh.vertex_volumes)
    means = np.stack([np.bincount(part, mesh.vertex_volumes * column) / volumes for column in phi.T], axis=1)
    return phi - means[part]


def tet_weights(mesh: TetMesh) -> Float[np.ndarray, " n_t"]:
    """Volumes of the tets over their mean, but at least `SMALLEST_WEIGHT`, of extreme slivers less, see `STIFFEST`."""
    steepest = np.einsum("tad,tad->ta", mesh.hat_gradients, mesh.hat_gradients).max(1)
    least = np.minimum(SMALLEST_WEIGHT, STIFFEST * np.median(steepest) / steepest)
    return np.maximum(mesh.volumes / mesh.volumes.mean(), least)
