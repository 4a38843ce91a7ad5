"""What edits take and return: a truss on its way from the parametrization to the solid.

Edits act in the order of the method, whatever their order in the list:

1. on the parametrization (snapping): the isocurves are traced again, labels stay what they are;
2. on the truss: curves go and come;
3. on the finished truss (radii, entasis, tags, sheets, attachments): such an edit is only noted here. Its selection is
   asked of the truss when everything else is done, so that it holds for whatever is left, and in the order of the list.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import numpy as np
from jaxtyping import Float
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PlainSerializer, WithJsonSchema

from michell_cad.arrays import freeze, require
from michell_cad.curves import FAMILIES
from michell_cad.edits.selections import Everything, Part, Point, Selection
from michell_cad.edits.sentences import selection_from
from michell_cad.knobs import Knobs, choose_curves
from michell_cad.metrics import name_families
from michell_cad.pipeline import Design
from michell_cad.strength import StrengthenOptions
from michell_cad.tet_mesh import TetMesh
from michell_cad.truss import Truss

if TYPE_CHECKING:
    from michell_cad.cad import KeptSolid


@dataclass(frozen=True, eq=False)
class DesignFields:
    """The fields of a design that edits ask for.

    Parameters
    ----------
    mesh : TetMesh
    levels : (n_v, 3) float, the coordinates at the vertices, in cells: their integer isocurves are the truss.
    stress : (n_t, 3, 3) float, MPa.
    families : names of the families that run along the three coordinates.
    spacing : mm, edge of a typical truss cell.
    """

    mesh: TetMesh
    levels: Float[np.ndarray, "n_v 3"]
    stress: Float[np.ndarray, "n_t 3 3"]
    families: tuple[str, str, str]
    spacing: float

    def __post_init__(self) -> None:
        freeze(self, levels=np.float64, stress=np.float64)

    @staticmethod
    def of(design: Design) -> "DesignFields":
        """The fields of a design; nothing of it is computed again but the scale of its coordinates."""
        options, mesh, stress = design.options, design.problem.mesh, design.stress_field.stress
        levels, spacing = design.parametrization.levels(options.resolution, options.spacing, options.layers)
        families = name_families(mesh, stress, design.parametrization.tangents)
        return DesignFields(mesh, levels, stress, families, spacing)

    def axis(self, coordinate: int | str) -> int:
        """The coordinate itself, or the one along which the curves of a family run."""
        return coordinate if isinstance(coordinate, int) else self.families.index(coordinate)


@dataclass(frozen=True, eq=False)
class Piece:
    """One of the parts that are joined to a structure: what its own design file says of its members.

    Parameters
    ----------
    fields : of its design.
    knobs : those of its file; the radius, entasis and smallest radius of its members.
    density : g/mm^3.
    for_loads : whether its file has its radii sized for its loads, which a joined structure cannot do.
    """

    fields: DesignFields
    knobs: Knobs
    density: float
    for_loads: bool = False


@dataclass(frozen=True, eq=False)
class Structure:
    """A truss with what edits need to know of its design, and the edits that wait for it to be finished.

    Parameters
    ----------
    design : Design
    knobs : Knobs
    fields : of the design, the coordinates as they have been snapped.
    truss : the chosen and edited curves.
    snapped : points to which nodes have been snapped, mm.
    as_traced : whether no edit has changed the truss since it was traced and chosen.
    noted : edits of the finished truss, in order.
    joined : the parts that were joined to this one; curves of number k have the `part` k + 1.
    kept : solids of the design with which the finished truss is united.
    kept_of_others : those of the trusses that were joined to this one.
    sizing : how its radii are made to suit the loads; None: knobs and edits decide.
    """

    design: Design
    knobs: Knobs
    fields: DesignFields
    truss: Truss
    snapped: tuple[Point, ...] = ()
    as_traced: bool = True
    noted: tuple["Edit", ...] = ()
    joined: tuple[Piece, ...] = ()
    kept: "tuple[KeptSolid, ...]" = ()
    kept_of_others: "tuple[KeptSolid, ...]" = ()
    sizing: StrengthenOptions | None = None

    @staticmethod
    def of(design: Design, knobs: Knobs) -> "Structure":
        """The curves of a design that the knobs choose."""
        return Structure(design, knobs, DesignFields.of(design), choose_curves(design.truss, knobs))

    def with_truss(self, truss: Truss) -> "Structure":
        """The same with an edited truss."""
        return replace(self, truss=truss, as_traced=False)

    def with_note(self, edit: "Edit") -> "Structure":
        """The same with one more edit of the finished truss."""
        return replace(self, noted=(*self.noted, edit))

    @property
    def whole_mesh(self) -> TetMesh:
        """The part, and those of all joined trusses, as one mesh of several pieces."""
        mesh = self.fields.mesh
        for other in (piece.fields.mesh for piece in self.joined):
            mesh = TetMesh(
                np.concatenate([mesh.vertices, other.vertices]),
                np.concatenate([mesh.tets, other.tets + len(mesh.vertices)]),
            )
        return mesh

    @property
    def pieces(self) -> tuple[Piece, ...]:
        """All parts by their number, this one first."""
        for_loads = self.sizing is not None and self.sizing.size_by is not None
        return (Piece(self.fields, self.knobs, self.design.problem.material.density, for_loads), *self.joined)

    @property
    def whole_kept(self) -> "tuple[KeptSolid, ...]":
        """All solids with which the finished truss is united."""
        return (*self.kept, *self.kept_of_others)

    def of_kind(self, kind: "type[AnyEdit]") -> "tuple[AnyEdit, ...]":
        """The noted edits of a kind, in order."""
        return tuple(edit for edit in self.noted if isinstance(edit, kind))


Chosen = Annotated[
    Selection,
    BeforeValidator(lambda value: value if isinstance(value, Selection) else selection_from(value)),
    PlainSerializer(lambda value: value.plain()),
    WithJsonSchema({"type": "object"}),
]
"""A selection as the field of an edit: a `Selection`, or its plain form."""


class Edit(BaseModel, ABC):
    """One step in editing a structure: a frozen value with a plain form."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, arbitrary_types_allowed=True)

    do: str

    @abstractmethod
    def apply(self, structure: Structure) -> Structure:
        """The edited structure.

        Raises
        ------
        InvalidInputError
            If the selection is empty, or the edit cannot be made.
        """

    def plain(self) -> dict[str, Any]:
        """The edit as a table of plain values: what differs from the defaults."""
        return {"do": self.do} | self.model_dump(mode="json", exclude_defaults=True, exclude={"do"})


AnyEdit = TypeVar("AnyEdit", bound=Edit)


class SelectingEdit(Edit):
    """An edit of some of the truss."""

    where: Chosen = Field(default=Everything(), description="Which curves or members; default: all.")

    def plain(self) -> dict[str, Any]:
        table = super().plain()
        if not table.get("where", True):
            del table["where"]
        return table

    def narrowed(self, parts: Iterable[int]) -> "SelectingEdit":
        """The same edit of the curves of some parts only."""
        return self.model_copy(update={"where": self.where & Part(tuple(parts))})

    def curves(self, truss: Truss) -> np.ndarray:
        """The selected curves as a mask; at least one."""
        return self._some(truss, self.where.curves(truss), "curve")

    def members(self, truss: Truss) -> np.ndarray:
        """The selected members as a mask; at least one."""
        return self._some(truss, self.where.members(truss), "member")

    def _some(self, truss: Truss, mask: np.ndarray, what: str) -> np.ndarray:
        counts = {name: sum(curve.family == name for curve in truss.curves) for name in FAMILIES}
        there = ", ".join(f"{count} {name}" for name, count in counts.items() if count)
        require(mask.any(), f"edit {self.do!r}: no {what} is selected by {self.where}; the truss has {there} curves")
        return mask
