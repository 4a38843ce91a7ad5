"""Booleans of the CAD kernel, for the one place that needs them: where the truss meets solids that are kept.

The kernel's general fuse splits solids into cells that share faces. It is trusted only after the volumes of the cells
have been added up again.
"""

# OCP is a binary module: pyright cannot see what it defines.
# pyright: reportAttributeAccessIssue=false

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Surface
from OCP.BRepAlgoAPI import BRepAlgoAPI_BuilderAlgo, BRepAlgoAPI_Common, BRepAlgoAPI_Cut
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakeWire
from OCP.BRepGProp import BRepGProp_Face
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepOffset import BRepOffset_MakeOffset, BRepOffset_Skin
from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder, BRepPrimAPI_MakePrism, BRepPrimAPI_MakeSphere
from OCP.BRepTools import BRepTools
from OCP.GeomAbs import GeomAbs_Cylinder, GeomAbs_Intersection
from OCP.gp import gp_Ax2, gp_Dir, gp_Pln, gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_REVERSED, TopAbs_SOLID
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Shell, TopoDS_Solid
from OCP.TopTools import TopTools_IndexedMapOfShape, TopTools_ListOfShape
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from michell_cad.cad.kernel import compound, explore, is_valid, volume
from michell_cad.errors import GeometryKernelError, InvalidInputError

CELLS_TOLERANCE = 1e-3
"""The cells of a split solid must have its volume (relative). The kernel's integrals over cut splines err by 3e-4, and
it lost or added at least 2e-3 where it failed."""

SLIVER = 1e-9
"""Volume of a solid that counts as none (relative to all)."""

OFFSET_TOLERANCE = 1e-5
"""Tolerance of offset surfaces, mm."""


def solids_in(shape: Any) -> list[Any]:
    """Kernel solids in a build123d or CadQuery object, a Workplane, a kernel shape, or a sequence of these.

    Raises
    ------
    InvalidInputError
        If there is something else, or an invalid solid, or no solid.
    """
    if isinstance(shape, list | tuple):
        return [solid for item in shape for solid in solids_in(item)]
    if hasattr(shape, "vals") and not hasattr(shape, "wrapped"):
        return solids_in(list(shape.vals()))
    handle = getattr(shape, "wrapped", shape)
    if not hasattr(handle, "ShapeType"):
        raise InvalidInputError(f"expected a solid of build123d, CadQuery or the kernel, found {type(shape).__name__}")
    solids = [TopoDS.Solid_s(solid) for solid in explore(handle, TopAbs_SOLID)]
    if not solids or not all(is_valid(solid) and volume(solid) > 0 for solid in solids):
        raise InvalidInputError(
            f"expected valid solids, found {len(solids) or 'none'} in the {type(shape).__name__}; heal the body in CAD"
        )
    return solids


# --- material beside faces -------------------------------------------------------------------------------------------


def layer_on_face(face: Any, thickness: float) -> Any | None:
    """The solid within a distance of a face along its normals: outside of its part, or inside if negative.

    None if the kernel cannot make it, mostly since the face is bent more sharply than that.
    """
    face = TopoDS.Face_s(face)
    around = _radius_ahead(face, thickness)
    if around is not None and abs(thickness) >= around:
        return None
    offset = BRepOffset_MakeOffset(
        face, thickness, OFFSET_TOLERANCE, BRepOffset_Skin, False, False, GeomAbs_Intersection, True
    )
    if not offset.IsDone():
        return None
    solids = list(explore(offset.Shape(), TopAbs_SOLID))
    good = len(solids) == 1 and is_valid(solids[0]) and volume(solids[0]) > 0
    return TopoDS.Solid_s(solids[0]) if good else None


