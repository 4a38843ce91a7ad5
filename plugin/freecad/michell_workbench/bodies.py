"""Bodies and their faces: what a body is to the computation, and which faces are still the picked ones."""

import math
from dataclasses import replace
from typing import Any

from michell_workbench import messages
from michell_workbench.job import Face, Setup

SAME = 1e-5
"""Two faces are one if areas and centres agree within this (relative to the face and to the body)."""


class FacesGone(Exception):
    """Picked faces are no longer on the body; the text is for the designer."""


def body_shape(body: Any) -> Any:
    """The body's only solid, where it stands in the document.

    Raises
    ------
    ValueError
        If it is not one solid.
    """
    shape = body.Shape
    if len(shape.Solids) != 1:
        raise ValueError(messages.not_a_solid(body.Label, len(shape.Solids)))
    solid = shape.Solids[0].copy()
    outer = body.getGlobalPlacement() * body.Placement.inverse()  # of the containers that the body is in
    solid.Placement = outer * solid.Placement
    return solid


def describe_face(shape: Any, name: str) -> Face:
    """A face of a shape, by its name.

    Raises
    ------
    ValueError
        If there is no such face.
    """
    number = int(name[len("Face") :]) if name.startswith("Face") else 0
    if not 1 <= number <= len(shape.Faces):
        raise ValueError(messages.faces_gone("", [name]))
    face = shape.Faces[number - 1]
    centre = face.CenterOfMass
    return Face(name, face.Surface.TypeId, face.Area, (centre.x, centre.y, centre.z))


def surface_kinds(shape: Any) -> tuple[str, ...]:
    """Kinds of all surfaces, in order."""
    return tuple(face.Surface.TypeId for face in shape.Faces)


def find_faces(shape: Any, setup: Setup, body: str) -> Setup:
    """The setup with its faces as they are on the body now.

    If the body has the same kinds of surfaces in the same order as when the faces were picked, an edit has only changed
    dimensions, and names hold. Otherwise faces are found by kind, area and centre, whatever their names are now.

    Raises
    ------
    FacesGone
        If one is not found; the text names all of them.
    """
    kinds = surface_kinds(shape)
    if kinds == setup.surfaces:
        return setup.with_faces(lambda face: describe_face(shape, face.name))
    there = [describe_face(shape, f"Face{n}") for n in range(1, len(kinds) + 1)]
    near = SAME * shape.BoundBox.DiagonalLength
    gone = [
        f"{face.name} ({place})"
        for place, faces in setup.places()
        for face in faces
        if not any(_same(face, other, near) for other in there)
    ]
    if gone:
        raise FacesGone(messages.faces_gone(body, gone))
    found = setup.with_faces(lambda face: next(other for other in there if _same(face, other, near)))
    return replace(found, surfaces=kinds)


def fingerprint(shape: Any) -> str:
    """A text that changes when the body does."""
    centre = shape.CenterOfMass
    numbers = (shape.Volume, shape.Area, centre.x, centre.y, centre.z)
    return f"{len(shape.Faces)} " + " ".join(f"{round(number, 4) + 0.0:.7g}" for number in numbers)


def _same(face: Face, other: Face, near: float) -> bool:
    return (
        face.kind == other.kind
        and math.isclose(face.area, other.area, rel_tol=SAME)
        and math.dist(face.centre, other.centre) <= near
    )
