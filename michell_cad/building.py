"""From an edited structure to its solid: radii by knobs, edits and loads, then the shell, then what is kept.

The same road for all who build: the main job, an edited design, an export, a host program.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

from michell_cad.arrays import require
from michell_cad.cad import BuiltSolid, TrussSolid, build_solid, node_room, prepare_truss, resolve_radius, unite
from michell_cad.edits import Entasis, Radius, Structure, resize_structure, size_structure
from michell_cad.errors import InvalidInputError
from michell_cad.knobs import Knobs
from michell_cad.strength import Build, Buildable, StrengthenReport, strengthen
from michell_cad.truss import SizedTruss

Progress = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class Sizing:
    """The radii of a structure, and where they come from.

    Parameters
    ----------
    sized : the truss with its radii.
    knobs : with the radius for a target volume or mass.
    report : of sizing for the loads; None if the knobs and edits alone decide.
    notes : what a reader of the report should know.
    """

    sized: SizedTruss
    knobs: Knobs
    report: StrengthenReport | None
    notes: tuple[str, ...]


def size_finished(structure: Structure) -> Sizing:
    """Give every member its radius: by the knobs and edits, or as the loads want it and then by the edits."""
    design, options = structure.design, structure.sizing
    for_loads = options is not None and options.size_by is not None
    # What edits make thicker for its own sake is no material that the loads may spend.
    chosen = replace(structure, noted=()) if for_loads else structure
    knobs = resolve_radius(
        structure.knobs,
        lambda knobs: size_structure(chosen, knobs),
        structure.truss.spacing,
        float(structure.whole_mesh.volumes.sum()),
        design.problem.material.density,
    )
    sized = size_structure(chosen, knobs)
    if options is None:
        return Sizing(sized, knobs, None, ())
    if for_loads:
        require(not structure.others, "[sizing] knows the loads of one part only: leave it out for joined trusses")
    part, build = (design.problem, design.stress_field, design.parametrization), buildable(knobs)
    sized, report, notes = strengthen(*part, sized, options, build)
    if report is None:
        return Sizing(sized, knobs, None, tuple(notes))
    sized, edited = _resized(structure, sized)
    return Sizing(sized, knobs, report, tuple(dict.fromkeys([*notes, *edited])))


def buildable(knobs: Knobs) -> Build | None:
    """How sizing for the loads learns what building makes of a truss; None for swept profiles, which do not give way to
    each other."""
    if knobs.swept:
        return None

    def build(sized: SizedTruss) -> Buildable:
        prepared = prepare_truss(sized, knobs)
        return Buildable(prepared.sized, prepared.sizes.radius, node_room(prepared))

    return build


def _resized(structure: Structure, sized: SizedTruss) -> tuple[SizedTruss, list[str]]:
    """A truss sized for its loads with the radii that edits want, and a note if there are such edits."""
    if not (structure.of_kind(Radius) or structure.of_kind(Entasis)):
        return sized, []
    edited = resize_structure(structure, sized)
    count = int((edited.radii != sized.radii).any(1).sum())
    return edited, [
        f"edits changed the radii of {count} members after these were sized for the loads: the figures of the sizing "
        "are those from before"
    ]


def build_united(structure: Structure, sizing: Sizing, progress: Progress) -> BuiltSolid:
    """The solid of a structure, united with what it keeps.

    Raises
    ------
    InvalidInputError
        If something is kept, and the members are not round.
    """
    knobs = sizing.knobs
    if structure.whole_kept and knobs.swept:
        raise InvalidInputError(
            "[[keep]] unites round members with the part, and no others: set profile = round, profile_aspect = 1 and "
            "node_form = sphere, or leave [[keep]] out"
        )
    solid = build_solid(sizing.sized, knobs, progress=lambda fraction: progress("solid", fraction))
    if structure.whole_kept and isinstance(solid, TrussSolid):
        solid = unite(solid, structure.whole_kept, lambda fraction: progress("keep", fraction))
    return solid
