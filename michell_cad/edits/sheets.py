"""Sheets: plates along isosurfaces of one coordinate, trimmed by the part (Arora et al. 2019, Figure 18).

A piecewise-linear coordinate is constant on a triangle or a flat quadrangle in each tet. The plate has that surface in
its middle. It is carried on a little beyond the part on all sides and then cut along the part's surface by a mesh
boolean, so that its rim lies on the part.
"""

from typing import Literal

import igl
import numpy as np
from jaxtyping import Float, Int
from manifold3d import Error, Manifold, Mesh64
from pydantic import Field, model_validator

from michell_cad.arrays import require
from michell_cad.closed_mesh import ClosedMesh
from michell_cad.edits.structure import Edit, Structure
from michell_cad.errors import GeometryKernelError
from michell_cad.tet_mesh import TetMesh

COARSEST = 0.02
"""Triangles are merged where that moves the plate by less (relative to its thickness)."""

MOST_PASSES = 8
"""Of merging triangles; two to six are enough."""

GENERIC = 1e-3
"""A vertex of the mesh nearer to the value than this (in cells) counts as that far above it: an isosurface through
vertices has triangles without area, and thus without a normal."""

RIM = 1.5
"""The plate is carried on beyond the part by this multiple of its thickness before it is cut."""


class AddSheet(Edit):
    """Plates along the isosurfaces of one coordinate between two values, or along one of them."""

    do: Literal["sheet"] = "sheet"
    coordinate: int | Literal["tension", "compression", "third"] = Field(
        description="0, 1 or 2, or the family that runs along it: the sheets run across that family."
    )
    low: float = Field(description="First value; with an equal `high` the only one, whole or not.")
    high: float = Field(description="Last value; in between every whole value gets a sheet.")
    every: int = Field(default=1, ge=1, description="Only the values that plus `offset` are multiples of this.")
    offset: int = Field(default=0, description="Shift of the values.")
    thickness: float = Field(gt=0, description="Thickness of the plates, mm.")
    part: int = Field(default=0, ge=0, description="Of several joined parts: 0 is this design, 1 the first joined.")

    @model_validator(mode="after")
    def _ascending(self) -> "AddSheet":
        if self.low > self.high:
            raise ValueError(f"low must not exceed high, found {self.low:g} and {self.high:g}")
        if isinstance(self.coordinate, int) and not 0 <= self.coordinate <= 2:
            raise ValueError(f"coordinate must be 0, 1, 2 or a family, found {self.coordinate}")
        return self

    def values_in(self, phi: Float[np.ndarray, " n_v"]) -> list[float]:
        """The values that get a sheet where the coordinate is phi: those through the part."""
        if self.low == self.high:
            values = [self.low]
        else:
            low, high = max(self.low, float(phi.min())), min(self.high, float(phi.max()))
            whole = range(int(np.ceil(low)), int(np.floor(high)) + 1)
            values = [float(value) for value in whole if (value + self.offset) % self.every == 0]
        return [value for value in values if phi.min() < value < phi.max()]

    def apply(self, structure: Structure) -> Structure:
        pieces = structure.pieces
        require(self.part < len(pieces), f"edit 'sheet': there is no part {self.part}: the {len(pieces)} count from 0")
        fields = pieces[self.part].fields
        phi = fields.levels[:, fields.axis(self.coordinate)]
        require(
            self.values_in(phi),
            f"edit 'sheet': no isosurface of coordinate {self.coordinate} between {self.low:g} and {self.high:g}; "
            f"it runs from {phi.min():.2f} to {phi.max():.2f} in this part",
        )
        require(
            self.thickness < fields.spacing,
            f"edit 'sheet': a thickness of {self.thickness:.4g} mm fills the cells of {fields.spacing:.4g} mm",
        )
        return structure.with_note(self)


def build_sheets(structure: Structure) -> list[ClosedMesh]:
    """All plates of a structure, one for each connected piece of an isosurface."""
    plates = []
    for edit in structure.of_kind(AddSheet):
        fields = structure.pieces[edit.part].fields
        phi = fields.levels[:, fields.axis(edit.coordinate)]
        for value in edit.values_in(phi):
            plates += build_plates(fields.mesh, phi, value, edit.thickness)
    return plates


def build_plates(mesh: TetMesh, phi: Float[np.ndarray, " n_v"], value: float, thickness: float) -> list[ClosedMesh]:
    """Plates of a thickness (mm) around the pieces of the isosurface {phi = value}, trimmed by the part.

    Raises
    ------
    GeometryKernelError
        If no closed plate comes out.
    """
    points, triangles = trace_isosurface(mesh, phi, value)
    blank = _manifold(*thicken(*_with_rim(points, triangles, RIM * thickness), thickness))
    part = _manifold(mesh.vertices, mesh.boundary_triangles)
    middles = points[triangles].mean(1)
    plates = []
    for piece in _simplified(blank ^ part, COARSEST * thickness).decompose():
        made = piece.to_mesh64()
        plate = ClosedMesh(np.asarray(made.vert_properties)[:, :3], np.asarray(made.tri_verts).astype(np.int64))
        # Beyond its rim the blank can cut the part once more: such a piece holds nothing of the isosurface.
        inside = np.asarray(igl.fast_winding_number(plate.vertices, plate.triangles, middles)) > 0.5
        if inside.any():
            plates.append(plate)
    if not plates or any(not plate.is_watertight or plate.volume <= 0 for plate in plates):
        raise GeometryKernelError(f"the sheet at {value:g} does not come out closed; use a smaller thickness")
    return plates


