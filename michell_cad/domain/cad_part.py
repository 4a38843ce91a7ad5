"""CAD parts: STEP and BREP files, CadQuery and build123d objects -> an outline that keeps the CAD faces.

The kernel is reached through CadQuery only, which is imported when a CAD part is first read. One solid makes a part.
Its faces are numbered in the kernel's order, which stays the same for the same file.

Units. A STEP file says in which unit it is written, and the kernel converts to mm. A `units` other than that stated
unit (and other than mm, which means "as the file says") overrules the file: its numbers are then taken in `units`. A
BREP file has no unit; its numbers are in `units`. Objects from Python are in mm, as CadQuery and build123d have it.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np

from michell_cad.domain.outline import Outline, PartFace, Surface, unit_length
from michell_cad.domain.surface_checks import check_surface, merge_vertices
from michell_cad.errors import InvalidInputError

CHORD_TOLERANCE = 2e-4
"""Distance between the tessellation and the true surface, relative to the diagonal of the part: a quarter of the tet
mesher's usual envelope. Finer triangles cost the mesher time (a torus took 50 s with half of this, 15 s with it)."""

ANGULAR_TOLERANCE = 0.2
"""Angle between neighbouring facets of the tessellation, radians: 32 facets around a circle lose 0.6 % of its area."""

VOLUME_TOLERANCE = 0.01
"""Largest difference between the volumes of tessellation and CAD solid (relative); beyond it the file is damaged."""

_STEP_UNITS = {"mm": r"SI_UNIT\(\.MILLI\.,\.METRE\.\)", "cm": r"SI_UNIT\(\.CENTI\.,\.METRE\.\)"}
_STEP_UNITS |= {"m": r"SI_UNIT\(\$,\.METRE\.\)"}


def read_cad_file(path: Path, units: str | None) -> Outline:
    """Read a STEP or BREP file (`units`: see the module) as an outline in mm."""
    import cadquery as cq

    name = path.name
    if path.suffix.lower() in (".step", ".stp"):
        text = path.read_text(encoding="latin-1")
        if not text.lstrip().startswith("ISO-10303-21"):
            raise InvalidInputError(f"{name}: not a STEP file: it should begin with ISO-10303-21;")
        try:
            shapes = cq.importers.importStep(str(path)).vals()
        except ValueError as error:
            raise InvalidInputError(f"{name}: the STEP file cannot be read ({error}); export it again") from error
        scale = _overruling_scale(text, units)
    else:
        if b"CASCADE Topology" not in path.read_bytes()[:4096]:
            raise InvalidInputError(
                f"{name}: not a BREP file: the line 'CASCADE Topology V..' is missing at its beginning"
            )
        try:
            shapes = [cq.Shape.importBrep(str(path))]
        except ValueError as error:
            raise InvalidInputError(f"{name}: the BREP file cannot be read ({error}); export it again") from error
        scale = unit_length(units or "mm")
    solids = [solid for shape in shapes if isinstance(shape, cq.Shape) for solid in shape.Solids()]
    return _outline(_only_solid(solids, name), name, scale, unit_length(units or "mm"))


def outline_from_shape(obj: Any, name: str = "part") -> Outline:
    """Make an outline of a CadQuery Workplane or Shape, or of a build123d Part, Solid or Compound, in mm."""
    import cadquery as cq

    values: list[Any] = obj.vals() if isinstance(obj, cq.Workplane) else [obj]
    solids = []
    for value in values:
        handle = getattr(value, "wrapped", None)
        if handle is None:
            raise InvalidInputError(
                f"{name}: expected a CadQuery Workplane or Shape or a build123d Part or Solid, "
                f"found {type(value).__name__}"
            )
        solids += cq.Shape.cast(handle).Solids()
    return _outline(_only_solid(solids, name), name, 1.0, 1.0)


