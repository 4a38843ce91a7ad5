"""From an edited structure to its solid: radii by knobs, edits and loads, then the shell, then what is kept.

The same road for all who build: the main job, an edited design, an export, a host program.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from michell_cad.arrays import require
from michell_cad.cad import (
    BuiltSolid,
    TrussSolid,
    build_solid,
    node_room,
    prepare_truss,
    resolve_radius,
    rule_as_built,
    rule_at_rest,
    unite,
)
from michell_cad.edits import Entasis, Radius, Structure, resize_structure, size_structure
from michell_cad.errors import InvalidInputError
from michell_cad.knobs import Knobs
from michell_cad.strength import Balls, Build, Buildable, StrengthenReport, strengthen
from michell_cad.truss import SizedTruss, Truss, take_curves

Progress = Callable[[str, float], None]

SHARED_KNOBS = ("node_ratio", "fillet_ratio", "profile", "profile_aspect", "node_form")
"""Knobs of a whole solid, whatever the parts of which it is joined say."""


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
    chosen, joining = resolve_knobs(chosen), joining_notes(structure)
    structure = replace(structure, knobs=chosen.knobs, joined=chosen.joined)
    knobs = chosen.knobs
    sized = size_structure(chosen)
    if options is None:
        return Sizing(sized, knobs, None, joining)
    if for_loads:
        require(not structure.joined, "[sizing] knows the loads of one part only: leave it out for joined trusses")
    part, build = (design.problem, design.stress_field, design.parametrization), buildable(knobs)
    sized, report, notes = strengthen(*part, sized, options, build)
    if report is None:
        return Sizing(sized, knobs, None, (*notes, *joining))
    sized, edited = _resized(structure, sized)
    return Sizing(sized, knobs, report, tuple(dict.fromkeys([*notes, *edited])))


@dataclass(frozen=True)
class RoundMembers:
    """What sizing for the loads learns of building round members with these knobs."""

    knobs: Knobs

    def balls_of(self, truss: Truss) -> Balls:
        """The balls of a truss that was not built yet."""
        return rule_at_rest(truss, self.knobs)

    def build(self, sized: SizedTruss) -> Buildable:
        """What is built of a truss."""
        prepared = prepare_truss(sized, self.knobs)
        return Buildable(prepared.sized, prepared.sizes.radius, rule_as_built(prepared), node_room(prepared))


def buildable(knobs: Knobs) -> Build | None:
    """How sizing learns what building makes of a truss; None for swept profiles, which do not give way."""
    return None if knobs.swept else RoundMembers(knobs)


def resolve_knobs(structure: Structure) -> Structure:
    """The structure with a radius in the knobs of each part that ask for a volume or a mass: that of its own members.

    Raises
    ------
    InvalidInputError
        If no radius gives it.
    """
    wanted = [piece.knobs for piece in structure.pieces]
    asking = [number for number, knobs in enumerate(wanted) if knobs.volume_fraction or knobs.mass]
    for number in asking:
        structure = _with_knobs(structure, number, _of_radius(wanted[number], None))
    shared = {name: getattr(structure.knobs, name) for name in SHARED_KNOBS}
    for number in asking:
        piece = structure.pieces[number]

        def size(knobs: Knobs, before: Structure = structure, number: int = number) -> SizedTruss:
            return own_members(size_structure(_with_knobs(before, number, knobs)), number)

        volume = float(piece.fields.mesh.volumes.sum())
        knobs = wanted[number].model_copy(update=shared)
        found = resolve_radius(knobs, size, piece.fields.spacing, volume, piece.density).radius
        structure = _with_knobs(structure, number, _of_radius(wanted[number], found))
    return structure


def _of_radius(knobs: Knobs, radius: float | None) -> Knobs:
    return knobs.model_copy(update={"radius": radius, "volume_fraction": None, "mass": None})


def own_members(sized: SizedTruss, part: int) -> SizedTruss:
    """The members of one of several joined parts."""
    taken, members = take_curves(sized.truss, np.array([curve.part == part for curve in sized.truss.curves]))
    return SizedTruss(taken, sized.radii[members])


def joining_notes(structure: Structure) -> tuple[str, ...]:
    """What does not come along with the parts that were joined to a structure."""
    if not structure.joined:
        return ()
    notes = []
    own, *others = structure.pieces
    shared = [name for name in SHARED_KNOBS if any(getattr(p.knobs, name) != getattr(own.knobs, name) for p in others)]
    if shared:
        notes.append(f"a joined design has another {', '.join(shared)}: those of this design hold for the whole solid")
    if any(piece.for_loads for piece in others):
        notes.append(
            "the radii of a joined design were sized for its loads; here those of its knobs hold, since the loads of "
            "joined parts are not known"
        )
    if any(piece.density != own.density for piece in others):
        notes.append("a joined design has a material of another density: the mass in the report is that of this one's")
    if any(piece.knobs.volume_fraction or piece.knobs.mass for piece in structure.pieces):
        notes.append(
            "volume_fraction and mass of a design's knobs are about its own members, not about the joined whole"
        )
    return tuple(notes)


def _with_knobs(structure: Structure, number: int, knobs: Knobs) -> Structure:
    """The structure with other knobs for one of its parts."""
    if number == 0:
        return replace(structure, knobs=knobs)
    pieces = [replace(p, knobs=knobs) if k == number else p for k, p in enumerate(structure.joined, 1)]
    return replace(structure, joined=tuple(pieces))


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