def _radius_ahead(face: Any, along: float) -> float | None:
    """Radius of a cylinder whose axis lies ahead on the outward normal, or behind if negative; else None."""
    surface = BRepAdaptor_Surface(face)
    if surface.GetType() != GeomAbs_Cylinder:
        return None
    cylinder = surface.Cylinder()
    u_0, u_1, v_0, v_1 = BRepTools.UVBounds_s(face)
    point, normal = gp_Pnt(), gp_Vec()
    BRepGProp_Face(face).Normal((u_0 + u_1) / 2, (v_0 + v_1) / 2, point, normal)
    foot = cylinder.Location().Translated(gp_Vec(cylinder.Position().Direction()).Multiplied((v_0 + v_1) / 2))
    return cylinder.Radius() if along * gp_Vec(point, foot).Dot(normal) > 0 else None


def plug_hole(face: Any, wider: float, overhang: float) -> Any | None:
    """A cylinder in and around the face of a round hole, wider and at both ends longer; None for other faces."""
    face = TopoDS.Face_s(face)
    if _radius_ahead(face, overhang) is None:
        return None
    cylinder = BRepAdaptor_Surface(face).Cylinder()
    *_, v_0, v_1 = BRepTools.UVBounds_s(face)
    axis = cylinder.Position().Direction()
    start = cylinder.Location().Translated(gp_Vec(axis).Multiplied(v_0 - overhang))
    plug = BRepPrimAPI_MakeCylinder(gp_Ax2(start, axis), cylinder.Radius() + wider, v_1 - v_0 + 2 * overhang).Shape()
    return TopoDS.Solid_s(next(iter(explore(plug, TopAbs_SOLID))))


def intersect(one: Any, other: Any) -> list[Any]:
    """Solids of the intersection of two solids; their volume is checked against that of the difference."""
    common = _solids_of(BRepAlgoAPI_Common(one, other), "intersection")
    rest = _solids_of(BRepAlgoAPI_Cut(one, other), "difference")
    whole, found = volume(one), sum(map(volume, common)) + sum(map(volume, rest))
    if abs(found - whole) > CELLS_TOLERANCE * whole:
        raise GeometryKernelError(
            f"the kernel cuts a solid of {whole:.6g} mm^3 into parts of {found:.6g} mm^3 in all; choose another depth"
        )
    return common


def unite(solids: Sequence[Any]) -> list[Any]:
    """Solids of the union of some solids, by their cells."""
    if len(solids) < 2:
        return list(solids)
    cells = split(solids)
    return solids_of_faces(outer_faces(cells.solids))[0]


def subtract(one: Any, other: Any) -> list[Any]:
    """Solids of one solid without another."""
    return _solids_of(BRepAlgoAPI_Cut(one, other), "difference")


def _solids_of(operation: Any, name: str) -> list[Any]:
    if not operation.IsDone():
        raise GeometryKernelError(f"the kernel finds no {name} of two solids; choose another depth")
    return [TopoDS.Solid_s(solid) for solid in explore(operation.Shape(), TopAbs_SOLID)]


# --- cells -----------------------------------------------------------------------------------------------------------


class SplitError(GeometryKernelError):
    """The kernel failed to split solids; `arguments` are the numbers of those that lost or gained volume."""

    def __init__(self, message: str, arguments: Sequence[int]) -> None:
        super().__init__(message)
        self.arguments = tuple(arguments)


@dataclass(frozen=True, eq=False)
class Cells:
    """Solids split by each other.

    Parameters
    ----------
    solids : the cells, which overlap nowhere and share their faces.
    of : for each argument the numbers of its cells.
    images : function from a face of an argument to the faces that it became.
    """

    solids: list[Any]
    of: list[list[int]]
    images: Callable[[Any], list[Any]]