def _only_solid(solids: list, name: str) -> Any:
    if not solids:
        raise InvalidInputError(f"{name}: holds no solid; export a closed solid body, not surfaces or wires")
    if len(solids) > 1:
        volumes = ", ".join(f"{solid.Volume():.4g}" for solid in solids[:6])
        raise InvalidInputError(
            f"{name}: expected one solid, found {len(solids)} (volumes {volumes}{', ...' if len(solids) > 6 else ''}); "
            "unite them in CAD, or export the body to be designed alone"
        )
    return solids[0]


def _overruling_scale(step: str, units: str | None) -> float:
    """Return the factor by which the kernel's mm have to be multiplied because `units` overrules the file."""
    if units is None or units == "mm":
        return 1.0
    wanted = unit_length(units)
    text = re.sub(r"\s+", "", step.upper())
    if re.search(r"CONVERSION_BASED_UNIT\('INCH'", text):
        return wanted / unit_length("in")
    for unit, pattern in _STEP_UNITS.items():
        if re.search(pattern, text):
            return wanted / unit_length(unit)
    return wanted


def _outline(solid: Any, name: str, scale: float, unit_mm: float) -> Outline:
    volume = solid.Volume() * scale**3
    if not np.isfinite(volume) or volume == 0:
        raise InvalidInputError(f"{name}: the solid has the volume {volume:g} mm3; export a closed solid body")
    if scale != 1.0:
        solid = solid.scale(scale)
    faces = solid.Faces()
    surface = _tessellate(solid, faces, name)
    if abs(surface.volume - abs(volume)) > VOLUME_TOLERANCE * abs(volume):
        raise InvalidInputError(
            f"{name}: the surface encloses {surface.volume:.6g} mm3 but the solid claims {volume:.6g} mm3; "
            "the body is damaged: heal it in CAD and export it again"
        )
    table = tuple(_describe_face(number, face) for number, face in enumerate(faces))
    return Outline(name, surface, table, abs(volume), unit_mm=unit_mm, shape=solid)


def _tessellate(solid: Any, faces: list, name: str) -> Surface:
    box = solid.BoundingBox()
    diagonal = float(box.DiagonalLength)
    # Meshing the whole solid first makes neighbouring faces share the points of their edges.
    solid.mesh(CHORD_TOLERANCE * diagonal, ANGULAR_TOLERANCE)
    points, triangles, numbers, offset = [], [], [], 0
    for number, face in enumerate(faces):
        vertices, indices = face.tessellate(CHORD_TOLERANCE * diagonal, ANGULAR_TOLERANCE)
        if not indices:
            raise InvalidInputError(
                f"{name}: face {number} ({face.geomType()}) cannot be tessellated; "
                "heal the body in CAD and export it again"
            )
        points.append(np.array([vertex.toTuple() for vertex in vertices]))
        triangles.append(np.array(indices, np.int64) + offset)
        numbers.append(np.full(len(indices), number))
        offset += len(vertices)
    V, F = merge_vertices(np.concatenate(points), np.concatenate(triangles))
    owner = np.concatenate(numbers)
    proper = (F[:, 0] != F[:, 1]) & (F[:, 1] != F[:, 2]) & (F[:, 2] != F[:, 0])
    V, F = check_surface(V, F[proper], name)
    return Surface(V, F, owner[proper])


def _describe_face(number: int, face: Any) -> PartFace:
    kind = face.geomType()
    direction, radius = None, None
    centre = face.Center()
    if kind == "PLANE":
        direction = face.normalAt().toTuple()
    elif kind in ("CYLINDER", "CONE", "TORUS", "SPHERE"):
        surface = face._geomAdaptor()
        while hasattr(surface, "BasisSurface"):  # one that is trimmed, as extruding an arc makes it
            surface = surface.BasisSurface()
        geometry = getattr(surface, kind.capitalize())()
        if kind != "SPHERE":
            axis = geometry.Axis().Direction()
            direction = (axis.X(), axis.Y(), axis.Z())
        if kind in ("CYLINDER", "SPHERE"):
            radius = float(geometry.Radius())
    return PartFace(number, kind, float(face.Area()), centre.toTuple(), direction, radius)
