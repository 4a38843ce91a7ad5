"""From the layout to the structure: straight chords, radii that suit the loads, and braces where they pay.

All three are wishes; without any the truss stays as the knobs made it.
"""

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from michell_cad.elasticity import StressField
from michell_cad.parametrization import Parametrization
from michell_cad.problem import DesignProblem
from michell_cad.strength.beam_model import build_beam_model
from michell_cad.strength.braces import add_braces, choose_braces
from michell_cad.strength.mechanism import leave_out_loose_parts
from michell_cad.strength.sized_for_loads import Build, Sized, SizedForLoads
from michell_cad.strength.strengthen_options import StrengthenOptions
from michell_cad.truss import SizedTruss, Truss


@dataclass(frozen=True)
class StrengthenReport:
    """What was done to the truss, for the `sizing` block of the report.

    Parameters
    ----------
    options : as given.
    volume_mm3 : sum of the members' volumes.
    braces : how many were kept.
    smallest_radius_mm, largest_radius_mm : of the members.
    failure_factor : of all load cases, also the tilted ones, at which a first member of the truss as it can be built
        yields or, with buckling, buckles.
    failure_gain : the same over that of equal members of the same volume, built likewise, without braces.
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
    build: Build | None = None,
) -> tuple[SizedTruss, StrengthenReport | None, list[str]]:
    """Straighten, brace and size a truss as wished; returns it with a report (None if nothing was sized) and notes.

    Parameters
    ----------
    problem, stress_field, parametrization : of the part.
    sized : the truss; its radii count only for the volume.
    options : StrengthenOptions
    build : makes the truss buildable, see `Build`; default: members may be too thick for their nodes.

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
    volume = _volume(problem, sized, options)
    task = SizedForLoads(problem, volume, options, build)
    equal, _ = task.measured(task.equal(sized.truss))
    found = task.size(sized.truss)
    if options.braces:
        pairs = choose_braces(
            sized.truss, problem.mesh, stress_field.stress, parametrization.tangents, options.shear_limit
        )
        pairs = task.paying_braces(sized.truss, pairs)
        if len(pairs):
            braced = task.size(add_braces(sized.truss, pairs))
            if task.score(braced) > task.score(found):
                found = braced
            else:
                notes.append(f"{len(pairs)} braces would not pay: the truss without them is stronger at equal volume")
    if task.score(equal) > task.score(found):
        found = equal
        notes.append("no radii were found that are better than equal ones")
    if not found.converged:
        notes.append("the radii did not settle entirely; they are the best that were found")
    return found.sized, _describe(found, equal, volume, options), notes


def size_for_loads(
    problem: DesignProblem, sized: SizedTruss, options: StrengthenOptions, build: Build | None = None
) -> SizedTruss:
    """Size any truss by the same rules, at the volume that it has or that the options state."""
    sized, _ = leave_out_loose_parts(problem, sized)
    return SizedForLoads(problem, _volume(problem, sized, options), options, build).size(sized.truss).sized


def strengthen_block(report: StrengthenReport | None) -> dict[str, Any] | None:
    """A `StrengthenReport` as plain values."""
    return None if report is None else asdict(report)


def straighten(truss: Truss) -> Truss:
    """The truss with members along the chords between their nodes. Chords may leave a part whose faces are hollow."""
    return replace(
        truss, waypoints=np.zeros((0, 3)), waypoint_offsets=np.zeros(len(truss.members) + 1, np.int64), straight=True
    )


def _volume(problem: DesignProblem, sized: SizedTruss, options: StrengthenOptions) -> float:
    """Sum of the members' volumes that the options state, or that the truss has, mm^3."""
    if options.volume_fraction is not None:
        return options.volume_fraction * float(problem.mesh.volumes.sum())
    return build_beam_model(sized, problem.material, straight=False).volume


def _describe(found: Sized, equal: Sized, volume: float, options: StrengthenOptions) -> StrengthenReport:
    return StrengthenReport(
        options=options,
        volume_mm3=volume,
        braces=sum(curve.family == "brace" for curve in found.sized.truss.curves),
        smallest_radius_mm=float(found.sized.radii.min()),
        largest_radius_mm=float(found.sized.radii.max()),
        failure_factor=found.factor,
        failure_gain=found.factor / equal.factor,
        compliance_gain=equal.compliance / found.compliance,
        converged=found.converged,
    )
