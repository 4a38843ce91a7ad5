"""Radii that suit the loads: every group of members gets the area that its work asks for, at a given total volume.

Two criteria, both met by resizing x_g <- x_g + eta_g log(d_g / lambda) within bounds, x the logarithms of areas (see
`sizing_groups`), lambda such that the volume is kept:

1. "compliance": the least compliance sum_c w_c f_c . u_c. Its derivative by log A of a member is -(e2 + 2 e4) with the
   member's energies e2 (axial and shear, which go with 1 / A) and e4 (bending and torsion, with 1 / A^2), so at the
   optimum d = sum (e2 + 2 e4) / sum A L is the same for all groups within their bounds (Prager's criterion; Rozvany,
   Structural Design via Optimality Criteria, 1989). With `buckling` no area falls below that at which its member
   buckles by itself (guided ends) at the given loads.
2. "stress": the largest index d of the members of a group is the same for all groups within their bounds: the fully
   stressed design. The index is the inverse of the factor of the loads at which the member yields or, with `buckling`,
   buckles by itself. The criterion is no optimum, and not always met in frames; the best radii on the way are returned.

The exponent eta that is exact where the forces do not change is one over the power of A with which d falls.
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
from michell_cad.strength.member_buckling import member_buckling_factors
from michell_cad.strength.sizing_groups import SizedBy, SizingGroups, group_members
from michell_cad.truss import SizedTruss, Truss, member_radius

SMALLEST_RADIUS_SHARE = 0.2
"""Default smallest radius over the radius of equal members of the same volume: 4 % of their area."""

RELAXATION = {"compliance": 1.6, "stress": 0.7}
"""Factor of the exponents that are exact at fixed forces. Stiffer members draw force, so the compliance falls twice as
fast with a factor between 1.4 and 1.7; with 1.9 it oscillates. The stress of one group depends on its neighbours'."""

LENGTH_SHARE = 0.3
"""Default largest radius over the length of a member: its two nodes, each 1.7 radii deep, leave no tube beyond."""

LARGEST_STEP = 4.0
"""An area changes by this factor at most in one step."""

BISECTIONS = 100
"""Halvings of the interval of log lambda: to the last digit."""

BUCKLING_MARGIN = 1.05
"""Areas above those at which members buckle: the forces still change a little when the radii have settled."""

PATIENCE = 25
"""Steps without a better design after which the stress criterion stops."""


