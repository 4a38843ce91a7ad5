"""Colours of the families, and materials along isosurfaces.

Libraries, materials and appearances are found by their ids, which are the same in every language of Fusion.
"""

from collections.abc import Iterator

import adsk.core
import adsk.fusion

from ..logic.colours import COLOURS
from ..logic.isosurface import Isosurface
from . import events
from .document import GROUP, DrawnTruss

APPEARANCE_LIBRARY, PLAIN_APPEARANCE = "BA5EE55E-9982-449B-9D66-9F036540E140", "Prism-093"
"""Fusion's appearance library, and in it a powder coat, whose only colour is replaced."""

MATERIAL_LIBRARY = "C1EEA57C-3F56-45FC-B8CB-A9EC46A9994C"
"""Fusion's library of physical materials."""


def colour_family(design: adsk.fusion.Design, occurrence: adsk.fusion.Occurrence, family: str) -> None:
    """Colour the component of a family; without Fusion's appearance library it stays as it is."""
    appearance = _family_appearance(design, family)
    if appearance:
        occurrence.appearance = appearance


def _family_appearance(design: adsk.fusion.Design, family: str) -> adsk.core.Appearance | None:
    name = f"Michell {family}"
    there = design.appearances.itemByName(name)
    if there:
        return there
    library = events.application().materialLibraries.itemById(APPEARANCE_LIBRARY)
    plain = library.appearances.itemById(PLAIN_APPEARANCE) if library else None
    if not plain:
        return None
    appearance = design.appearances.addByCopy(plain, name)
    properties = appearance.appearanceProperties
    for number in range(properties.count):
        colour = adsk.core.ColorProperty.cast(properties.item(number))
        if colour:
            colour.value = adsk.core.Color.create(*COLOURS.get(family, COLOURS["feature"]), 255)
            break
    return appearance


def materials(design: adsk.fusion.Design) -> dict[str, adsk.core.Material]:
    """The materials of the document and of Fusion's library, by name."""
    found: dict[str, adsk.core.Material] = {}
    library = events.application().materialLibraries.itemById(MATERIAL_LIBRARY)
    for collection in (design.materials, *([library.materials] if library else [])):
        for number in range(collection.count):
            material = collection.item(number)
            found.setdefault(material.name, material)
    return found


def give_material(design: adsk.fusion.Design, truss: DrawnTruss, surface: Isosurface, name: str) -> int:
    """Give every body of the curves on an isosurface a material; return how many bodies got it."""
    material = materials(design).get(name)
    if not material:
        return 0
    on_surface = {number for number, curve in enumerate(truss.layout.curves) if surface.holds(curve)}
    bodies = [body for curve, body in curve_bodies(truss) if curve in on_surface]
    for body in bodies:
        body.material = material
    return len(bodies)


def curve_bodies(truss: DrawnTruss) -> Iterator[tuple[int, adsk.fusion.BRepBody]]:
    """The bodies of a truss with the numbers of their curves in the layout."""
    families = truss.occurrence.component.occurrences
    for number in range(families.count):
        bodies = families.item(number).component.bRepBodies
        for place in range(bodies.count):
            body = bodies.item(place)
            attribute = body.attributes.itemByName(GROUP, "curve")
            if attribute:
                yield int(attribute.value), body
