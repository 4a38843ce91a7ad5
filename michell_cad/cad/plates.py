"""Sheets as CAD solids: a plate's triangles as flat faces of one closed shell, and STEP files of plates and copies."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import build123d as bd
import cadquery as cq
import numpy as np
from build123d.topology import Shape
from cadquery.occ_impl.shapes import shell as sewn
from cadquery.occ_impl.shapes import solid as solid_from
from jaxtyping import Float, Int

from michell_cad.closed_mesh import ClosedMesh
from michell_cad.edits import Frames
from michell_cad.errors import GeometryKernelError, InvalidInputError
from michell_cad.files import writing

LARGEST_VOLUME_DIFFERENCE = 1e-6
"""Between a solid of flat faces and its mesh (relative): both are the same polyhedron."""

DRAWN, DRAWN_ANGLE = 0.02, 0.5
"""How far triangles that are drawn may be off (relative to the part's diagonal), and how far they may turn, radians."""

SEWING = 0.05
"""Corners nearer than this are one when faces are sewn (relative to the shortest edge)."""


def solid_of_plate(plate: ClosedMesh) -> bd.Solid:
    """The polyhedron of a closed mesh as a solid.

    Raises
    ------
    GeometryKernelError
        If no valid solid comes out.
    """
    corners = [cq.Vector(*point) for point in plate.vertices.tolist()]
    faces = [
        cq.Face.makeFromWires(cq.Wire.makePolygon([corners[k] for k in triangle], close=True))
        for triangle in plate.triangles.tolist()
    ]
    ends = plate.vertices[plate.triangles]
    shortest = float(np.linalg.norm(ends - np.roll(ends, 1, axis=1), axis=2).min())
    solid = solid_from(sewn(faces, tol=SEWING * shortest))
    if not solid.isValid() or abs(solid.Volume() / plate.volume - 1) > LARGEST_VOLUME_DIFFERENCE:
        raise GeometryKernelError(
            f"a sheet of {len(faces)} triangles makes no valid solid: volume {solid.Volume():.6g} mm^3, its mesh "
            f"{plate.volume:.6g} mm^3; its mesh can be written as STL"
        )
    return bd.Solid(solid.wrapped)


def place_copies(shape: Any, frames: Frames) -> bd.Compound:
    """Copies of a build123d or CadQuery object, or of the part in a CAD file: its axes along those of each frame."""
    one = _shape(shape)
    places = [
        bd.Plane(tuple(origin), x_dir=tuple(axes[:, 0]), z_dir=tuple(axes[:, 2])).location
        for origin, axes in zip(np.asarray(frames.origins), np.asarray(frames.axes), strict=True)
    ]
    return bd.Compound([one.moved(place) for place in places])


def mesh_copies(shape: Any, frames: Frames) -> tuple[Float[np.ndarray, "n 3"], Int[np.ndarray, "t 3"]]:
    """Vertices and triangles of the same copies, coarse, to be drawn."""
    one = _shape(shape)
    corners, faces = one.tessellate(DRAWN * one.bounding_box().diagonal, DRAWN_ANGLE)
    points, triangles = np.array([tuple(corner) for corner in corners]), np.array(faces, np.int64)
    origins, axes = np.asarray(frames.origins), np.asarray(frames.axes)
    placed = origins[:, None] + np.einsum("nij,kj->nki", axes, points)
    numbers = len(points) * np.arange(len(origins))[:, None, None] + triangles
    return placed.reshape(-1, 3), numbers.reshape(-1, 3)


def _shape(shape: Any) -> Shape:
    """A build123d or CadQuery object, or the part in a CAD file, as a shape of build123d."""
    if isinstance(shape, str | Path):
        path = Path(shape)
        if not path.is_file():
            raise InvalidInputError(f"edit 'attach': there is no file {path}; expected a .step or .brep part")
        shape = bd.import_brep(str(path)) if path.suffix.lower() in (".brep", ".brp") else bd.import_step(str(path))
    elif isinstance(shape, cq.Workplane):
        shape = shape.val()
    if isinstance(shape, cq.Shape):
        shape = Shape.cast(shape.wrapped)
    return shape


def export_shapes(shapes: Sequence[Shape], path: str | Path) -> None:
    """Write shapes as STEP, in mm; the file is there whole or not at all.

    Raises
    ------
    GeometryKernelError
        If the kernel cannot write the file.
    """
    with writing(Path(path)) as partial:
        if not bd.export_step(bd.Compound(list(shapes)), str(partial)):
            raise GeometryKernelError(f"the kernel could not write {path}")
