"""Which part of the surface is meant: CadQuery selectors, face numbers, boxes, spheres, planes, nearest points.

Source: the selector strings are those of CadQuery (https://cadquery.readthedocs.io/en/latest/selectors.html), run by
CadQuery on the CAD faces. Departures: a face may be named by its number, as `michell-cad faces` shows it; parts without
a CAD model (surface and tet meshes) have numbered patches between sharp edges instead of CAD faces, for which numbers
and regions work, strings do not.

All coordinates are in the unit of the part's file (`[part] units`).
"""

from collections.abc import Sequence
from typing import Annotated, cast

import numpy as np
from jaxtyping import Int
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from michell_cad.domain.outline import Outline, Part, Surface
from michell_cad.errors import InvalidInputError

REGION_TOLERANCE = 1e-6
"""Slack of boxes and spheres, relative to the diagonal of the part: what lies on their border is inside."""

PLANE_TOLERANCE = 1e-4
"""Default tolerance of a plane region, relative to the diagonal of the part."""

CQ_TOLERANCE = 1e-4
"""CadQuery counts centres closer than this as one level, mm (its DirectionNthSelector)."""

LARGEST_NEAREST = 0.5
"""A patch that covers more of the surface than this is no answer to `nearest` on a mesh (relative)."""

LISTED_FACES = 24
"""Faces that a message lists at most."""

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Vector = tuple[Number, Number, Number]

_STRICT = ConfigDict(extra="forbid", frozen=True)


class Sphere(BaseModel):
    """A ball: triangles whose centroid lies inside."""

    model_config = _STRICT
    centre: Vector = Field(description="Centre, in the part's units.")
    radius: Number = Field(gt=0, description="Radius, in the part's units.")


class FlatRegion(BaseModel):
    """An unbounded plane: triangles with all corners on it."""

    model_config = _STRICT
    point: Vector = Field(description="A point of the plane, in the part's units.")
    normal: Vector = Field(description="Normal of the plane; its length does not matter.")
    tolerance: Number | None = Field(
        default=None, gt=0, description="Largest distance, in the part's units; default: 1e-4 of the part's diagonal."
    )

    @field_validator("normal")
    @classmethod
    def _not_zero(cls, value: Vector) -> Vector:
        if not any(value):
            raise ValueError("must not be the zero vector")
        return value


class Region(BaseModel):
    """A region of the surface, named in exactly one way."""

    model_config = _STRICT
    faces: str | int | tuple[str, ...] | tuple[int, ...] | None = Field(
        default=None,
        description="CadQuery face selectors, applied one after the other, or the numbers of faces.",
    )
    box: tuple[Vector, Vector] | None = Field(
        default=None, description="Two opposite corners: triangles whose centroid lies in the box. In the part's units."
    )
    sphere: Sphere | None = None
    plane: FlatRegion | None = None
    nearest: Vector | None = Field(default=None, description="The face nearest to this point, in the part's units.")

    @field_validator("faces", mode="before")
    @classmethod
    def _plain_faces(cls, value: object) -> object:
        """Say in one sentence what may stand here, instead of one message per alternative."""
        items = list(value) if isinstance(value, list | tuple) else [value]
        texts = [item for item in items if isinstance(item, str)]
        numbers = [item for item in items if type(item) is int]
        if value is not None and not (items and len(items) in (len(texts), len(numbers))):
            raise ValueError(
                f'expected selector strings (">Z" or ["%CYLINDER", "<Z"]) or face numbers, found {value!r}'
            )
        if not all(text.strip() for text in texts):
            raise ValueError("a selector must not be empty")
        return value

    @model_validator(mode="after")
    def _one_way(self) -> "Region":
        given = [key for key in REGION_KEYS if getattr(self, key) is not None]
        if len(given) > 1:
            raise ValueError(f"give one of {', '.join(REGION_KEYS)}, found {' and '.join(given)}")
        return self

    @property
    def described(self) -> str:
        """The region as it stands in the job, for messages."""
        for key in REGION_KEYS:
            value = getattr(self, key)
            if value is not None:
                if isinstance(value, BaseModel):
                    value = {k: v for k, v in value.model_dump().items() if v is not None}
                return f"{key} = {_toml(value)}"
        return "no region"


REGION_KEYS = ("faces", "box", "sphere", "plane", "nearest")


AnyPart = Outline | Part
"""What a selection works on: a part before or after meshing."""


