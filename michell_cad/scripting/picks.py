"""Supports and loads as scripts write them, and the job that they mean.

A place on the part is what `faces` of a job takes (a CadQuery selector, a tuple of selectors one after the other, face
numbers), or faces themselves: of build123d or CadQuery, one, several, or a Workplane with faces on its stack.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from michell_cad.arrays import require
from michell_cad.domain import Outline
from michell_cad.errors import InvalidInputError
from michell_cad.job import Setup, parse_job


def make_setup(
    outline: Outline,
    supports: Any = None,
    loads: Any = None,
    material: str | None = None,
    resolution: float | None = None,
    spacing: float | None = None,
    mesh_size: float | None = None,
    job: Mapping[str, Any] | None = None,
) -> Setup:
    """The job of a part that comes from a script.

    Parameters
    ----------
    outline : the part.
    supports : one support or a list of them; each a place, or a table of a job's ``[[support]]``.
    loads : one load or a list of them; each a place with its force (N), or a table of a job's ``[[load]]``.
    material, resolution, spacing, mesh_size : those of the job, where they are given.
    job : further tables of a job, such as ``{"options": {"layers": "hug"}}``.

    Raises
    ------
    InvalidInputError
        For faces that are not of the part, and what a job file would be refused for.
    """
    tables: dict[str, Any] = dict(job or {})
    tables["support"] = [*tables.get("support", []), *(_support(outline, one) for one in _listed(supports))]
    tables["load"] = [*tables.get("load", []), *(_load(outline, one) for one in _listed(loads))]
    given = (
        ("material", "name", material),
        ("options", "resolution", resolution),
        ("options", "spacing", spacing),
        ("mesh", "size", mesh_size),
    )
    for table, key, value in given:
        if value is not None:
            tables[table] = {**tables.get(table, {}), key: value}
    return parse_job({**tables, "part": {"file": outline.name}}, outline.name)


def pick_faces(outline: Outline, place: Any) -> Any:
    """A place as `faces` of a job has it: selectors or numbers stay, faces become their numbers.

    Raises
    ------
    InvalidInputError
        If faces are not of the part, or the place is nothing of the kind.
    """
    items = place if isinstance(place, tuple | list) else (place,)
    if items and all(isinstance(item, str | int) for item in items):
        return place
    import cadquery as cq

    faces = [face for item in items for face in _handles(item)]
    require(faces, f"{outline.name}: expected a selector, face numbers or faces, found {place!r}")
    require(outline.shape is not None, f"{outline.name}: faces can be picked on CAD parts only")
    number_of = {face: number for number, face in enumerate(outline.shape.Faces())}
    numbers = []
    for face in faces:
        shape = cq.Shape.cast(face)
        if shape not in number_of:
            raise InvalidInputError(
                f"{outline.name}: a picked {shape.ShapeType().lower()} is no face of this part: pick faces of the very "
                "object that is given as the part, as it stands there"
            )
        numbers.append(number_of[shape])
    return numbers


def _handles(item: Any) -> list[Any]:
    """The kernel's shapes in a face, a Workplane, or a list of faces such as build123d's."""
    if hasattr(item, "vals"):
        return [handle for value in item.vals() for handle in _handles(value)]
    if getattr(item, "wrapped", None) is not None:
        return [item.wrapped]
    if isinstance(item, Iterable) and not isinstance(item, str):
        return [handle for one in item for handle in _handles(one)]
    return []


def _listed(value: Any) -> list[Any]:
    """Several are a list, but not a list of build123d's; a tuple is one: selectors, or a place with its force."""
    if value is None:
        return []
    return list(value) if type(value) is list else [value]


def _support(outline: Outline, support: Any) -> dict[str, Any]:
    return _table(outline, support) if isinstance(support, Mapping) else {"faces": pick_faces(outline, support)}


def _load(outline: Outline, load: Any) -> dict[str, Any]:
    if isinstance(load, Mapping):
        return _table(outline, load)
    if not isinstance(load, tuple) or len(load) != 2 or isinstance(load[1], str):
        raise InvalidInputError(
            f"{outline.name}: a load is a place with its force in N, such as ('>X', (0, 0, -500)), or a table such as "
            f"{{'faces': '>X', 'pressure': 0.2}}; found {load!r}"
        )
    place, force = load
    return {"faces": pick_faces(outline, place), "force": [float(x) for x in force]}


def _table(outline: Outline, table: Mapping[str, Any]) -> dict[str, Any]:
    return {key: pick_faces(outline, value) if key == "faces" else value for key, value in table.items()}
