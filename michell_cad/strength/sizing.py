"""Radii that suit the loads: every member gets the area that its share of the work asks for, at a given total volume.

Two criteria, both met by resizing A_m <- A_m (d_m / lambda)^eta within bounds, lambda such that the volume is kept:

1. "compliance": the least compliance sum_c w_c f_c . u_c. Its derivative by the area A of a member is -(e2 + 2 e4) / A
   with the member's energies e2 (axial and shear, which go with 1 / A) and e4 (bending and torsion, with 1 / A^2), so at
   the optimum d = (e2 + 2 e4) / (A L) is the same for all members within their bounds (Prager's criterion; Rozvany,
   Structural Design via Optimality Criteria, 1989). eta = 1/2 is exact in one step where only fixed axial forces act.
2. "stress": all members within their bounds reach the same peak stress d in the worst case: the fully stressed design.
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

_EXPONENT = {"compliance": 0.5, "stress": 0.8}
"""eta. A peak stress goes with 1 / A (axial) to A^-1.5 (bending)."""

LARGEST_STEP = 4.0
"""An area changes by this factor at most in one step."""

BISECTIONS = 200
"""Halvings of the interval of log lambda; more than double precision can tell apart."""


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
        fallen to this. 1e-3 is within 1e-4 of the compliance after five times as many steps on the paper's problems.
    steps : largest number.
    """

    criterion: Literal["compliance", "stress"] = "compliance"
    smallest_radius: float | None = None
    largest_radius: float | None = None
    straight: bool = True
    tolerance: float = 1e-3
    steps: int = 200

    def __post_init__(self) -> None:
        require(self.criterion in _EXPONENT, f"unknown criterion {self.criterion!r}: compliance or stress")
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
    exponent = _EXPONENT[options.criterion]
    compliances: list[float] = []
    change = np.inf
    for _ in range(options.steps):
        solution = solve_beams(_with_areas(model, areas), loading)
        compliances.append(float(loading.weights @ solution.compliances))
        if change <= options.tolerance:
            break
        demand = _demand(solution, loading, areas * lengths, options.criterion)
        low = np.maximum(smallest, areas / LARGEST_STEP)
        high = np.minimum(largest, areas * LARGEST_STEP)
        new = _areas_of_volume(areas * demand**exponent, low, high, lengths, volume)
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


def _demand(solution: BeamSolution, loading: TrussLoading, volumes: np.ndarray, criterion: str) -> np.ndarray:
    """d of every member, in units of its mean."""
    if criterion == "stress":
        demand = solution.peak_stress.max(0)
    else:
        demand = np.einsum("c,cmj,j->m", loading.weights, solution.energies, np.array([1.0, 2.0])) / volumes
    return np.maximum(demand / demand.mean(), np.finfo(float).tiny)


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
        f"a volume of {volume:.4g} mm^3 needs a mean radius of {uniform:.4g} mm, but members may have {smallest:.4g} to "
        f"{largest:.4g} mm: choose a volume from {np.pi * smallest**2 * lengths.sum():.4g} to "
        f"{np.pi * largest**2 * lengths.sum():.4g} mm^3, other bounds, or a truss of another resolution",
    )
    return np.pi * smallest**2, np.pi * largest**2


def _areas_of_volume(
    wanted: np.ndarray, low: np.ndarray, high: np.ndarray, lengths: np.ndarray, volume: float
) -> np.ndarray:
    """clip(wanted * mu, low, high) with the factor mu at which these areas have the volume.

    Between the factors at which all are at their lower and all at their upper bound, the volume never falls.
    """
    a, b = np.log((low / wanted).min()), np.log((high / wanted).max())
    for _ in range(BISECTIONS):
        middle = (a + b) / 2
        if np.clip(wanted * np.exp(middle), low, high) @ lengths < volume:
            a = middle
        else:
            b = middle
    return np.clip(wanted * np.exp((a + b) / 2), low, high)
