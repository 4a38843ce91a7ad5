"""From an edited structure to its solid: radii by knobs, edits and loads, then the shell, then what is kept.

The same road for all who build: the main job, an edited design, an export, a host program.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

from michell_cad.arrays import require
from michell_cad.cad import BuiltSolid, TrussSolid, build_solid, prepare_truss, resolve_radius, unite
from michell_cad.edits import Entasis, Radius, Structure, size_structure
from michell_cad.errors import InvalidInputError
from michell_cad.knobs import Knobs
from michell_cad.strength import StrengthenReport, strengthen
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
    """Give every member its radius, by knobs and edits, and then as the loads want it, if the structure asks for that.

    Sized is twice: thick members merge nodes and give way to each other in the solid, and forces go with them. Swept
    profiles do not give way to each other, so that once is enough for them.
    """
    design = structure.design
    knobs = resolve_radius(
        structure.knobs,
        lambda knobs: size_structure(structure, knobs),
        structure.truss.spacing,
        float(structure.whole_mesh.volumes.sum()),
        design.problem.material.density,
    )
    part, options = (design.problem, design.stress_field, design.parametrization), structure.sizing
    sized = size_structure(structure, knobs)
    if options is None:
        return Sizing(sized, knobs, None, ())
    if options.size_by is not None:
        require(not structure.others, "[sizing] knows the loads of one part only: leave it out for joined trusses")
        require(
            not structure.of_kind(Radius) and not structure.of_kind(Entasis),
            "the radii of this design are sized for its loads, so that edits of radius and entasis have no say: design "
            "it without `by` in [sizing], or leave these edits out",
        )
    sized, first, notes = strengthen(*part, sized, options)
    if first is None or knobs.swept:
        return Sizing(sized, knobs, first, tuple(notes))
    buildable = prepare_truss(sized, knobs).sized
    volume_fraction = first.volume_mm3 / float(design.problem.mesh.volumes.sum())
    sized, second, more = strengthen(*part, buildable, replace(options, braces=False, volume_fraction=volume_fraction))
    assert second is not None
    # Gains compare with equal members of the truss that the knobs chose.
    gain = first.failure_gain * second.failure_factor / first.failure_factor
    return Sizing(
        sized, knobs, replace(second, options=options, failure_gain=gain), tuple(dict.fromkeys([*notes, *more]))
    )


def build_united(structure: Structure, sizing: Sizing, progress: Progress) -> BuiltSolid:
    """The solid of a structure, united with what it keeps.

    Raises
    ------
    InvalidInputError
        If something is kept, and the members are not round.
    """
    knobs = sizing.knobs
    if structure.kept and knobs.swept:
        raise InvalidInputError(
            "[[keep]] unites round members with the part, and no others: set profile = round, profile_aspect = 1 and "
            "node_form = sphere, or leave [[keep]] out"
        )
    solid = build_solid(sizing.sized, knobs, progress=lambda fraction: progress("solid", fraction))
    if structure.kept and isinstance(solid, TrussSolid):
        solid = unite(solid, structure.kept, lambda fraction: progress("keep", fraction))
    return solid
