"""How stiff any structure of the same material in the same part can be, in voxels.

Densities rho of voxels, 0 <= rho <= 1, sum_e v rho_e = V, make the compliance c(rho) = sum_c w_c f_c . u_c smallest,
K(rho^p) u_c = f_c (Bendsoe and Sigmund 2003, Topology Optimization, Chapter 1; SIMP).

p = 1, the variable-thickness sheet, is convex (Svanberg 1984), and every structure is one of its points, if densities
may change within voxels. For any displacements u

    c(rho) >= sum_c w_c (2 f_c . u_c) - integral of rho e,   e = sum_c w_c eps(u_c) : C : eps(u_c),

so that, with u scaled for the best, F = sum_c w_c f_c . u_c and M = max over all rho of the integral of rho e (the
places of the largest e, full), none has a compliance below F^2 / M. With e integrated over voxels this is a certificate
for densities that are constant in them, and tells how good those that were found are; with e point by point it holds
for all structures of that volume in the part, also of members thinner than voxels, but for what voxels do to the part
(its staircase, and supports that move by a fraction of a voxel). The two approach each other as voxels get smaller.

p = 3 makes densities between cost more than they give: a design of full and empty voxels (a local optimum of a problem
that is not convex).

Departures from the textbook: the p = 3 design starts from that of p = 1; the filter of the sensitivities (Sigmund 2001,
doi:10.1007/s001580050176, Eq. 5), which keeps checkerboards away, is left out in the last round, so that no grey rim
stays around the members.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from scipy.spatial import KDTree

from michell_cad.arrays import freeze, require
from michell_cad.errors import ConvergenceError
from michell_cad.problem import DesignProblem
from michell_cad.strength.comparison.voxel_model import VoxelModel, build_voxel_model
from michell_cad.strength.comparison.voxel_stiffness import VoxelStiffness, require_voxel_memory

VOID = 1e-6
"""Modulus of empty voxels over that of full ones, so that K stays regular."""

LEAST_DENSITY = 1e-3
"""Densities stay above this (relative to their mean): at zero they could not come back."""

LEAST_GAIN = 1e-12
"""Smaller sensitivities (relative to the largest) count as this."""

HALVINGS = 60
"""Of the interval of multipliers; it is some hundred wide, in logarithms."""

FILTER_RADIUS = 1.5
"""Of the filter of sensitivities, in voxels: the next ones across faces and edges."""

SHEET_POWER, SHEET_MOVE = 0.7, 1.0
"""Power of the update and largest change of a density for p = 1: the textbook's 0.5, with which a statically
determinate truss needs one step, takes half as many steps again."""

PENALTY_POWER, PENALTY_MOVE = 0.5, 0.2
"""The same for p > 1, as in the textbook."""

PENALTIES = ((1.5, 4), (2.0, 6), (2.5, 6), (3.0, 20))
"""Penalties p and how many steps each is in force."""

LAST_STEPS = 20
"""Steps without the filter, at most."""

SETTLED = 2e-3
"""The last round ends when a step lowers the compliance by less than this (relative)."""


@dataclass(frozen=True)
class VoxelOptions:
    """Options of `optimise_voxels`.

    Parameters
    ----------
    count : voxels in the part, about.
    gap : the densities of p = 1 are good enough when their compliance is within this of the bound (relative).
    steps : to get there, at most.
    """

    count: int = 8000
    gap: float = 0.01
    steps: int = 200

    def __post_init__(self) -> None:
        require(self.count >= 1, f"the number of voxels must be at least 1, found {self.count}")
        require(0 < self.gap < 1, f"gap must lie between 0 and 1, found {self.gap}")
        require(self.steps >= 1, f"steps must be at least 1, found {self.steps}")


@dataclass(frozen=True, eq=False)
class VoxelDesign:
    """Optimal densities.

    Parameters
    ----------
    model : the voxels.
    least_compliance : no structure of the volume has a smaller one, N mm.
    sheet_density, sheet_compliance : of p = 1, (n_e,) float in [0, 1] and N mm.
    density, compliance : of p = 3.
    """

    model: VoxelModel
    least_compliance: float
    sheet_density: Float[np.ndarray, " n_e"]
    sheet_compliance: float
    density: Float[np.ndarray, " n_e"]
    compliance: float

    def __post_init__(self) -> None:
        freeze(self, sheet_density=np.float64, density=np.float64)

    @property
    def grey(self) -> float:
        """Mean of 4 rho (1 - rho) over V: zero for full and empty voxels, near 4 where all is thin."""
        return float((4 * self.density * (1 - self.density)).sum() / self.density.sum())


def optimise_voxels(
    problem: DesignProblem,
    volume: float,
    options: VoxelOptions = VoxelOptions(),
    progress: Callable[[float], None] = lambda fraction: None,
) -> VoxelDesign:
    """The least compliance of a volume of material, mm^3, in the voxels of a part; see the module.

    Raises
    ------
    InvalidInputError
        For more material than voxels, what `build_voxel_model` refuses, or matrices that would not fit in memory.
    ConvergenceError
        If the bound is not reached in so many steps.
    """
    model = build_voxel_model(problem, options.count)
    share = volume / model.volume
    require(
        np.isfinite(volume) and 0 < share <= 1,
        f"the volume of the material must be positive and at most that of the voxels, {model.volume:.4g} mm3, found "
        f"{volume:.4g} mm3: a volume fraction above 1 has no structure",
    )
    stiffness = VoxelStiffness(model, problem.material)
    sheet = stiffest_sheet(stiffness, share, options.gap, options.steps)
    least = compliance_bound(sheet.compliance, stiffness.point_energies(sheet.displacements), share)
    progress(0.3)
    density, compliance = full_or_empty(stiffness, sheet.density, share, lambda part: progress(0.3 + 0.7 * part))
    return VoxelDesign(model, least, sheet.density, sheet.compliance, density, compliance)


def require_voxels(problem: DesignProblem, count: int) -> None:
    """Refuse a number of voxels that would not fit in memory or not stand for the part, before any time is spent.

    Raises
    ------
    InvalidInputError
        As `optimise_voxels`.
    """
    require_voxel_memory(VoxelOptions(count).count)
    build_voxel_model(problem, count)


class Sheet(NamedTuple):
    """Densities for p = 1, their displacements, mm, and compliance, N mm, and what no densities of voxels go below."""

    density: Float[np.ndarray, " n_e"]
    displacements: Float[np.ndarray, "n_c n_n 3"]
    compliance: float
    bound: float


def stiffest_sheet(stiffness: VoxelStiffness, share: float, gap: float, steps: int) -> Sheet:
    """p = 1: densities whose mean is `share` and whose compliance is at most by `gap` (relative) above the bound.

    Raises
    ------
    ConvergenceError
        If the gap is not reached.
    """
    density, bound = np.full(len(stiffness.model.corners), share), 0.0
    for _ in range(steps):
        u = stiffness.solve(moduli(density, 1.0))
        compliance, energies = stiffness.work(u), stiffness.energies(u)
        bound = max(bound, compliance_bound(compliance, energies, share))
        if bound >= (1 - gap) * compliance:
            return Sheet(density, u, compliance, bound)
        density = update_density(density, energies, share, SHEET_POWER, SHEET_MOVE)
    raise ConvergenceError(
        f"the stiffness bound in voxels is {1 - bound / compliance:.1%} below the best densities after {steps} steps, "
        f"wanted {gap:.1%}: allow more steps, or a larger gap"
    )


def compliance_bound(work: float, energies: Float[np.ndarray, "..."], share: float) -> float:
    """F^2 / M of the module, N mm: from F = sum_c w_c f_c . u_c and the energies of any displacements in equal parts of
    the volume, all full."""
    falling = -np.sort(-energies, axis=None)
    full = share * len(falling)
    whole = min(int(full), len(falling))
    rest = (full - whole) * falling[whole] if whole < len(falling) else 0.0
    return work**2 / float(falling[:whole].sum() + rest)


def full_or_empty(
    stiffness: VoxelStiffness,
    density: Float[np.ndarray, " n_e"],
    share: float,
    progress: Callable[[float], None] = lambda fraction: None,
) -> tuple[Float[np.ndarray, " n_e"], float]:
    """p = 3 from the densities of p = 1: densities that are nearly 0 or 1, and their compliance."""
    smooth = _filter(stiffness.model)
    total, done = sum(count for _, count in PENALTIES) + LAST_STEPS, 0
    for p, count in PENALTIES:
        for _ in range(count):
            gain = sensitivity(stiffness, density, p)[1]
            # The filter of Sigmund is that of density times sensitivity.
            gain = (smooth @ (density * gain)) / density
            density = update_density(density, gain, share, PENALTY_POWER, PENALTY_MOVE)
            done += 1
            progress(done / total)
    p, best = PENALTIES[-1][0], (density, np.inf)
    for _ in range(LAST_STEPS):
        compliance, gain = sensitivity(stiffness, density, p)
        settled = compliance > (1 - SETTLED) * best[1]
        best = min(best, (density, compliance), key=lambda item: item[1])
        if settled:
            break
        density = update_density(density, gain, share, PENALTY_POWER, PENALTY_MOVE)
        done += 1
        progress(done / total)
    progress(1.0)
    return best


def moduli(density: Float[np.ndarray, " n_e"], p: float) -> Float[np.ndarray, " n_e"]:
    """VOID + (1 - VOID) rho^p."""
    return VOID + (1 - VOID) * density**p


def sensitivity(
    stiffness: VoxelStiffness, density: Float[np.ndarray, " n_e"], p: float
) -> tuple[float, Float[np.ndarray, " n_e"]]:
    """Compliance c, N mm, and -dc/drho_e = (1 - VOID) p rho_e^(p - 1) e_e."""
    u = stiffness.solve(moduli(density, p))
    return stiffness.work(u), (1 - VOID) * p * density ** (p - 1) * stiffness.energies(u)


def update_density(
    density: Float[np.ndarray, " n_e"], gain: Float[np.ndarray, " n_e"], share: float, power: float, move: float
) -> Float[np.ndarray, " n_e"]:
    """One step of the optimality criteria: rho (gain / l)^power within bounds, l such that the mean is `share`."""
    lowest, highest = np.maximum(LEAST_DENSITY * share, density - move), np.minimum(1, density + move)
    pull = np.log(np.maximum(gain, LEAST_GAIN * gain.max()))

    def updated(log_l: float) -> np.ndarray:
        return np.clip(density * np.exp(power * (pull - log_l)), lowest, highest)

    # At the ends all densities are at a bound.
    reach = -np.log(lowest.min()) / power
    low, high = pull.min() - reach, pull.max() + reach
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if updated(middle).mean() > share else (low, middle)
    return updated(high)


def _filter(model: VoxelModel) -> sp.csr_matrix:
    """Mean over the voxels within `FILTER_RADIUS`, weighted by what is left of it."""
    n = len(model.places)
    i, j = KDTree(model.places).query_pairs(FILTER_RADIUS, output_type="ndarray").T
    weight = FILTER_RADIUS - np.linalg.norm(model.places[i] - model.places[j], axis=1)
    half = sp.csr_matrix((weight, (i, j)), shape=(n, n))
    whole = half + half.T + FILTER_RADIUS * sp.identity(n)
    return sp.csr_matrix(sp.diags(1 / np.asarray(whole.sum(1)).ravel()) @ whole)