def trace_isosurface(
    mesh: TetMesh, phi: Float[np.ndarray, " n_v"], value: float
) -> tuple[Float[np.ndarray, "n 3"], Int[np.ndarray, "t 3"]]:
    """Triangles of {phi = value} in every tet; their normals point to where phi grows.

    They are off by up to `GENERIC` in phi near vertices at the value. Neighbouring tets share the vertices on their
    edges, so that the surface ends on the surface of the part only.
    """
    phi = np.where(np.abs(phi - value) < GENERIC, value + GENERIC, phi)
    above = phi > value
    i, j = mesh.edges.T
    crossed = above[i] != above[j]
    number = np.full(len(mesh.edges), -1)
    number[crossed] = np.arange(np.count_nonzero(crossed))
    share = (value - phi[i[crossed]]) / (phi[j[crossed]] - phi[i[crossed]])
    V = mesh.vertices
    points = V[i[crossed]] + share[:, None] * (V[j[crossed]] - V[i[crossed]])
    on_edge = number[mesh.tet_edges]
    counts = above[mesh.tets].sum(1)
    corner_rows = np.flatnonzero((counts == 1) | (counts == 3))
    corners = on_edge[corner_rows]
    triangles = corners[corners >= 0].reshape(-1, 3)
    quad_rows = np.flatnonzero(counts == 2)
    cut = on_edge[quad_rows]
    # Of the six edges 01 02 03 12 13 23 an edge and its opposite are not cut; the other four make a ring.
    rings = np.array([(1, 3, 4, 2), (0, 3, 5, 2), (0, 4, 5, 1)])
    ring = cut[np.arange(len(cut))[:, None], rings[(cut[:, :3] < 0).argmax(1)]]
    triangles = np.concatenate([triangles, ring[:, [0, 1, 2]], ring[:, [0, 2, 3]]])
    rows = np.concatenate([corner_rows, quad_rows, quad_rows])
    a, b, c = points[triangles].transpose(1, 0, 2)
    gradient = mesh.gradients(np.repeat(phi[:, None], 3, axis=1))[rows, 0]
    turned = np.einsum("td,td->t", np.cross(b - a, c - a), gradient) < 0
    triangles[turned] = triangles[turned][:, ::-1]
    return points, triangles


def thicken(points: np.ndarray, triangles: np.ndarray, thickness: float) -> tuple[np.ndarray, np.ndarray]:
    """A closed mesh at half the thickness on both sides of a surface, with walls along its rim."""
    n = len(points)
    offset = thickness / 2 * vertex_normals(points, triangles)
    rim = _rim(triangles)
    walls = np.concatenate(
        [np.stack([rim[:, 1], rim[:, 0], rim[:, 0] + n], 1), np.stack([rim[:, 1], rim[:, 0] + n, rim[:, 1] + n], 1)]
    )
    return np.concatenate([points + offset, points - offset]), np.concatenate(
        [triangles, triangles[:, ::-1] + n, walls]
    )


def vertex_normals(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Unit normals at the vertices: means over the triangles around them, weighted by area."""
    a, b, c = points[triangles].transpose(1, 0, 2)
    area = np.cross(b - a, c - a)
    normals = np.zeros_like(points)
    for corner in range(3):
        np.add.at(normals, triangles[:, corner], area)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)


def _rim(triangles: np.ndarray) -> np.ndarray:
    """Directed edges of triangles that have no opposite."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    n = int(triangles.max()) + 1
    return edges[~np.isin(edges[:, 0] * n + edges[:, 1], edges[:, 1] * n + edges[:, 0])]


def _with_rim(points: np.ndarray, triangles: np.ndarray, width: float) -> tuple[np.ndarray, np.ndarray]:
    """The surface carried on by a width beyond its rim, in its own tangent planes."""
    rim = _rim(triangles)
    normals = vertex_normals(points, triangles)
    out = np.zeros_like(points)
    along = points[rim[:, 1]] - points[rim[:, 0]]
    for end in range(2):
        np.add.at(out, rim[:, end], np.cross(along, normals[rim[:, end]]))
    ends, number = np.unique(rim, return_inverse=True)
    away = out[ends] / np.maximum(np.linalg.norm(out[ends], axis=1, keepdims=True), np.finfo(float).tiny)
    a, b = rim.T
    c, d = len(points) + number.reshape(-1, 2).T
    flaps = np.concatenate([np.stack([b, a, c], 1), np.stack([b, c, d], 1)])
    return np.concatenate([points, points[ends] + width * away]), np.concatenate([triangles, flaps])


def _simplified(made: Manifold, tolerance: float) -> Manifold:
    """The mesh with fewer triangles, off by about a tolerance.

    One pass leaves slivers among the edges that the boolean cut, thinner than the CAD kernel can tell apart: edges
    are fixed where they divide triangles of different origin, and collapsing some makes others short.
    """
    made, before = made.as_original(), 0
    for _ in range(MOST_PASSES):
        if made.num_tri() == before:
            break
        before, made = made.num_tri(), made.simplify(tolerance)
    return made


def _manifold(vertices: np.ndarray, triangles: np.ndarray) -> Manifold:
    made = Manifold(Mesh64(np.array(vertices, np.float64), np.array(triangles, np.uint64)))
    if made.status() != Error.NoError:
        raise GeometryKernelError(f"a sheet does not make a closed mesh ({made.status()}); use another value")
    return made