@dataclass(frozen=True)
class SizingOptions:
    """Options of `size_members`.

    Parameters
    ----------
    criterion : "compliance" or "stress".
    smallest_radius : mm. Default: `SMALLEST_RADIUS_SHARE` of the radius that equal members would have.
    largest_radius : mm. Default: `LARGEST_RADIUS_RATIO` of the spacing, and of a shorter member `LENGTH_SHARE` of its
        length.
    straight : whether members are taken along their chords or along their curves.
    tolerance : relative. The radii have converged when the mean change of the areas in a step, weighted by volume, has
        fallen to this. 5e-3 takes 15 to 70 steps on the paper's problems and is within 1 % of the least compliance.
    steps : largest number.
    by : what is sized together: "member", "curve" (with a smooth change along it) or "family".
    buckling : whether members must not buckle before they yield ("stress") or at the loads ("compliance").
    """

    criterion: Literal["compliance", "stress"] = "compliance"
    smallest_radius: float | None = None
    largest_radius: float | None = None
    straight: bool = True
    tolerance: float = 5e-3
    steps: int = 200
    by: SizedBy = "member"
    buckling: bool = False

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
    converged : whether the radii settled; under "stress", or that no step of the last `PATIENCE` was better.
    compliances : weighted sum over the load cases, N mm, of equal members first, then after every step but the last.
    factors : likewise the factor of the loads at which the first member fails: yields or, with `buckling`, buckles.
    change : the last mean change of the areas.
    """

    converged: bool
    compliances: tuple[float, ...]
    factors: tuple[float, ...]
    change: float


def size_members(
    truss: Truss,
    material: Material,
    loading: TrussLoading,
    volume: float,
    options: SizingOptions = SizingOptions(),
    strict: bool = True,
) -> tuple[SizedTruss, SizingReport]:
    """Give every group of members its radii, at a total volume (sum of the integrals of pi r^2) in mm^3.

    Parameters
    ----------
    truss, material, loading : what carries what.
    volume : mm^3; what members share at nodes counts for each of them.
    options : SizingOptions
    strict : whether not to converge is an error.

    Raises
    ------
    InvalidInputError
        If no radii within the bounds have this volume (or keep members from buckling), or the truss is a mechanism.
    ConvergenceError
        If the radii have not settled after all steps.
    """
    # Radii that change along members need the sections of a taper; any that do will make them.
    pattern = [1.0, 1.1, 1.0] if options.by == "curve" else [1.0, 1.0, 1.0]
    model = build_beam_model(SizedTruss(truss, np.tile(pattern, (len(truss.members), 1))), material, options.straight)
    lengths = np.bincount(model.member_of_element, model.lengths, len(truss.members))
    smallest, largest = _area_bounds(truss, lengths, volume, options)
    groups = group_members(truss, options.by)
    high = _room(groups, truss, smallest, largest, options)
    _require_room(groups, high, lengths, volume)
    x = np.full(groups.count, np.log(volume / lengths.sum()))
    compliances: list[float] = []
    factors: list[float] = []
    best, change = x, np.inf
    for _ in range(options.steps):
        areas = np.exp(groups.middle @ x)
        solution = solve_beams(_with_radii(model, groups.radii(x)), loading)
        index = _failure_index(solution, options.buckling)
        compliances.append(float(loading.weights @ solution.compliances))
        factors.append(float(1 / index.max()))
        best = x if options.criterion == "compliance" or factors[-1] >= max(factors) else best
        if change <= options.tolerance or len(factors) - int(np.argmax(factors)) > _patience(options):
            change = min(change, options.tolerance)
            break
        demand, exponent = _demand(solution, loading, groups, areas * lengths, index, options.criterion)
        low = np.full(len(x), np.log(smallest))
        if options.buckling and options.criterion == "compliance":
            low = _buckling_floor(groups, solution, areas, smallest)
            _require_volume(groups, low, lengths, volume)
        step = np.log(LARGEST_STEP)
        bounds = np.maximum(low, x - step), np.maximum(low, np.minimum(high, x + step))
        new = _resize(x, demand, exponent, bounds, groups, lengths, volume)
        change = float(np.abs(groups.middle @ (new - x)) @ (areas * lengths) / volume)
        x = new
    report = SizingReport(change <= options.tolerance, tuple(compliances), tuple(factors), change)
    if strict and not report.converged:
        raise ConvergenceError(
            f"the radii still change by {change:.2g} (mean, relative) after {options.steps} steps, expected "
            f"{options.tolerance:.2g}: allow more steps, or raise the tolerance or the smallest radius"
        )
    return _at_volume(SizedTruss(truss, groups.radii(best)), material, volume, options.straight), report


def _room(
    groups: SizingGroups, truss: Truss, smallest: float, largest: float, options: SizingOptions
) -> Float[np.ndarray, " n_x"]:
    """Largest x: what the bound on all areas, and by default the length of each single member, leave."""
    high = np.full(groups.count, np.log(largest))
    if options.largest_radius is None and options.by == "member":
        own = np.pi * (LENGTH_SHARE * truss.lengths[np.argsort(groups.of_member)]) ** 2
        high = np.log(np.clip(own, smallest, largest))
    return high


def _patience(options: SizingOptions) -> float:
    return PATIENCE if options.criterion == "stress" else np.inf


def _at_volume(sized: SizedTruss, material: Material, volume: float, straight: bool) -> SizedTruss:
    """Radii that change along a member have another volume than those of its middle: scaled back, by well below 1 %."""
    scale = np.sqrt(volume / build_beam_model(sized, material, straight).volume)
    return SizedTruss(sized.truss, sized.radii * scale)


def _with_radii(model: BeamModel, radii: Float[np.ndarray, "n_m 3"]) -> BeamModel:
    return replace(model, radii=member_radius(radii[model.member_of_element, None], model.stations))


def _failure_index(solution: BeamSolution, buckling: bool) -> Float[np.ndarray, " n_m"]:
    """Largest over the load cases of one over the factor at which each member yields (or buckles)."""
    index = solution.peak_stress.max(0) / solution.model.material.yield_strength
    if buckling:
        index = np.maximum(index, (1 / member_buckling_factors(solution)).max(0))
    return index


def _demand(
    solution: BeamSolution,
    loading: TrussLoading,
    groups: SizingGroups,
    volumes: np.ndarray,
    index: np.ndarray,
    criterion: str,
) -> tuple[np.ndarray, np.ndarray]:
    """d of every group, in units of its mean, and eta."""
    stretching, bending = np.einsum("c,cmj->jm", loading.weights, solution.energies)
    bent = bending / np.maximum(stretching + bending, np.finfo(float).tiny)
    share = groups.shares.T
    if criterion == "stress":
        demand = np.exp(_largest_of_group(groups, np.log(np.maximum(index, np.finfo(float).tiny))))
        buckles = index > 1.001 * solution.peak_stress.max(0) / solution.model.material.yield_strength
        power = np.where(buckles, 2.0, 1 + bent / 2)
    else:
        demand = (share @ (stretching + 2 * bending)) / (share @ volumes)
        power = 2 + bent
    exponent = RELAXATION[criterion] / ((share @ (volumes * power)) / (share @ volumes))
    return np.maximum(demand / demand.mean(), np.finfo(float).tiny), exponent


def _largest_of_group(groups: SizingGroups, logs: np.ndarray) -> np.ndarray:
    """Largest of each group's own members (it has the largest share of them), else of those that it has a share in."""
    largest = np.full(groups.count, -np.inf)
    np.maximum.at(largest, groups.of_member, logs)
    shares = groups.shares.tocoo()
    missing = np.isinf(largest)[shares.col]
    np.maximum.at(largest, shares.col[missing], logs[shares.row[missing]])
    return largest


