"""From an edited structure to its solid: radii by knobs, edits and loads, then the shell, then what is kept.

The same road for all who build: the main job, an edited design, an export, a host program.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

from michell_cad.arrays import require
from michell_cad.cad import TrussSolid, build_solid, prepare_truss, resolve_radius, unite
from michell_cad.edits import Entasis, Radius, Structure, resize_structure, size_structure
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
    """Give every member its radius: by the knobs and edits, or as the loads want it and then by the edits.

    For the loads it is sized twice: thick members merge nodes and give way to each other in the solid, and forces go
    with them.
    """
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
    part, sized = (design.problem, design.stress_field, design.parametrization), size_structure(chosen, knobs)
    if options is None:
        return Sizing(sized, knobs, None, ())
    if for_loads:
        require(not structure.others, "[sizing] knows the loads of one part only: leave it out for joined trusses")
    sized, first, notes = strengthen(*part, sized, options)
    if first is None:
        return Sizing(sized, knobs, None, tuple(notes))
    buildable = prepare_truss(sized, knobs).sized
    volume_fraction = first.volume_mm3 / float(design.problem.mesh.volumes.sum())
    sized, second, more = strengthen(*part, buildable, replace(options, braces=False, volume_fraction=volume_fraction))
    assert second is not None
    # Gains compare with equal members of the truss that the knobs chose.
    gain = first.failure_gain * second.failure_factor / first.failure_factor
    report = replace(second, options=options, failure_gain=gain)
    sized, edited = _resized(structure, sized)
    return Sizing(sized, knobs, report, tuple(dict.fromkeys([*notes, *more, *edited])))


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


def build_united(structure: Structure, sizing: Sizing, progress: Progress) -> TrussSolid:
    """The solid of a structure, united with what it keeps."""
    solid = build_solid(sizing.sized, sizing.knobs, progress=lambda fraction: progress("solid", fraction))
    if structure.whole_kept:
        solid = unite(solid, structure.whole_kept, lambda fraction: progress("keep", fraction))
    return solid
