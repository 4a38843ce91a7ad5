"""Solids to keep: material of the part beside some of its faces, and the room in front of them that stays free.

Source: none. The kept material of a face is all of the part within a depth along the face's normals: the kernel
thickens the face inward, and the part bounds the result, so that holes stay holes. In front of the face the same is
done outward: what the truss has there, outside of the part, is cut away (members on the surface are half outside).
Round holes are cleared as a whole and beyond their ends, there as wide as the kept material, so that a bolt goes
through and its head finds a flat seat.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from michell_cad.arrays import require
from michell_cad.domain.outline import Outline, Part
from michell_cad.errors import InvalidInputError
from michell_cad.selection import Region, select_faces, select_triangles

LARGEST_SHARE = 0.999
"""Kept material must not be more than this fraction of the part: no truss would be left."""

CLEARANCE_SHARES = (1.0, 0.5, 0.25)
"""A bent face may have room for a part of the clearance only (relative to what is wanted)."""


@dataclass(frozen=True, eq=False)
class KeptSolid:
    """Solids that a truss will be united with.

    Parameters
    ----------
    name : faces and reports show it.
    solids : handles of the CAD kernel.
    clearance : handles of solids that the truss must not enter. Where both overlap, material is kept.
    """

    name: str
    solids: tuple[Any, ...] = field(repr=False)
    clearance: tuple[Any, ...] = field(default=(), repr=False)

    def __post_init__(self) -> None:
        require(self.name, "a kept solid needs a name")
        require(self.solids, f"{self.name}: there is no solid to keep")


def kept_shape(name: str, shape: Any, clearance: Any = ()) -> KeptSolid:
    """Name CAD objects to be united with a truss.

    Parameters
    ----------
    name : for faces and reports.
    shape : a solid of build123d or CadQuery, a Workplane, or a sequence of these.
    clearance : likewise, what stays free of members.
    """
    from michell_cad.cad import kernel_booleans as booleans

    return KeptSolid(name, tuple(booleans.solids_in(shape)), tuple(booleans.solids_in(clearance) if clearance else ()))


def keep_material(
    part: Outline | Part,
    faces: Region | str | int | Sequence[str] | Sequence[int],
    depth: float,
    clearance: float,
    name: str = "keep",
) -> KeptSolid:
    """The material of a part within a depth of some of its faces.

    Parameters
    ----------
    part : a part with CAD faces.
    faces : a region, or what its `faces` takes; a region means the faces on which it has triangles.
    depth : mm, along the inward normals of the faces.
    clearance : mm, how far the room in front of the faces stays free of members.
    name : for faces and reports.

    Raises
    ------
    InvalidInputError
        For a part without CAD faces, faces that do not exist, or a depth that is not positive, or so large that a face
        cannot be thickened by it or that nothing of the part is left.
    GeometryKernelError
        If the kernel fails in a boolean.
    """
    from michell_cad.cad import kernel
    from michell_cad.cad import kernel_booleans as booleans

    require(depth > 0, f"{name}: depth must be positive, found {depth:g} mm")
    require(clearance > 0, f"{name}: clearance must be positive, found {clearance:g} mm")
    if part.shape is None:
        raise InvalidInputError(
            f"{name}: {part.name} is a mesh without CAD faces, of which no material can be kept: give the part as STEP "
            "or BREP, or leave the table out"
        )
    body, all_faces = booleans.solids_in(part.shape)[0], part.shape.Faces()
    layers, rooms = [], []
    for number in _face_numbers(part, faces):
        face = all_faces[number].wrapped
        layer = booleans.layer_on_face(face, -depth)
        require(
            layer is not None,
            f"{name}: face {number} cannot be thickened by depth = {depth:g} mm, it is bent more sharply than that: "
            "use a smaller depth",
        )
        layers += booleans.intersect(layer, body)
        rooms += _room_before(face, depth, clearance, body)
    kept = booleans.unite(layers)
    volume, whole = sum(map(kernel.volume, kept)), kernel.volume(body)
    require(
        volume < LARGEST_SHARE * whole,
        f"{name}: depth = {depth:g} mm keeps the whole part ({volume:.4g} of {whole:.4g} mm3): use a smaller depth",
    )
    return KeptSolid(name, tuple(kept), tuple(rooms))


def _face_numbers(part: Outline | Part, faces: Region | str | int | Sequence[str] | Sequence[int]) -> list[int]:
    region = faces if isinstance(faces, Region) else Region.model_validate({"faces": faces})
    if region.faces is not None:
        return select_faces(part, region.faces)
    return sorted(set(part.surface.face_numbers[select_triangles(part, region)].tolist()))


def _room_before(face: Any, depth: float, clearance: float, body: Any) -> list[Any]:
    """Solids in front of a face, outside of the part."""
    from michell_cad.cad import kernel_booleans as booleans

    room = booleans.plug_hole(face, depth, clearance)
    for share in CLEARANCE_SHARES:
        room = booleans.layer_on_face(face, share * clearance) if room is None else room
    return [] if room is None else booleans.subtract(room, body)
