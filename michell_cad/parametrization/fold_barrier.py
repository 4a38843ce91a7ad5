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
from michell_cad.parametrization.equation_11 import LeastSquaresMap
from michell_cad.parametrization.jacobians import (
    Components,
    MapDerivative,
    cofactors,
    determinants,
    product,
    transposed,
)
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
_INTERIOR_WEIGHTS, _INTERIOR_ITERATIONS = (100.0, 10.0, 1.0), 100


def barrier(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """psi(s) = (1 - s)^2/s for 0 < s < 1, else 0, and its derivative; s must be positive."""
    inside = s < 1
    s = np.where(inside, s, 1.0)
    return (1 - s) ** 2 / s, np.where(inside, 1 - 1 / (s * s), 0.0)


def remove_folds(
    mesh: TetMesh,
    derivative: MapDerivative,
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
    energy = _BarrierEnergy(derivative, frames, spacing_weight, linear)
    phi = _untangle(energy, linear)
    progress(0.5)
    if energy.feasible(phi) and count_double_wound_edges(mesh, phi) == 0:
        return phi
    phi = energy.scale ** (1 / 3) * (mesh.vertices - mesh.vertices.mean(0)) @ _nearest_rotation(mesh, linear.phi).T
    for factor in _INTERIOR_WEIGHTS:
        energy.stiffness, energy.eps = factor, 0.0
        phi, _ = minimize(energy, phi, linear.precondition, iterations=_INTERIOR_ITERATIONS)
    if energy.feasible(phi) and count_double_wound_edges(mesh, phi) == 0:
        return phi
    overlaps = count_double_wound_edges(mesh, mesh.vertices)
    if overlaps:
        raise InvalidInputError(
            f"the tets of the mesh overlap: around {overlaps} inner edges they do not close to one full turn. "
            "Mesh the part again"
        )
    raise ConvergenceError(
        "the parametrization could not be freed of folds; use a finer mesh, or a larger spacing_weight"
    )


def barrier_energy(
    derivative: MapDerivative, frames: Float[np.ndarray, "n_t 3 3"], spacing_weight: float, linear: LeastSquaresMap
) -> tuple[Callable[[np.ndarray], tuple[float, np.ndarray]], Float[np.ndarray, " n_t"], Float[np.ndarray, " n_t"]]:
    """The energy of Eq. 11 with barrier, about its second derivative by grad phi in each tet, and the tets' weights."""
    return _BarrierEnergy(derivative, frames, spacing_weight, linear), 2 * linear.weights, linear.weights


@dataclass(eq=False)
class _BarrierEnergy:
    """Value and gradient of Eq. 11 with barrier; `eps` and `stiffness` vary from round to round."""

    derivative: MapDerivative
    frames: Float[np.ndarray, "n_t 3 3"]
    spacing_weight: float
    linear: LeastSquaresMap
    eps: float = 0.0
    stiffness: float = 1.0
    least: float = field(default=0.0, init=False)
    """The smallest det - d0 at the last evaluation."""

    def __post_init__(self) -> None:
        self._R = np.ascontiguousarray(self.frames.transpose(1, 2, 0))
        J = self.derivative.jacobians(self.linear.phi)
        self.scale = float(np.median(determinants(J, cofactors(J))))
        if self.scale <= 0:  # a map this bad says nothing about scale; the frames' own is 1
            self.scale = 1.0
        self.d0, self.dh = LEAST_DETERMINANT * self.scale, BARRIER_WIDTH * self.scale
        mean_energy = self._equation_11(J)[0] / self.linear.weights.sum()
        self.mu = BARRIER_WEIGHT * max(mean_energy, np.finfo(float).eps)

    def feasible(self, phi: np.ndarray) -> bool:
        J = self.derivative.jacobians(phi)
        return bool(determinants(J, cofactors(J)).min() > self.d0)

    def __call__(self, phi: np.ndarray) -> tuple[float, np.ndarray]:
        w = self.linear.weights
        J = self.derivative.jacobians(phi)
        C = cofactors(J)
        d = determinants(J, C) - self.d0
        self.least = float(d.min())
        if self.eps == 0 and self.least <= 0:
            return np.inf, phi
        value, P = self._equation_11(J)
        root = np.sqrt(self.eps**2 + d * d)
        # chi = (d + root)/2, for negative d in the form that does not cancel
        chi = np.where(d > 0, (d + root) / 2, self.eps**2 / (2 * (root - np.minimum(d, 0.0))))
        psi, slope = barrier(chi / self.dh)
        mu = self.mu * self.stiffness
        value += mu * float(w @ psi)
        P += (mu / self.dh) * (w * slope * chi / root) * C  # d chi / d d = chi / root
        return value, self.derivative.pull_back(P)

    def _equation_11(self, J: Components) -> tuple[float, Components]:
        D = product(J, self._R)
        penalty = np.ones((3, 3, 1))
        penalty[range(3), range(3)] = self.spacing_weight
        D[range(3), range(3)] -= 1
        weighted = self.linear.weights * penalty * D
        return float(np.vdot(weighted, D)), 2 * product(weighted, transposed(self._R))


def _untangle(energy: _BarrierEnergy, linear: LeastSquaresMap) -> np.ndarray:
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
    if energy.least <= 0:
        return phi
    energy.eps, energy.stiffness = 0.0, 1.0
    phi, _ = minimize(energy, phi, linear.precondition, iterations=_FINAL_ITERATIONS, tolerance=1e-5)
    return phi


def _nearest_rotation(mesh: TetMesh, phi: np.ndarray) -> np.ndarray:
    """The rotation Q nearest to the best affine map x -> Q x of phi."""
    m = mesh.vertex_volumes
    x = mesh.vertices - (m @ mesh.vertices) / m.sum()
    U, _, Vt = np.linalg.svd(np.einsum("v,vi,vj->ij", m, phi, x))
    U[:, 2] *= np.linalg.det(U @ Vt)
    return U @ Vt