def select_triangles(
    part: AnyPart, region: Region | str | int | Sequence[str] | Sequence[int]
) -> Int[np.ndarray, " k"]:
    """Return the triangles of the part's surface that a region means, ascending.

    For a `Part` these are numbers of boundary triangles of its tet mesh.

    Parameters
    ----------
    part : a `Part`, or an `Outline` (then triangles of the outline's own surface).
    region : a `Region`, or what its `faces` takes.

    Raises
    ------
    InvalidInputError
        If the region matches nothing or a selector cannot be understood; the message lists the faces that exist.
    """
    if not isinstance(region, Region):
        region = Region.model_validate({"faces": region})
    surface = part.surface
    if region.faces is not None:
        chosen = np.isin(surface.face_numbers, select_faces(part, region.faces))
    elif region.box is not None:
        corners = np.array(region.box) * part.unit_mm
        slack = REGION_TOLERANCE * surface.diagonal
        x = surface.centroids
        chosen = ((x >= corners.min(0) - slack) & (x <= corners.max(0) + slack)).all(1)
    elif region.sphere is not None:
        distance = np.linalg.norm(surface.centroids - np.array(region.sphere.centre) * part.unit_mm, axis=1)
        chosen = distance <= region.sphere.radius * part.unit_mm + REGION_TOLERANCE * surface.diagonal
    elif region.plane is not None:
        chosen = _on_plane(surface, region.plane, part.unit_mm)
    elif region.nearest is not None:
        chosen = surface.face_numbers == _nearest_face(part, region)
    else:
        raise InvalidInputError(f"{part.name}: give a region: one of {', '.join(REGION_KEYS)}")
    if not chosen.any():
        raise InvalidInputError(f"{part.name}: {region.described} matches nothing. {list_faces(part)}")
    return np.flatnonzero(chosen)


def select_faces(part: AnyPart, faces: str | int | Sequence[str] | Sequence[int]) -> list[int]:
    """Return the numbers of the faces that selectors (applied one after the other) or numbers mean, ascending."""
    items = [faces] if isinstance(faces, str | int) else list(faces)
    numbers = [item for item in items if isinstance(item, int)]
    if items and len(numbers) == len(items):
        wrong = [number for number in numbers if not 0 <= number < len(part.faces)]
        if wrong:
            raise InvalidInputError(
                f"{part.name}: there is no face {wrong[0]}; faces are numbered 0 to {len(part.faces) - 1}. "
                + list_faces(part)
            )
        return sorted(set(numbers))
    named = f"faces = {_toml(faces)}"
    if part.shape is None:
        raise InvalidInputError(
            f"{part.name}: {named}: selector strings need a CAD part (STEP, BREP); this part is a mesh, whose "
            f"faces are patches between sharp edges: use their numbers, or box, sphere, plane or nearest. "
            + list_faces(part)
        )
    import cadquery as cq
    from pyparsing import ParseBaseException

    number_of = {face: number for number, face in enumerate(part.shape.Faces())}
    stack = cq.Workplane(part.shape)
    for selector in items:
        try:
            stack = stack.faces(str(selector))
        except ParseBaseException as error:
            raise InvalidInputError(
                f"{part.name}: {named}: {selector!r} is not a CadQuery selector (wrong at character {error.loc + 1}); "
                "examples: '>Z' highest, '|X' normal parallel to x, '%CYLINDER' by type, '>>Z[-2]' second highest. "
                + list_faces(part)
            ) from error
        except (ValueError, IndexError, KeyError, AttributeError) as error:
            # '>Z[9]' beyond the last level, or an unknown type or axis name.
            raise InvalidInputError(
                f"{part.name}: {named}: {selector!r} fails ({error}). {list_faces(part)}"
            ) from error
        if not stack.size():
            within = "" if len(items) == 1 else f" (at the step {selector!r})"
            raise InvalidInputError(f"{part.name}: {named} matches nothing{within}. {list_faces(part)}")
    return sorted(number_of[cast("cq.Face", face)] for face in stack.vals())


def suggest_selectors(part: AnyPart) -> list[str | list[str] | list[int]]:
    """For every face, `faces` values that pick exactly it: one string, several strings, or its number.

    The type and then one level after the other along x, y and z are tried until a face is alone; every suggestion is
    run before it is given.
    """
    if part.shape is None:
        return [[face.number] for face in part.faces]
    centres = np.array([face.centre for face in part.faces])
    kinds = np.array([face.kind for face in part.faces])
    return [_suggest(part, centres, kinds, face.number) for face in part.faces]