def split(arguments: Sequence[Any]) -> Cells:
    """Split solids by each other.

    Raises
    ------
    SplitError
        If the kernel fails, or the cells of a solid do not have its volume.
    """
    if len(arguments) < 2:
        return Cells(list(arguments), [[0] for _ in arguments], lambda shape: [shape])
    operation = BRepAlgoAPI_BuilderAlgo()
    operation.SetArguments(_shape_list(arguments))
    operation.SetRunParallel(True)
    operation.Build()
    if not operation.IsDone():
        raise SplitError("the kernel cannot split the truss where it meets the kept solids", [])

    def images(shape: Any) -> list[Any]:
        found = list(operation.Modified(shape))
        return found or ([] if operation.IsDeleted(shape) else [shape])

    number = TopTools_IndexedMapOfShape()
    of = [[number.Add(cell) - 1 for cell in images(solid)] for solid in arguments]
    cells = [TopoDS.Solid_s(number.FindKey(i + 1)) for i in range(number.Extent())]
    volumes = [volume(cell) for cell in cells]
    whole = np.array([volume(solid) for solid in arguments])
    found = np.array([sum(volumes[i] for i in mine) for mine in of])
    wrong = np.flatnonzero(np.abs(found - whole) > CELLS_TOLERANCE * whole)
    if len(wrong):
        raise SplitError(
            f"the kernel splits {len(wrong)} solids into cells of another volume, such as {whole[wrong[0]]:.6g} mm^3 "
            f"into {found[wrong[0]]:.6g} mm^3",
            wrong.tolist(),
        )
    return Cells(cells, of, images)


def make_ball(center: Sequence[float], radius: float) -> Any:
    """A ball as a solid."""
    return TopoDS.Solid_s(BRepPrimAPI_MakeSphere(gp_Pnt(*center), radius).Solid())


def extrude(face: Any, along: Sequence[float]) -> Any:
    """The prism of a plane face; the face itself is one of its own."""
    return TopoDS.Solid_s(BRepPrimAPI_MakePrism(face, gp_Vec(*along)).Shape())


def faces_of(solid: Any) -> list[Any]:
    """Faces of a solid."""
    return [TopoDS.Face_s(face) for face in explore(solid, TopAbs_FACE)]


def outer_faces(cells: Iterable[Any]) -> list[Any]:
    """Faces of the union of some cells: those that belong to exactly one of them."""
    number = TopTools_IndexedMapOfShape()
    faces, uses = [], []
    for cell in cells:
        for face in explore(cell, TopAbs_FACE):
            i = number.Add(face) - 1
            if i == len(faces):
                faces.append(TopoDS.Face_s(face))
                uses.append(1)
            else:
                uses[i] += 1
    return [face for face, count in zip(faces, uses, strict=True) if count == 1]


class FaceTable:
    """Values by face, whatever its orientation."""

    def __init__(self) -> None:
        self._number, self._values = TopTools_IndexedMapOfShape(), []

    def put(self, face: Any, value: Any) -> None:
        """Enter a value, or replace it."""
        i = self._number.Add(face) - 1
        self._values[i : i + 1] = [value]

    def get(self, face: Any) -> Any:
        """The value of a face, or None."""
        i = self._number.FindIndex(face)
        return self._values[i - 1] if i else None


# --- shells ----------------------------------------------------------------------------------------------------------


def free_edges(faces: Sequence[Any]) -> list[Any]:
    """Edges that only one of the faces has, once."""
    number, uses, edges = TopTools_IndexedMapOfShape(), [], []
    for face in faces:
        for edge in explore(face, TopAbs_EDGE):
            i = number.Add(edge) - 1
            if i == len(edges):
                edges.append(TopoDS.Edge_s(edge))
                uses.append(0)
            uses[i] += 1
    return [edge for edge, n in zip(edges, uses, strict=True) if n == 1 and not BRep_Tool.Degenerated_s(edge)]


def middle_of_edge(edge: Any) -> tuple[float, float, float]:
    """The point in the middle of an edge's parameters."""
    curve = BRepAdaptor_Curve(edge)
    return curve.Value((curve.FirstParameter() + curve.LastParameter()) / 2).Coord()


