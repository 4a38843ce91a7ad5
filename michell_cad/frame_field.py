"""A smooth field of orthonormal frames that follows the principal stresses.

Arora et al. 2019, Section 4.2 (doi:10.1145/3328939.3328999), Eqs. 1-7: per-vertex rotation vectors, the matrix
exponential of their mean in each tet, the truncated matching energy of Eq. 4, and the smoothness energy of Eq. 5 with a
weight that is lowered step by step.

Departures:

1. All terms are integrals over the part, made dimensionless by its volume and size, so that neither the mesh nor the
   unit of length matters. (With the reference's weight, proportional to the number of tets, a finer mesh leaves the
   frames near the identity.)
2. The rotation vectors are relative to a constant frame R0, R = R0 exp [w]_x, instead of the world's axes: Eq. 5 draws
   the frames towards w = 0, and turning the part would otherwise change the answer. R0 is a locally best constant
   frame; several are tried, the lowest data energy is kept.
3. Continuation takes a few large steps instead of thirty small ones, each by L-BFGS with Jacobi scaling, which is what
   sliver meshes need.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float

from michell_cad.arrays import freeze, require
from michell_cad.constant_frames import constant_frames
from michell_cad.deviator import ISOTROPIC
from michell_cad.elasticity import StressField
from michell_cad.matching_energy import add_tets
from michell_cad.minimize import minimize
from michell_cad.rotations import rotation_matrix
from michell_cad.tet_mesh import TetMesh

STRETCH = 10.0
"""Largest eigenvalue of the rescaled stress (Eq. 2; the paper's k = 10)."""

_EARLY = 10.0
"""Rounds before the last converge to this many times its tolerance."""


@dataclass(frozen=True)
class FrameFieldOptions:
    """Options of `fit_frame_field`.

    Parameters
    ----------
    starts : number of constant frames to start from.
    smoothness : weights of the smoothness energy, one round of L-BFGS each (relative to a data energy of order one).
        The last one is a compromise: at 1e-4 the frames follow the stress more closely still, but have so much more
        curl that the curves integrated from them follow it less.
    iterations : largest number of L-BFGS iterations in each round.
    tolerance : relative decrease of the energy at which the last round has converged; those before need less.
    """

    starts: int = 3
    smoothness: tuple[float, ...] = (1.0, 1e-1, 2e-2, 5e-3)
    iterations: int = 40
    tolerance: float = 1e-4

    def __post_init__(self) -> None:
        require(self.starts >= 1, f"starts must be at least 1, found {self.starts}")
        require(len(self.smoothness) > 0 and min(self.smoothness) > 0, "smoothness needs at least one positive weight")


@dataclass(frozen=True, eq=False)
class FrameField:
    """One right-handed orthonormal frame per tet.

    Parameters
    ----------
    frames : (n_t, 3, 3) float; the columns are the axes r1, r2, r3; r1 follows the largest principal stress.
    data_energy : mean over the volume of Eq. 4.
    least_data_energy : its lower bound, every frame at its own best.
    start_energies : data energies that the starts ended with; the lowest was kept.
    """

    frames: Float[np.ndarray, "n_t 3 3"]
    data_energy: float
    least_data_energy: float
    start_energies: tuple[float, ...]

    def __post_init__(self) -> None:
        freeze(self, frames=np.float64)


def fit_frame_field(
    mesh: TetMesh,
    stress_field: StressField,
    options: FrameFieldOptions | None = None,
    progress: Callable[[float], None] = lambda fraction: None,
) -> FrameField:
    """Fit frames R = R0 exp [w]_x, w the mean of four vertex vectors, to the principal stresses.

    Minimises  1/|V| sum_t v_t (|r2|_{sigma+} + |r3|_{sigma+}) + alpha E_s  for falling alpha, where |r|_A^2 = r' A r,
    sigma+ is the stress with its eigenvalues mapped linearly to [1, 10] (Eqs. 1-4), and
    E_s = 1/(2|V|) integral of (l^2 |grad w|^2 + |w|^2) with l = |V|^(1/3) (Eq. 5, lumped mass).

    Parameters
    ----------
    mesh : TetMesh
    stress_field : StressField
    options : FrameFieldOptions
    progress : called with the finished fraction of the work.

    Returns
    -------
    FrameField
        Of all starts the one with the lowest data energy.
    """
    options = options or FrameFieldOptions()
    metric, least = matching_metric(stress_field.stress)
    weights = mesh.volumes / mesh.volumes.sum()
    starts = constant_frames(mesh, metric, options.starts)
    results = []
    for number, R0 in enumerate(starts):
        A = R0.T @ metric @ R0
        w = _fit_from(mesh, weights, A, options)
        results.append((add_tets(mesh.tets, weights, A, w, np.zeros_like(w)), R0, w))
        progress((number + 1) / len(starts))
    energies = tuple(energy for energy, _, _ in results)
    _, R0, w = results[int(np.argmin(energies))]
    return FrameField(R0 @ rotation_matrix(w[mesh.tets].mean(1)), min(energies), float(weights @ least), energies)


def matching_metric(
    stress: Float[np.ndarray, "n_t 3 3"],
) -> tuple[Float[np.ndarray, "n_t 3 3"], Float[np.ndarray, " n_t"]]:
    """sigma+ of Eqs. 1 and 2, and the least value of Eq. 4 that a frame can have in each tet.

    The eigenvalues lambda become 1 + 9 (lambda - lambda_3)/(lambda_1 - lambda_3); sigma+ = I where all three agree.
    """
    values, vectors = np.linalg.eigh(stress)
    gap = values[:, 2] - values[:, 0]
    directed = gap > ISOTROPIC * np.abs(values).max()
    scaled = np.ones_like(values)
    scaled[directed] = 1 + (STRETCH - 1) * (values[directed] - values[directed, :1]) / gap[directed, None]
    metric = np.einsum("tik,tk,tjk->tij", vectors, scaled, vectors, optimize=True)
    return metric, np.sqrt(scaled[:, 0]) + np.sqrt(scaled[:, 1])


def _fit_from(mesh: TetMesh, weights: np.ndarray, A: np.ndarray, options: FrameFieldOptions) -> np.ndarray:
    """Rotation vectors at the vertices, relative to the constant frame in whose axes the metric A is given."""
    smoothness = (mesh.size**2 * mesh.laplacian() + sp.diags(mesh.vertex_volumes)) / mesh.volumes.sum()
    w = np.zeros((len(mesh.vertices), 3))
    # The data term's second derivative is of order one per tet and axis; a vertex takes part with a factor of 1/4.
    data_diagonal = 0.25 * mesh.vertex_volumes / mesh.volumes.sum()
    for alpha in options.smoothness:
        H = sp.csr_matrix(alpha * smoothness)
        diagonal = (H.diagonal() + data_diagonal)[:, None]

        def energy(w: np.ndarray, H: sp.csr_matrix = H) -> tuple[float, np.ndarray]:
            gradient = H @ w
            smooth = 0.5 * float(np.vdot(w, gradient))
            return smooth + add_tets(mesh.tets, weights, A, w, gradient), gradient

        last = alpha == options.smoothness[-1]
        w, _ = minimize(
            energy,
            w,
            lambda g, d=diagonal: g / d,
            iterations=options.iterations,
            tolerance=options.tolerance * (1 if last else _EARLY),
        )
    return w
