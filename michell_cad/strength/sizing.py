"""Radii that suit the loads: every member gets the area that its share of the work asks for, at a given total volume.

Two criteria, both met by resizing A_m <- A_m (d_m / lambda)^eta_m within bounds, lambda such that the volume is kept:

1. "compliance": the least compliance sum_c w_c f_c . u_c. Its derivative by the area A of a member is
   -(e2 + 2 e4) / A with the member's energies e2 (axial and shear, which go with 1 / A) and e4 (bending and torsion,
   with 1 / A^2), so at the optimum d = (e2 + 2 e4) / (A L) is the same for all members within their bounds (Prager's
   criterion; Rozvany, Structural Design via Optimality Criteria, 1989).
2. "stress": all members within their bounds reach the same peak stress d in the worst case: the fully stressed design.

The exponent that is exact where the forces do not change is one over the power of A with which d falls.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float

from michell_cad.arrays import require
from michell_cad.errors import ConvergenceError
from michell_cad.knobs import LARGEST_RADIUS_RATIO
from michell_cad.problem import Material
from michell_cad.strength.beam_model import BeamModel, build_beam_model
from michell_cad.strength.beam_solution import BeamSolution
from michell_cad.strength.beam_solver import solve_beams
from michell_cad.strength.loads import TrussLoading
from michell_cad.truss import SizedTruss, Truss

SMALLEST_RADIUS_SHARE = 0.2
"""Default smallest radius over the radius of equal members of the same volume: 4 % of their area."""

RELAXATION = {"compliance": 1.6, "stress": 1.0}
"""Factor of the exponents that are exact at fixed forces. Stiffer members draw force, so the compliance falls twice as
fast with a factor between 1.4 and 1.7; with 1.9 it oscillates."""

LARGEST_STEP = 4.0
"""An area changes by this factor at most in one step."""

BISECTIONS = 100
"""Halvings of the interval of log lambda: to the last digit."""


@dataclass(frozen=True)
class SizingOptions:
    """Options of `size_members`.

    Parameters
    ----------
    criterion : "compliance" or "stress".
    smallest_radius : mm. Default: `SMALLEST_RADIUS_SHARE` of the radius that equal members would have.
    largest_radius : mm. Default: `LARGEST_RADIUS_RATIO` of the spacing.
    straight : whether members are taken along their chords or along their curves.
    tolerance : relative. The radii have converged when the mean change of the areas in a step, weighted by volume, has
        fallen to this. 5e-3 takes 15 to 70 steps on the paper's problems and is within 1 % of the least compliance.
    steps : largest number.
    """

    criterion: Literal["compliance", "stress"] = "compliance"
    smallest_radius: float | None = None
    largest_radius: float | None = None
    straight: bool = True
    tolerance: float = 5e-3
    steps: int = 200

    def __post_init__(self) -> None:
        require(0 < self.tolerance < 1, f"tolerance must lie between 0 and 1, found {self.tolerance}")
        require(self.steps >= 1, f"steps must be at least 1, found {self.steps}")
        for name in ("smallest_radius", "largest_radius"):
            value = getattr(self, name)
            require(value is None or (np.isfinite(value) and value > 0), f"{name} must be positive, found {value}")


@dataclass(frozen=True, eq=False)
class SizingReport:
    """How a sizing ended.

    Parameters
    ----------
    converged : bool
    compliances : weighted sum over the load cases, N mm, of equal members first, then after every step but the last.
    change : the last mean change of the areas.
    """

    converged: bool
    compliances: tuple[float, ...]
    change: float


def size_members(
    truss: Truss,
    material: Material,
    loading: TrussLoading,
    volume: float,
    options: SizingOptions = SizingOptions(),
    strict: bool = True,
) -> tuple[SizedTruss, SizingReport]:
    """Give every member a constant radius of its own, at a total volume (sum of pi r^2 L) in mm^3.

    Parameters
    ----------
    truss, material, loading : what carries what.
    volume : mm^3; what members share at nodes counts for each of them.
    options : SizingOptions
    strict : whether not to converge is an error.

    Raises
    ------
    InvalidInputError
        If no radii within the bounds have this volume, or the truss is a mechanism.
    ConvergenceError
        If the radii have not settled after all steps.
    """
    model = build_beam_model(SizedTruss(truss, np.ones((len(truss.members), 3))), material, options.straight)
    lengths = np.bincount(model.member_of_element, model.lengths, len(truss.members))
    smallest, largest = _area_bounds(truss, lengths, volume, options)
    areas = np.full(len(lengths), volume / lengths.sum())
    compliances: list[float] = []
    change = np.inf
    for _ in range(options.steps):
        solution = solve_beams(_with_areas(model, areas), loading)
        compliances.append(float(loading.weights @ solution.compliances))
        if change <= options.tolerance:
            break
        demand, exponent = _demand(solution, loading, areas * lengths, options.criterion)
        low = np.maximum(smallest, areas / LARGEST_STEP)
        high = np.minimum(largest, areas * LARGEST_STEP)
        new = _resize(areas, demand, exponent, (low, high), lengths, volume)
        change = float(np.abs(np.log(new / areas)) @ (areas * lengths) / volume)
        areas = new
    report = SizingReport(change <= options.tolerance, tuple(compliances), change)
    if strict and not report.converged:
        raise ConvergenceError(
            f"the radii still change by {change:.2g} (mean, relative) after {options.steps} steps, expected "
            f"{options.tolerance:.2g}: allow more steps, or raise the tolerance or the smallest radius"
        )
    return SizedTruss(truss, np.repeat(np.sqrt(areas / np.pi)[:, None], 3, axis=1)), report


def _with_areas(model: BeamModel, areas: np.ndarray) -> BeamModel:
    radii = np.sqrt(areas / np.pi)[model.member_of_element]
    return replace(model, radii=np.broadcast_to(radii[:, None], model.radii.shape))


def _demand(
    solution: BeamSolution, loading: TrussLoading, volumes: np.ndarray, criterion: str
) -> tuple[np.ndarray, np.ndarray]:
    """d of every member, in units of its mean, and eta."""
    stretching, bending = np.einsum("c,cmj->jm", loading.weights, solution.energies)
    share = bending / np.maximum(stretching + bending, np.finfo(float).tiny)
    if criterion == "stress":
        demand, power = solution.peak_stress.max(0), 1 + share / 2
    else:
        demand, power = (stretching + 2 * bending) / volumes, 2 + share
    return np.maximum(demand / demand.mean(), np.finfo(float).tiny), RELAXATION[criterion] / power


def _area_bounds(
    truss: Truss, lengths: Float[np.ndarray, " n_m"], volume: float, options: SizingOptions
) -> tuple[float, float]:
    """Smallest and largest area, mm^2, between which some areas have the volume."""
    require(np.isfinite(volume) and volume > 0, f"volume must be positive, in mm^3, found {volume}")
    uniform = np.sqrt(volume / (np.pi * lengths.sum()))
    smallest = SMALLEST_RADIUS_SHARE * uniform if options.smallest_radius is None else options.smallest_radius
    largest = LARGEST_RADIUS_RATIO * truss.spacing if options.largest_radius is None else options.largest_radius
    require(
        smallest <= uniform <= largest,
        f"a volume of {volume:.4g} mm^3 needs a mean radius of {uniform:.4g} mm, but members may have "
        f"{smallest:.4g} to {largest:.4g} mm: choose a volume from {np.pi * smallest**2 * lengths.sum():.4g} to "
        f"{np.pi * largest**2 * lengths.sum():.4g} mm^3, other bounds, or a truss of another resolution",
    )
    return np.pi * smallest**2, np.pi * largest**2


def _resize(
    areas: np.ndarray,
    demand: np.ndarray,
    exponent: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    lengths: np.ndarray,
    volume: float,
) -> np.ndarray:
    """clip(A (d / lambda)^eta, low, high) with the lambda at which these areas have the volume.

    Between the values of lambda at which all are at their upper and all at their lower bound, the volume never rises.
    """
    low, high = bounds

    def at(log_multiplier: float) -> np.ndarray:
        # Demands without bound cannot overflow: they are clipped as logarithms.
        logs = np.log(areas) + exponent * (np.log(demand) - log_multiplier)
        return np.exp(np.clip(logs, np.log(low), np.log(high)))

    a = (np.log(demand) - np.log(high / areas) / exponent).min()
    b = (np.log(demand) - np.log(low / areas) / exponent).max()
    for _ in range(BISECTIONS):
        middle = (a + b) / 2
        if at(middle) @ lengths > volume:
            a = middle
        else:
            b = middle
    return at((a + b) / 2)
