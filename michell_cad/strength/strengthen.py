"""From the layout to the structure: straight chords, radii that suit the loads, and braces where they pay.

All three are wishes; without any the truss stays as the knobs made it.
"""

from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np

from michell_cad.arrays import require
from michell_cad.elasticity import StressField
from michell_cad.parametrization import Parametrization
from michell_cad.problem import DesignProblem
from michell_cad.strength.beam_model import build_beam_model
from michell_cad.strength.braces import SHEAR_LIMIT, add_braces, choose_braces
from michell_cad.strength.loads import OFF_AXIS_DEGREES, add_off_axis_cases, carry_over_loads
from michell_cad.strength.mechanism import leave_out_loose_parts
from michell_cad.strength.sizing import SizingOptions, SizingReport, size_members
from michell_cad.strength.sizing_groups import SizedBy
from michell_cad.truss import SizedTruss, Truss


@dataclass(frozen=True)
class StrengthenOptions:
    """Options of `strengthen`.

    Parameters
    ----------
    straight : whether members run along the chords between their nodes.
    size_by : what gets a radius of its own: "member", "curve" or "family"; None leaves the radii.
    criterion : "stress": the highest load at first yield or buckling; "compliance": the stiffest.
    braces : whether cell faces that shear may get a diagonal; they are kept only if the sized truss is better for it.
    shear_limit : see `choose_braces`.
    volume_fraction : sum of the members' volumes over that of the part; default: as the knobs made it.
    off_axis_degrees : every load case counts also tilted to four sides by this angle; 0: only as it is.
    buckling : whether members must not buckle before they yield ("stress") or at the loads ("compliance").
    smallest_radius, largest_radius : mm; defaults as in `SizingOptions`.
    """

    straight: bool = False
    size_by: SizedBy | None = None
    criterion: Literal["compliance", "stress"] = "stress"
    braces: bool = False
    shear_limit: float = SHEAR_LIMIT
    volume_fraction: float | None = None
    off_axis_degrees: float = OFF_AXIS_DEGREES
    buckling: bool = True
    smallest_radius: float | None = None
    largest_radius: float | None = None

    def __post_init__(self) -> None:
        require(
            not self.braces or self.size_by is not None,
            "braces cost at equal radii and pay only where radii are sized: give size_by as well",
        )
        require(
            self.volume_fraction is None or 0 < self.volume_fraction < 1,
            f"volume_fraction must lie between 0 and 1, found {self.volume_fraction}",
        )


@dataclass(frozen=True)
class StrengthenReport:
    """What was done to the truss, for the `sizing` block of the report.

    Parameters
    ----------
    options : as given.
    volume_mm3 : sum of the members' volumes.
    braces : how many were kept.
    smallest_radius_mm, largest_radius_mm : of the members.
    failure_factor : of all load cases, also the tilted ones, at which a first member yields or, with buckling, buckles.
    failure_gain : the same over that of equal members of the same volume, without braces.
    compliance_gain : compliance of these over that of the sized truss.
    converged : whether the radii settled.
    """

    options: StrengthenOptions
    volume_mm3: float
    braces: int
    smallest_radius_mm: float
    largest_radius_mm: float
    failure_factor: float
    failure_gain: float
    compliance_gain: float
    converged: bool


def strengthen(
    problem: DesignProblem,
    stress_field: StressField,
    parametrization: Parametrization,
    sized: SizedTruss,
    options: StrengthenOptions,
) -> tuple[SizedTruss, StrengthenReport | None, list[str]]:
    """Straighten, brace and size a truss as wished; returns it with a report (None if nothing was sized) and notes.

    Raises
    ------
    InvalidInputError
        If no radii within the bounds have the volume, nothing is supported, or no load acts.
    """
    if options.straight:
        sized = SizedTruss(straighten(sized.truss), sized.radii)
    if options.size_by is None:
        return sized, None, []
    sized, notes = leave_out_loose_parts(problem, sized)
    model = build_beam_model(sized, problem.material, straight=False)
    part = float(problem.mesh.volumes.sum())
    volume = model.volume if options.volume_fraction is None else options.volume_fraction * part
    result, report = _size(problem, sized.truss, volume, options)
    first = report
    if options.braces:
        pairs = choose_braces(
            sized.truss, problem.mesh, stress_field.stress, parametrization.tangents, options.shear_limit
        )
        if len(pairs):
            braced, other = _size(problem, add_braces(sized.truss, pairs), volume, options)
            if _score(other, options) > _score(report, options):
                result, report = braced, other
            else:
                notes.append(f"{len(pairs)} braces would not pay: the truss without them is stronger at equal volume")
    if not report.converged:
        notes.append("the radii did not settle entirely; they are the best that were found")
    return result, _describe(result, report, first, volume, options), notes


def size_for_loads(problem: DesignProblem, sized: SizedTruss, options: StrengthenOptions) -> SizedTruss:
    """Size any truss by the same rules, at the volume that it has or that the options state."""
    sized, _ = leave_out_loose_parts(problem, sized)
    volume = build_beam_model(sized, problem.material, straight=False).volume
    if options.volume_fraction is not None:
        volume = options.volume_fraction * float(problem.mesh.volumes.sum())
    return _size(problem, sized.truss, volume, options)[0]


def strengthen_block(report: StrengthenReport | None) -> dict[str, Any] | None:
    """A `StrengthenReport` as plain values."""
    return None if report is None else asdict(report)


def straighten(truss: Truss) -> Truss:
    """The truss with members along the chords between their nodes. Chords may leave a part whose faces are hollow."""
    return replace(
        truss, waypoints=np.zeros((0, 3)), waypoint_offsets=np.zeros(len(truss.members) + 1, np.int64), straight=True
    )


def _size(
    problem: DesignProblem, truss: Truss, volume: float, options: StrengthenOptions
) -> tuple[SizedTruss, SizingReport]:
    loading = add_off_axis_cases(carry_over_loads(problem, truss), options.off_axis_degrees)
    assert options.size_by is not None  # asked before
    sizing = SizingOptions(
        options.criterion,
        options.smallest_radius,
        options.largest_radius,
        straight=truss.straight,
        by=options.size_by,
        buckling=options.buckling,
    )
    return size_members(truss, problem.material, loading, volume, sizing, strict=False)


def _score(report: SizingReport, options: StrengthenOptions) -> float:
    """What the criterion makes large."""
    return max(report.factors) if options.criterion == "stress" else -report.compliances[-1]


def _describe(
    sized: SizedTruss, report: SizingReport, first: SizingReport, volume: float, options: StrengthenOptions
) -> StrengthenReport:
    best = int(np.argmax(report.factors)) if options.criterion == "stress" else -1
    return StrengthenReport(
        options=options,
        volume_mm3=volume,
        braces=sum(curve.family == "brace" for curve in sized.truss.curves),
        smallest_radius_mm=float(sized.radii.min()),
        largest_radius_mm=float(sized.radii.max()),
        failure_factor=report.factors[best],
        failure_gain=report.factors[best] / first.factors[0],
        compliance_gain=first.compliances[0] / report.compliances[best],
        converged=report.converged,
    )