def _buckling_floor(groups: SizingGroups, solution: BeamSolution, areas: np.ndarray, smallest: float) -> np.ndarray:
    """Least x with which no member buckles at its force, which goes with A^2; every variable suits all it has a share
    in, so that what lies between two of them is safe."""
    floor = np.maximum(BUCKLING_MARGIN * areas / np.sqrt(member_buckling_factors(solution).min(0)), smallest)
    shares = groups.shares.tocoo()
    low = np.full(groups.count, np.log(smallest))
    np.maximum.at(low, shares.col, np.log(floor)[shares.row])
    return low


def _require_room(groups: SizingGroups, high: np.ndarray, lengths: np.ndarray, volume: float) -> None:
    most = float(np.exp(groups.middle @ high) @ lengths)
    require(
        volume <= most,
        f"members with room for their nodes hold at most {most:.4g} mm^3, found a volume of {volume:.4g} mm^3: choose "
        "a smaller volume, a truss with longer members, or a largest radius",
    )


def _require_volume(groups: SizingGroups, low: np.ndarray, lengths: np.ndarray, volume: float) -> None:
    least = float(np.exp(groups.middle @ low) @ lengths)
    require(
        least <= volume,
        f"members that do not buckle at these loads take {least:.4g} mm^3, more than the volume of {volume:.4g} mm^3: "
        "give more volume, size by stress, or leave buckling out",
    )


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
    x: np.ndarray,
    demand: np.ndarray,
    exponent: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    groups: SizingGroups,
    lengths: np.ndarray,
    volume: float,
) -> np.ndarray:
    """clip(x + eta log(d / lambda), low, high) with the lambda at which these areas have the volume.

    Between the values of lambda at which all are at their upper and all at their lower bound, the volume never rises.
    """
    low, high = bounds

    def at(log_multiplier: float) -> np.ndarray:
        return np.clip(x + exponent * (np.log(demand) - log_multiplier), low, high)

    a = (np.log(demand) - (high - x) / exponent).min()
    b = (np.log(demand) - (low - x) / exponent).max()
    for _ in range(BISECTIONS):
        middle = (a + b) / 2
        if np.exp(groups.middle @ at(middle)) @ lengths > volume:
            a = middle
        else:
            b = middle
    return at((a + b) / 2)
