"""What comes in: the outline of a part (its surface, its faces), and the part with its tet mesh.

Source: none, this is book-keeping. An `Outline` is quick to make and enough to show faces, to select regions and to
say what a job would do; a `Part` has its tets as well. Both know on which face each of their triangles lies: a face of
the CAD model or, where there is no CAD model, a patch of the surface between sharp edges. All lengths are mm; `unit_mm`
only tells in which unit the designer gives coordinates.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from michell_cad.arrays import freeze, frozen, require
from michell_cad.errors import InvalidInputError
from michell_cad.tet_mesh import TetMesh

UNITS_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
"""Length of the units a file may be in, mm."""


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles with outward normals, each on a numbered face.

    Parameters
    ----------
    vertices : (n_v, 3) float, mm.
    triangles : (n_b, 3) int.
    face_numbers : (n_b,) int, number of the face of each triangle (index into the faces of the part).
    """

    vertices: Float[np.ndarray, "n_v 3"]
    triangles: Int[np.ndarray, "n_b 3"]
    face_numbers: Int[np.ndarray, " n_b"]

    def __post_init__(self) -> None:
        freeze(self, vertices=np.float64, triangles=np.int64, face_numbers=np.int64)
        require(len(self.triangles), "a surface needs at least one triangle")
        require(
            len(self.face_numbers) == len(self.triangles),
            f"face_numbers must have {len(self.triangles)} entries, found {len(self.face_numbers)}",
        )

    @cached_property
    def area_vectors(self) -> Float[np.ndarray, "n_b 3"]:
        """Outward normals times areas, mm^2."""
        a, b, c = self.vertices[self.triangles].transpose(1, 0, 2)
        return frozen(0.5 * np.cross(b - a, c - a))

    @cached_property
    def areas(self) -> Float[np.ndarray, " n_b"]:
        """Areas of the triangles, mm^2."""
        return frozen(np.linalg.norm(self.area_vectors, axis=1))

    @cached_property
    def centroids(self) -> Float[np.ndarray, "n_b 3"]:
        """Centroids of the triangles, mm."""
        return frozen(self.vertices[self.triangles].mean(1))

    @cached_property
    def volume(self) -> float:
        """Enclosed volume, mm^3: the sum of x . n dA / 3 over the triangles, about their middle."""
        middle = self.vertices.mean(0)
        return float(np.einsum("bd,bd->", self.centroids - middle, self.area_vectors) / 3)

    @cached_property
    def diagonal(self) -> float:
        """Diagonal of the bounding box, mm."""
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))


@dataclass(frozen=True)
class PartFace:
    """One numbered face of a part.

    Parameters
    ----------
    number : its number, from 0, as `faces = [number]` in a job selects it.
    kind : PLANE, CYLINDER, CONE, SPHERE, TORUS, BSPLINE ... as CadQuery names the types of a CAD face; PATCH for a
        curved patch of a mesh between sharp edges.
    area : mm^2.
    centre : centroid of the face, mm.
    direction : outward normal of a plane, axis of a cylinder, cone or torus; None for other faces.
    radius : of a cylinder or a sphere, mm; else None.
    """

    number: int
    kind: str
    area: float
    centre: tuple[float, float, float]
    direction: tuple[float, float, float] | None = None
    radius: float | None = None


@dataclass(frozen=True, eq=False)
class Outline:
    """A part before meshing.

    Parameters
    ----------
    name : the file's name, or a name of the caller's choice; messages use it.
    surface : for CAD parts a tessellation much finer than any mesh size, else the surface of the file.
    faces : numbered faces; ``faces[k].number == k``.
    volume : mm^3, the CAD kernel's for CAD parts.
    unit_mm : length of the unit of the designer's coordinates, mm.
    up : the axis (0, 1, 2) that points up in pictures.
    shape : the CAD shape in mm (a `cadquery.Shape`) or None. A handle into the kernel: it is not saved with a design.
    mesh : the tets, if the file has them.
    fixed, force : supports (n_v,) and nodal forces (n_v, 3) in N that the file brings along, or None.
    """

    name: str
    surface: Surface
    faces: tuple[PartFace, ...]
    volume: float
    unit_mm: float = 1.0
    up: int = 2
    shape: Any = field(default=None, repr=False)
    mesh: TetMesh | None = None
    fixed: Bool[np.ndarray, " n_v"] | None = None
    force: Float[np.ndarray, "n_v 3"] | None = None

    def __post_init__(self) -> None:
        if self.fixed is not None:
            freeze(self, fixed=bool)
        if self.force is not None:
            freeze(self, force=np.float64)


@dataclass(frozen=True, eq=False)
class Part:
    """A meshed part: an outline, and tets whose boundary triangles know their face (`TetMesh.cad_faces`)."""

    outline: Outline
    mesh: TetMesh

    @cached_property
    def surface(self) -> Surface:
        """The boundary of the tet mesh; triangle k is boundary triangle k of the mesh."""
        return Surface(self.mesh.vertices, self.mesh.boundary_triangles, np.asarray(self.mesh.cad_faces))

    @property
    def name(self) -> str:
        """Name of the part."""
        return self.outline.name

    @property
    def faces(self) -> tuple[PartFace, ...]:
        """The numbered faces."""
        return self.outline.faces

    @property
    def shape(self) -> Any:
        """The CAD shape (a `cadquery.Shape`) or None."""
        return self.outline.shape

    @property
    def unit_mm(self) -> float:
        """Length of the unit of the designer's coordinates, mm."""
        return self.outline.unit_mm

    @property
    def fixed(self) -> np.ndarray | None:
        """The vertices that the file itself holds, (n_v,) bool, or None."""
        return self.outline.fixed

    @property
    def force(self) -> np.ndarray | None:
        """The nodal forces that the file itself brings, (n_v, 3), N, or None."""
        return self.outline.force


def unit_length(units: str) -> float:
    """Return the length of a named unit, mm."""
    if units not in UNITS_MM:
        raise InvalidInputError(f"[part] units: expected one of {', '.join(UNITS_MM)}, found {units!r}")
    return UNITS_MM[units]