def make_disc(edges: Sequence[Any], center: Sequence[float], normal: Sequence[float]) -> Any:
    """The plane face that a circle's edges bound; its outside lies along the normal."""
    wire = BRepBuilderAPI_MakeWire()
    wire.Add(_shape_list(edges))
    made = BRepBuilderAPI_MakeFace(gp_Pln(gp_Pnt(*center), gp_Dir(*normal)), wire.Wire(), True)
    if not made.IsDone():
        raise GeometryKernelError("the kernel cannot close the end of a member with a disc")
    face = made.Face()
    # A face on a plane looks along the normal of the plane, unless the maker has turned it.
    if face.Orientation() == TopAbs_REVERSED:
        face.Reverse()
    return face


def solids_of_faces(faces: Sequence[Any]) -> tuple[list[Any], np.ndarray]:
    """Solids that faces enclose which share their edges, and the solid of each face; -1 for faces of slivers.

    Raises
    ------
    GeometryKernelError
        If an edge does not have exactly two faces which run along it in opposite directions, or a solid is hollow or
        turned inside out.
    """
    number, sign, ends = TopTools_IndexedMapOfShape(), [], []
    for f, face in enumerate(faces):
        for edge in explore(face, TopAbs_EDGE):
            if BRep_Tool.Degenerated_s(TopoDS.Edge_s(edge)):
                continue
            i = number.Add(edge) - 1
            if i == len(sign):
                sign.append([0, 0])
            sign[i][edge.Orientation() == TopAbs_REVERSED] += 1
            ends.append((f, i))
    if any(pair != [1, 1] for pair in sign):
        raise GeometryKernelError(f"{sum(pair != [1, 1] for pair in sign)} edges do not have two faces each")
    f, e = np.array(ends).T
    links = coo_matrix((np.ones(len(f)), (f, len(faces) + e)), shape=(len(faces) + len(sign),) * 2)
    label = np.unique(connected_components(links, directed=False)[1][: len(faces)], return_inverse=True)[1]
    builder, solids = BRep_Builder(), []
    for component in range(label.max() + 1):
        shell, solid = TopoDS_Shell(), TopoDS_Solid()
        builder.MakeShell(shell)
        for k in np.flatnonzero(label == component).tolist():
            builder.Add(shell, faces[k])
        shell.Closed(True)
        builder.MakeSolid(solid)
        builder.Add(solid, shell)
        solids.append(solid)
    volumes = np.array([volume(solid) for solid in solids])
    # The kernel leaves pieces without any inside where surfaces all but touch.
    real = np.abs(volumes) > SLIVER * np.abs(volumes).sum()
    if (volumes[real] < 0).any():
        raise GeometryKernelError(f"a solid has a hollow of {-volumes.min():.3g} mm^3, or is turned inside out")
    number = np.where(real, np.cumsum(real) - 1, -1)
    return [solid for solid, keep in zip(solids, real.tolist(), strict=True) if keep], number[label]


# --- triangles -------------------------------------------------------------------------------------------------------


def mesh_solids(solids: Sequence[Any], distance: float, angle: float) -> list[np.ndarray]:
    """Corners (t, 3, 3) of the triangles of each solid; faces that solids share have the same triangles.

    `distance` (mm) and `angle` (radians) bound the error of the triangles.
    """
    BRepMesh_IncrementalMesh(compound(solids), distance, False, angle, True)
    return [np.concatenate([_triangles_on(face) for face in explore(solid, TopAbs_FACE)]) for solid in solids]


def _triangles_on(face: Any) -> np.ndarray:
    location = TopLoc_Location()
    table = BRep_Tool.Triangulation_s(TopoDS.Face_s(face), location)
    if table is None:
        raise GeometryKernelError("the kernel cannot make triangles on a face of a kept solid")
    move = location.Transformation()
    points = np.array([table.Node(i).Transformed(move).Coord() for i in range(1, table.NbNodes() + 1)])
    corners = points[np.array([table.Triangle(i).Get() for i in range(1, table.NbTriangles() + 1)]) - 1]
    return corners[:, ::-1] if face.Orientation() == TopAbs_REVERSED else corners


def _shape_list(shapes: Iterable[Any]) -> Any:
    listed = TopTools_ListOfShape()
    for shape in shapes:
        listed.Append(shape)
    return listed
