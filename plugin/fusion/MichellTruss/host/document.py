"""Trusses in the document: the layout and the knobs live in attributes of the truss's component, and save with it."""

import json
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import adsk.core
import adsk.fusion

from ..logic.layout import Layout, LayoutError, parse_layout

GROUP = "MichellTruss"
"""Group of all the add-in's attributes."""

_PIECE = 1_000_000
"""Characters of the layout in one attribute; Fusion takes up to 2 MB in each."""


@dataclass(frozen=True)
class DrawnTruss:
    """A truss in the document, known by its prefix, for example `michell1_`."""

    occurrence: adsk.fusion.Occurrence

    @property
    def prefix(self) -> str:
        """What the names of its user parameters begin with."""
        return self._read("prefix")

    @property
    def values(self) -> dict[str, Any]:
        """The knobs that it was drawn with."""
        return json.loads(self._read("knobs"))

    @property
    def materials(self) -> list[dict[str, Any]]:
        """Materials given along isosurfaces, in the order in which they were given."""
        return json.loads(self._read("materials"))

    @cached_property
    def layout(self) -> Layout:
        """The layout that it was drawn from."""
        pieces = (self._read(f"layout{piece}") for piece in range(int(self._read("pieces"))))
        return parse_layout("".join(pieces), "The layout in this document")

    def remember_materials(self, materials: list[dict[str, Any]]) -> None:
        """Write the materials given along isosurfaces."""
        self._write("materials", json.dumps(materials))

    def store(self, prefix: str, layout: Layout, values: dict[str, Any]) -> None:
        """Write all of the attributes."""
        self._write("prefix", prefix)
        self._write("knobs", json.dumps(values))
        self.remember_materials([])
        pieces = [layout.text[first : first + _PIECE] for first in range(0, len(layout.text), _PIECE)]
        for number, piece in enumerate(pieces):
            self._write(f"layout{number}", piece)
        self._write("pieces", str(len(pieces)))

    def _read(self, name: str) -> str:
        attribute = self.occurrence.component.attributes.itemByName(GROUP, name)
        if not attribute:
            raise LayoutError("This truss was not completed. Delete it and draw it again.")
        return attribute.value

    def _write(self, name: str, value: str) -> None:
        self.occurrence.component.attributes.add(GROUP, name, value)


def drawn_trusses(design: adsk.fusion.Design) -> list[DrawnTruss]:
    """The trusses in a design, in the order of the browser."""
    occurrences = design.rootComponent.occurrences
    all_of_them = (occurrences.item(number) for number in range(occurrences.count))
    return [DrawnTruss(one) for one in all_of_them if one.component.attributes.itemByName(GROUP, "pieces")]


def selected_truss(design: adsk.fusion.Design) -> DrawnTruss:
    """The truss whose custom feature or component is selected, or else the last one.

    Raises
    ------
    LayoutError
        If there is none.
    """
    trusses = drawn_trusses(design)
    if not trusses:
        raise LayoutError("There is no truss in this design. Draw one first (Draw Truss).")
    for truss in trusses:
        if truss.prefix == selected_prefix():
            return truss
    return trusses[-1]


def selected_prefix() -> str | None:
    """The prefix of the truss that the first selected entity belongs to."""
    selections = adsk.core.Application.get().userInterface.activeSelections
    if not selections.count:
        return None
    entity = selections.item(0).entity
    feature, occurrence = adsk.fusion.CustomFeature.cast(entity), adsk.fusion.Occurrence.cast(entity)
    component = feature.parentComponent if feature else occurrence.component if occurrence else None
    return component_prefix(component) if component else None


def component_prefix(component: adsk.fusion.Component) -> str | None:
    """The prefix of the truss that a component of the add-in belongs to."""
    attribute = component.attributes.itemByName(GROUP, "prefix")
    return attribute.value if attribute else None


def free_prefix(design: adsk.fusion.Design) -> str:
    """A prefix that no truss of the design has."""
    taken = {truss.prefix for truss in drawn_trusses(design)}
    number = 1
    while f"michell{number}_" in taken:
        number += 1
    return f"michell{number}_"
