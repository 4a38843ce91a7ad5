"""Radii that suit the loads: every group of members gets the area that its work asks for, at a given total volume.

Two criteria, both by variables x within bounds, the logarithms of areas (see `sizing_groups`):

1. "compliance": the stiffest members, see `stiffest`.
2. "stress": the highest load at which a first member yields or, with `buckling`, buckles by itself, see `strongest`.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float

from michell_cad.arrays import require
from michell_cad.errors import ConvergenceError
from michell_cad.knobs import LARGEST_RADIUS_RATIO
from michell_cad.problem import Material
from michell_cad.strength.beam_model import build_beam_model
from michell_cad.strength.beam_solver import require_solvable
from michell_cad.strength.loads import TrussLoading
from michell_cad.strength.sizing_groups import SizedBy, SizingGroups, group_members
from michell_cad.strength.sizing_task import SizingTask
from michell_cad.strength.stiffest import stiffest_radii
from michell_cad.strength.strongest import strongest_radii
from michell_cad.strength.thick_nodes import Balls, ThickNodes
from michell_cad.truss import SizedTruss, Truss

SMALLEST_RADIUS_SHARE = 0.3
"""Default smallest radius over the radius of equal members of the same volume: 9 % of their area. Thinner ones beside
thick ones bend sharply between the balls of their nodes, and their tubes have no room beside thick ones."""

LENGTH_SHARE = 0.35
"""Default largest radius over the length of a member: two members of equal radius r at a right angle need a node of
1.5 r, which takes 1.1 r from each; two such nodes and the shortest tube are 2.5 r, 0.4 for the length."""


@dataclass(frozen=True)
class SizingOptions:
    """Options of `size_members`.

    Parameters
    ----------
    criterion : "compliance" or "stress".
    smallest_radius : mm. Default: `SMALLEST_RADIUS_SHARE` of the radius that equal members would have.
    largest_radius : mm. Default: `LARGEST_RADIUS_RATIO` of the spacing (of the median member, where that is longer:
        thinner trusses have larger cells), and of a shorter member `LENGTH_SHARE` of its length.
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
    converged : whether the radii settled; under "stress", or that no step of the last ones was better.
    compliances : weighted sum over the load cases, N mm, of equal members (or of the radii to start from) first, then
        after every step but the last.
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
    balls: Balls | None = None,
    start: Float[np.ndarray, "n_m 3"] | None = None,
    room: Float[np.ndarray, " n_n"] | None = None,
    free: Bool[np.ndarray, " n_m"] | None = None,
) -> tuple[SizedTruss, SizingReport]:
    """Give every group of members its radii, at a total volume (sum of the integrals of pi r^2) in mm^3.

    Parameters
    ----------
    truss, material, loading : what carries what.
    volume : mm^3; what members share at nodes counts for each of them.
    options : SizingOptions
    strict : whether not to converge is an error.
    balls : of the nodes, for "stress"; default: none.
    start : radii to start from, mm, any volume; default: equal ones.
    room : largest radius at each node, mm, for members that are sized one by one; default: what the options say.
    free : members that change; the others, but for what they share with these, keep the radii of `start`.

    Raises
    ------
    InvalidInputError
        If no radii within the bounds have this volume (or keep members from buckling), or the truss is a mechanism.
    ConvergenceError
        If the radii have not settled after all steps.
    """
    # Radii that change along members need the sections of a taper; any that do will make them.
    pattern = [1.0, 1.1, 1.0] if options.by == "curve" else [1.0, 1.0, 1.0]
    pattern = SizedTruss(truss, np.tile(pattern, (len(truss.members), 1)))
    nodes = ThickNodes(truss, material, options.straight, balls)
    model = build_beam_model(pattern, material, options.straight, splines=nodes.splines)
    require_solvable(model, loading)
    lengths = np.bincount(model.member_of_element, model.lengths, len(truss.members))
    smallest, largest = _area_bounds(truss, lengths, volume, options)
    groups = group_members(truss, options.by)
    high = _largest(groups, truss, smallest, largest, options, room)
    _require_room(groups, high, lengths, volume)
    first = np.full(groups.count, np.log(volume / lengths.sum())) if start is None else groups.nearest(start)
    low = np.full(groups.count, np.log(smallest))
    if free is not None:
        stays = groups.shares.T @ free == 0
        low[stays] = high[stays] = first[stays]
    task = SizingTask(
        model,
        loading,
        groups,
        lengths,
        volume,
        low,
        high,
        first,
        nodes,
        options.buckling,
        options.tolerance,
        options.steps,
    )
    run = stiffest_radii(task) if options.criterion == "compliance" else strongest_radii(task)
    if strict and not run.converged:
        raise ConvergenceError(
            f"the radii still change by {run.change:.2g} (mean, relative) after {options.steps} steps, expected "
            f"{options.tolerance:.2g}: allow more steps, or raise the tolerance or the smallest radius"
        )
    report = SizingReport(run.converged, tuple(run.compliances), tuple(run.factors), run.change)
    return _at_volume(SizedTruss(truss, groups.radii(run.x)), material, volume, options.straight), report


def _largest(
    groups: SizingGroups,
    truss: Truss,
    smallest: float,
    largest: float,
    options: SizingOptions,
    room: Float[np.ndarray, " n_n"] | None,
) -> Float[np.ndarray, " n_x"]:
    """Largest x: what the bound on all areas and, of single members, their lengths or the room at their nodes leave."""
    if options.largest_radius is not None or options.by != "member":
        return np.full(groups.count, np.log(largest))
    own = LENGTH_SHARE * truss.lengths if room is None else room[truss.members].min(1)
    return np.log(np.clip(np.pi * own**2, smallest, largest))[np.argsort(groups.of_member)]


def _at_volume(sized: SizedTruss, material: Material, volume: float, straight: bool) -> SizedTruss:
    """Radii that change along a member have another volume than those of its middle: scaled back, by well below 1 %."""
    scale = np.sqrt(volume / build_beam_model(sized, material, straight).volume)
    return SizedTruss(sized.truss, sized.radii * scale)


def _require_room(groups: SizingGroups, high: np.ndarray, lengths: np.ndarray, volume: float) -> None:
    most = float(np.exp(groups.middle @ high) @ lengths)
    require(
        volume <= most,
        f"members with room for their nodes hold at most {most:.4g} mm^3, found a volume of {volume:.4g} mm^3: choose "
        "a smaller volume, a truss with longer members, or a largest radius",
    )


def _area_bounds(
    truss: Truss, lengths: Float[np.ndarray, " n_m"], volume: float, options: SizingOptions
) -> tuple[float, float]:
    """Smallest and largest area, mm^2, between which some areas have the volume."""
    require(np.isfinite(volume) and volume > 0, f"volume must be positive, in mm^3, found {volume}")
    uniform = np.sqrt(volume / (np.pi * lengths.sum()))
    smallest = SMALLEST_RADIUS_SHARE * uniform if options.smallest_radius is None else options.smallest_radius
    cell = max(truss.spacing, float(np.median(lengths)))
    largest = LARGEST_RADIUS_RATIO * cell if options.largest_radius is None else options.largest_radius
    require(
        smallest <= uniform <= largest,
        f"a volume of {volume:.4g} mm^3 needs a mean radius of {uniform:.4g} mm, but members may have "
        f"{smallest:.4g} to {largest:.4g} mm: choose a volume from {np.pi * smallest**2 * lengths.sum():.4g} to "
        f"{np.pi * largest**2 * lengths.sum():.4g} mm^3, other bounds, or a truss of another resolution",
    )
    return np.pi * smallest**2, np.pi * largest**2