def _suggest(part: AnyPart, centres: np.ndarray, kinds: np.ndarray, number: int) -> str | list[str] | list[int]:
    candidates: list[list[str]] = []
    everything = np.arange(len(kinds))
    for axis in (2, 0, 1):
        for sign in (">", "<"):
            level, alone = _level(centres[everything, axis], number, everything, sign)
            if alone and level == -1:
                candidates.append([f"{sign}{'XYZ'[axis]}"])
    steps, left = [f"%{kinds[number]}"], np.flatnonzero(kinds == kinds[number])
    if len(left) == 1:
        candidates.append(steps)
    for first, second, third in ((2, 0, 1), (0, 1, 2), (1, 2, 0)):
        chain, rest = list(steps), left
        for axis in (first, second, third):
            sign = ">" if centres[number, axis] >= np.median(centres[rest, axis]) else "<"
            level, _ = _level(centres[rest, axis], number, rest, sign)
            same = rest[np.abs(centres[rest, axis] - centres[number, axis]) <= CQ_TOLERANCE]
            if len(same) < len(rest):
                # '>Z[n]' would count flat faces across z only; '>>Z[n]' counts the centres of all faces.
                chain.append(f"{sign}{'XYZ'[axis]}" if level == -1 else f"{2 * sign}{'XYZ'[axis]}[{level}]")
                rest = same
            if len(rest) == 1:
                break
        if len(rest) == 1:
            candidates.append(chain)
    for candidate in sorted(candidates, key=len):
        try:
            if select_faces(part, candidate) == [number]:
                return candidate[0] if len(candidate) == 1 else candidate
        except InvalidInputError:
            # CadQuery's levels differ from ours in a borderline case: the next candidate, at last the number.
            continue
    return [number]


def _level(values: np.ndarray, number: int, members: np.ndarray, sign: str) -> tuple[int, bool]:
    """CadQuery's index [n] of a face among its centres along an axis (-1: the outermost), and whether it is alone."""
    own = values[np.flatnonzero(members == number)[0]]
    sorted_values = np.sort(values if sign == ">" else -values)
    target = own if sign == ">" else -own
    levels = sorted_values[np.concatenate([[True], np.diff(sorted_values) > CQ_TOLERANCE])]
    index = int(np.argmin(np.abs(levels - target))) - len(levels)
    return index, bool((np.abs(values - own) <= CQ_TOLERANCE).sum() == 1)


def list_faces(part: AnyPart) -> str:
    """The faces of a part as text for a message: number, type, centre (in the part's units) and area."""
    lines = []
    for face in part.faces[:LISTED_FACES]:
        x = ", ".join(f"{value / part.unit_mm:.4g}" for value in _clean(face.centre))
        lines.append(f"{face.number} {face.kind} at ({x}), {face.area:.4g} mm2")
    more = len(part.faces) - LISTED_FACES
    tail = f"; and {more} more" if more > 0 else ""
    head = f"The part has {len(part.faces)} faces: "
    return head + "; ".join(lines) + tail + ". `michell-cad faces` shows them with selectors"


def _on_plane(surface: Surface, plane: FlatRegion, unit_mm: float) -> np.ndarray:
    normal = np.array(plane.normal) / np.linalg.norm(plane.normal)
    height = (surface.vertices - np.array(plane.point) * unit_mm) @ normal
    tolerance = PLANE_TOLERANCE * surface.diagonal if plane.tolerance is None else plane.tolerance * unit_mm
    return np.all(np.abs(height[surface.triangles]) <= tolerance, axis=1)


def _nearest_face(part: AnyPart, region: Region) -> int:
    import igl

    point = np.array([region.nearest], float) * part.unit_mm
    surface = part.surface
    hit = np.asarray(igl.point_mesh_squared_distance(point, surface.vertices, surface.triangles)[1])
    number = int(surface.face_numbers[hit[0]])
    share = surface.areas[surface.face_numbers == number].sum() / surface.areas.sum()
    if part.shape is None and share > LARGEST_NEAREST:
        raise InvalidInputError(
            f"{part.name}: {region.described} is on a patch without sharp edges that covers {100 * share:.0f} % of the "
            "surface; use a sphere, box or plane instead"
        )
    return number


def _clean(values: Sequence[float]) -> list[float]:
    """Round what is zero up to rounding, so that no message shows -4e-16."""
    return [0.0 if abs(value) < 1e-9 else value for value in values]


def _toml(value: object) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k} = {_toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    return f"{value:g}" if isinstance(value, float) else str(value)
