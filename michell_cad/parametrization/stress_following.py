"""Curves that follow the stress: past Arora et al. 2019, the alignment of the isocurves themselves.

Frames fitted to a stress field have curl, and the least squares of Eq. 11 average across it. Here the map phi itself is
moved so that its curves carry the stress. With rows g_i of J = grad phi, columns b_i of J^-1, n_i and t_i their
directions, h_i = |b_i| the edge of a truss cell, and A = dev sigma / |dev sigma|, the energy of a tet is

    W (sqrt(sum_{i != k} (n_i' A n_k)^2 + 0.01) + 2 sum_{i < k} (t_i . t_k)^2)
      + k_s w sum_i (h_i^2 + h_i^-2 - 2) + 0.01 w psi((det J - 0.05) / 0.25).

The first term asks the gradients to be conjugate in the stress: bars along the curves carry sigma exactly if and only
if g_i' sigma g_k = 0 for i != k. The second keeps the curves near right angles, the third the spacing near one, the
last is the barrier of `fold_barrier`. k_s falls from round to round, to a tenth of `spacing_weight`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from michell_cad.deviator import deviator
from michell_cad.linear_solver import factorise
from michell_cad.minimize import PATIENCE, minimize
from michell_cad.parametrization.equation_11 import free_vertices, tet_weights
from michell_cad.parametrization.fold_barrier import BARRIER_WIDTH, LEAST_DETERMINANT
from michell_cad.parametrization.following_energy import add_tets
from michell_cad.tet_mesh import TetMesh

SPACING_PER_WEIGHT = 0.1
"""The last k_s over `spacing_weight`."""
_FIRST_SPACING = 0.3
_SPACING_STEP = 10**0.5
"""k_s falls by this factor from round to round."""
_TRIAL_ITERATIONS = 30
"""The first round of each start is cut off here; what is still far down the field then has not come first in any of
the problems of the paper."""
_RIVAL, _SAME = 1.03, 1.001
"""Starts go on while their energy is within the first factor of the lowest one; those within the second of each other
have found the same map."""
_ITERATIONS, _MEMORY, _TOLERANCE = 60, 10, 2e-4
_LAST_ITERATIONS, _LAST_TOLERANCE, _LAST_PATIENCE = 200, 1e-4, 8
"""Of the last round. A bar in torsion creeps down a valley by 2e-4 a step for fifty steps before it comes to a much
better map; whether it does must not be left to rounding."""


def follow_stress(
    mesh: TetMesh,
    stress: Float[np.ndarray, "n_t 3 3"],
    spacing_weight: float,
    starts: Sequence[Float[np.ndarray, "n_v 3"]],
    ordering: np.ndarray | None = None,
    progress: Callable[[float], None] = lambda fraction: None,
) -> tuple[Float[np.ndarray, "n_v 3"], tuple[float, ...]]:
    """Minimise the energy of this module from injective starts; the best map, and the energies after the first round.

    All starts take part in the first round, the rivals of the best one in the second, and the best of these goes on
    alone: the order hardly ever changes later, and the later rounds cost most.

    Parameters
    ----------
    mesh : TetMesh
    stress : (n_t, 3, 3), MPa.
    spacing_weight : the paper's beta.
    starts : injective maps of any scale.
    ordering : of a `linear_solver.Factor` of a scalar system on the free vertices of this mesh, if there is one.
    progress : called with the finished fraction of the work.
    """
    energy = _FollowingEnergy(mesh, stress)
    rounds = _spacing_rounds(spacing_weight)

    def descend(phi: np.ndarray, number: int, precondition: Callable) -> tuple[float, np.ndarray]:
        energy.spacing = rounds[number]
        last = number == len(rounds) - 1
        phi, report = minimize(
            energy,
            phi,
            precondition,
            memory=_MEMORY,
            iterations=_LAST_ITERATIONS if last else _ITERATIONS if number else _TRIAL_ITERATIONS,
            tolerance=_LAST_TOLERANCE if last else _TOLERANCE,
            patience=_LAST_PATIENCE if last else PATIENCE,
        )
        return report.value, phi

    found = [(np.inf, np.ascontiguousarray(phi / _scale(mesh, phi))) for phi in starts]
    energies: tuple[float, ...] = ()
    for number, spacing in enumerate(rounds):
        stiffness = energy.weights_stress + 8 * spacing * energy.weights_volume
        precondition = _laplacian_preconditioner(mesh, stiffness, ordering)
        found = sorted((descend(phi, number, precondition) for _, phi in found), key=lambda entry: entry[0])
        energies = energies or tuple(value for value, _ in found)
        found = _rivals(found) if number == 0 else found[:1]
        progress((number + 1) / len(rounds))
    return found[0][1], energies


def _rivals(found: list[tuple[float, np.ndarray]]) -> list[tuple[float, np.ndarray]]:
    """Of maps in the order of their energies those that may still come first, see `_RIVAL`."""
    kept = found[:1]
    for value, phi in found[1:]:
        if _SAME * kept[-1][0] < value < _RIVAL * found[0][0]:
            kept.append((value, phi))
    return kept


def _scale(mesh: TetMesh, phi: np.ndarray) -> float:
    """The edge of a cell as large as the median one."""
    return float(np.median(np.linalg.det(mesh.gradients(phi))) ** (1 / 3))


def following_energy(
    mesh: TetMesh, stress: Float[np.ndarray, "n_t 3 3"], spacing_weight: float
) -> tuple[Callable[[np.ndarray], tuple[float, np.ndarray]], Float[np.ndarray, " n_t"], Float[np.ndarray, " n_t"]]:
    """The energy of the last round, about its second derivative by grad phi in each tet, and the weights w of tets."""
    energy = _FollowingEnergy(mesh, stress, _spacing_rounds(spacing_weight)[-1])
    return energy, energy.weights_stress + 8 * energy.spacing * energy.weights_volume, energy.weights_volume


def _spacing_rounds(spacing_weight: float) -> list[float]:
    last = SPACING_PER_WEIGHT * spacing_weight
    rounds = [last]
    while rounds[0] * _SPACING_STEP <= _FIRST_SPACING * 1.1:
        rounds.insert(0, rounds[0] * _SPACING_STEP)
    return rounds


def _laplacian_preconditioner(
    mesh: TetMesh, weights: np.ndarray, ordering: np.ndarray | None
) -> Callable[[np.ndarray], np.ndarray]:
    """The inverse of sum_t w_t |grad f|^2, near the Hessian of the energy: per tet, without volumes, as the energy is.

    With the energy's own dimension (1/mm^2) the first step has the right length whatever the size of the part.
    """
    free = free_vertices(mesh)
    factor = factorise(mesh.laplacian(weights / mesh.volumes)[free][:, free], ordering)

    def precondition(gradient: np.ndarray) -> np.ndarray:
        step = np.zeros_like(gradient)  # zero at the pins: a translation changes nothing
        step[free] = factor.solve(np.ascontiguousarray(gradient[free]))
        return step

    return precondition


@dataclass(eq=False)
class _FollowingEnergy:
    """Value and gradient of the energy; `spacing` is k_s."""

    mesh: TetMesh
    stress: Float[np.ndarray, "n_t 3 3"]
    spacing: float = _FIRST_SPACING

    def __post_init__(self) -> None:
        dev = deviator(self.stress)
        norm = np.linalg.norm(dev, axis=(1, 2))
        self._A = dev / np.where(norm > 0, norm, 1.0)[:, None, None]
        weights = self.mesh.volumes * norm
        self.weights_stress = weights / max(weights.mean(), np.finfo(float).tiny)
        self.weights_volume = tet_weights(self.mesh)

    def __call__(self, phi: np.ndarray) -> tuple[float, np.ndarray]:
        gradient = np.zeros_like(phi)
        value = add_tets(
            self.mesh.tets,
            self.mesh.hat_gradients,
            phi,
            self._A,
            self.weights_stress,
            self.weights_volume,
            self.spacing,
            LEAST_DETERMINANT,
            BARRIER_WIDTH,
            gradient,
        )
        return value, gradient
