"""A parametrization without folds: Eq. 11 with a barrier against inverted tets.

Eq. 11 of Arora et al. 2019 has no constraint against inverted tets, and most of the paper's problems have some. Every
constant rotation is injective and the boundary is free, so an injective map always exists. The energy here is that of
Eq. 11 plus mu sum w psi((det - d0)/dh), psi(s) = (1 - s)^2 / s for s < 1 and else 0: exactly Eq. 11 wherever the
determinant is above 0.3 of its median. Inverted tets are first untangled through the regularisation
chi = (d + sqrt(eps^2 + d^2))/2 of d = det - d0 (Garanzha et al. 2021, doi:10.1145/3450626.3459847, Eq. 4).
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from michell_cad.errors import ConvergenceError, InvalidInputError
from michell_cad.minimize import minimize
from michell_cad.parametrization.barrier_energy import add_tets
from michell_cad.parametrization.equation_11 import LeastSquaresMap
from michell_cad.parametrization.quality import count_double_wound_edges
from michell_cad.tet_mesh import TetMesh

LEAST_DETERMINANT = 0.05
"""d0: determinants stay above this fraction of their median."""
BARRIER_WIDTH = 0.25
"""dh: the barrier starts this fraction of the median above d0."""
BARRIER_WEIGHT = 0.1
"""mu, in units of the mean energy of Eq. 11."""
_ROUNDS, _ROUND_ITERATIONS, _FINAL_ITERATIONS = 20, 10, 60
_REGULARISATION = 0.2
"""eps over the worst |d|, and its floor over dh."""
_STIFFEN = 4.0
"""Factor on mu in a round that could not lower eps any more."""
_TOLERANCE = 1e-5
"""Relative decrease at which the minimisation from the solution of Eq. 11 has converged."""
_INTERIOR_WEIGHTS, _INTERIOR_ITERATIONS, _INTERIOR_TOLERANCE = (1000.0, 100.0, 10.0, 1.0), 300, 3e-6
"""The barrier falls to its weight in steps, each minimised until it has converged. A first barrier ten times softer, or
a first step cut short, is caught among tets near inversion, takes three times the iterations, and ends where rounding
takes it; like this the map is the one found from the solution of Eq. 11, to five digits of its energy.
"""


@dataclass(eq=False)
class BarrierEnergy:
    """Value and gradient of Eq. 11 with barrier; `eps` and `stiffness`, a factor on mu, vary from round to round.

    Its second derivative by grad phi in a tet is about twice the tet's weight.
    """

    mesh: TetMesh
    frames: Float[np.ndarray, "n_t 3 3"]
    spacing_weight: float
    linear: LeastSquaresMap
    eps: float = 0.0
    stiffness: float = 1.0
    least: float = field(default=0.0, init=False)
    """The smallest det - d0 at the last evaluation."""

    def __post_init__(self) -> None:
        self.scale = float(np.median(self._determinants(self.linear.phi)))
        if self.scale <= 0:  # a map this bad says nothing about scale; the frames' own is 1
            self.scale = 1.0
        self.d0, self.dh = LEAST_DETERMINANT * self.scale, BARRIER_WIDTH * self.scale
        self.mu = 0.0
        self.eps = self.dh  # any: without weight the barrier only must not stop the evaluation
        mean_energy = self(self.linear.phi)[0] / self.linear.weights.sum()
        self.mu, self.eps = BARRIER_WEIGHT * max(mean_energy, np.finfo(float).eps), 0.0

    def feasible(self, phi: np.ndarray) -> bool:
        return bool(self._determinants(phi).min() > self.d0)

    def __call__(self, phi: np.ndarray) -> tuple[float, np.ndarray]:
        gradient = np.zeros_like(phi)
        value, self.least = add_tets(
            self.mesh.tets,
            self.mesh.hat_gradients,
            self.frames,
            phi,
            self.linear.weights,
            self.spacing_weight,
            self.mu * self.stiffness,
            self.d0,
            self.dh,
            self.eps,
            gradient,
        )
        return value, gradient

    def _determinants(self, phi: np.ndarray) -> np.ndarray:
        return np.linalg.det(self.mesh.gradients(phi))


def remove_folds(
    mesh: TetMesh,
    frames: Float[np.ndarray, "n_t 3 3"],
    spacing_weight: float,
    linear: LeastSquaresMap,
    progress: Callable[[float], None] = lambda fraction: None,
) -> Float[np.ndarray, "n_v 3"]:
    """Minimise Eq. 11 with the barrier: first from its linear solution, else as interior point from a rotation.

    Raises
    ------
    InvalidInputError
        If that is because the tets of the mesh itself overlap.
    ConvergenceError
        If neither way ends in a map without inverted tets and doubly wound edges.
    """
    energy = BarrierEnergy(mesh, frames, spacing_weight, linear)
    phi = _untangle(energy, linear)
    if energy.feasible(phi):
        energy.eps, energy.stiffness = 0.0, 1.0
        phi, _ = minimize(energy, phi, linear.precondition, iterations=_FINAL_ITERATIONS, tolerance=_TOLERANCE)
        if count_double_wound_edges(mesh, phi) == 0:
            return phi
    progress(0.5)
    phi = energy.scale ** (1 / 3) * (mesh.vertices - mesh.vertices.mean(0)) @ _nearest_rotation(mesh, linear.phi).T
    phi = lower_barrier(energy, energy, phi, linear.precondition)
    require_injective(mesh, phi)
    return phi


def lower_barrier(
    barrier: BarrierEnergy,
    energy: Callable[[np.ndarray], tuple[float, np.ndarray]],
    phi: Float[np.ndarray, "n_v 3"],
    precondition: Callable[[np.ndarray], np.ndarray],
) -> Float[np.ndarray, "n_v 3"]:
    """Minimise from a map without folds while the barrier, a part of the energy, falls to its weight in steps."""
    for factor in _INTERIOR_WEIGHTS:
        barrier.stiffness, barrier.eps = factor, 0.0
        phi, _ = minimize(
            energy, phi, precondition, iterations=_INTERIOR_ITERATIONS, tolerance=_INTERIOR_TOLERANCE * factor
        )
    return phi


def untangled_start(
    mesh: TetMesh, frames: Float[np.ndarray, "n_t 3 3"], spacing_weight: float, linear: LeastSquaresMap
) -> Float[np.ndarray, "n_v 3"] | None:
    """An injective map near the solution of Eq. 11, good enough to start from; None if there is none close by."""
    energy = BarrierEnergy(mesh, frames, spacing_weight, linear)
    phi = _untangle(energy, linear)
    return phi if energy.feasible(phi) and count_double_wound_edges(mesh, phi) == 0 else None


def require_injective(mesh: TetMesh, phi: Float[np.ndarray, "n_v 3"]) -> None:
    """Refuse a map with inverted tets or doubly wound edges.

    Raises
    ------
    InvalidInputError
        If that is because the tets of the mesh itself overlap.
    ConvergenceError
        Otherwise.
    """
    if np.linalg.det(mesh.gradients(phi)).min() > 0 and count_double_wound_edges(mesh, phi) == 0:
        return
    overlaps = count_double_wound_edges(mesh, mesh.vertices)
    if overlaps:
        raise InvalidInputError(
            f"the tets of the mesh overlap: around {overlaps} inner edges they do not close to one full turn. "
            "Mesh the part again"
        )
    raise ConvergenceError(
        "the parametrization could not be freed of folds; use a finer mesh, or a larger spacing_weight"
    )


def _untangle(energy: BarrierEnergy, linear: LeastSquaresMap) -> np.ndarray:
    """From the solution of Eq. 11 to positive determinants, if the rounds suffice."""
    phi = linear.phi
    energy(phi)
    floor = _REGULARISATION * energy.dh
    energy.eps = np.inf
    for _ in range(_ROUNDS):
        if energy.least > 0:
            break
        eps = max(min(_REGULARISATION * abs(energy.least), energy.eps / 2), floor)
        energy.stiffness *= _STIFFEN if eps >= energy.eps else 1.0
        energy.eps = eps
        phi, _ = minimize(
            energy, phi, linear.precondition, iterations=_ROUND_ITERATIONS, stop=lambda value: energy.least > 0
        )
        energy(phi)
    return phi


def _nearest_rotation(mesh: TetMesh, phi: np.ndarray) -> np.ndarray:
    """The rotation Q nearest to the best affine map x -> Q x of phi."""
    m = mesh.vertex_volumes
    x = mesh.vertices - (m @ mesh.vertices) / m.sum()
    U, _, Vt = np.linalg.svd(np.einsum("v,vi,vj->ij", m, phi, x))
    U[:, 2] *= np.linalg.det(U @ Vt)
    return U @ Vt
