"""Files of the CAD kernel (Open CASCADE through OCP): STEP and BREP, and what a shape will take in them."""

# OCP is a binary module: pyright cannot see what it defines.
# pyright: reportAttributeAccessIssue=false

import errno
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from OCP.APIHeaderSection import APIHeaderSection_MakeHeader
from OCP.BinTools import BinTools
from OCP.BRep import BRep_Tool
from OCP.BRepTools import BRepTools
from OCP.Geom import Geom_BSplineCurve, Geom_BSplineSurface, Geom_Line
from OCP.Geom2d import Geom2d_BSplineCurve
from OCP.IFSelect import IFSelect_RetDone
from OCP.Interface import Interface_Static
from OCP.Message import Message
from OCP.Quantity import Quantity_Color, Quantity_TOC_sRGB
from OCP.STEPCAFControl import STEPCAFControl_Controller, STEPCAFControl_Writer
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Reader
from OCP.TCollection import TCollection_ExtendedString, TCollection_HAsciiString
from OCP.TDataStd import TDataStd_Name
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SOLID, TopAbs_VERTEX, TopAbs_WIRE
from OCP.TopExp import TopExp
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Shape
from OCP.TopTools import TopTools_IndexedMapOfShape
from OCP.XCAFDoc import XCAFDoc_ColorSurf, XCAFDoc_DocumentTool

from michell_cad.cad.kernel import compound, explore, is_valid, volume
from michell_cad.cad.step_text import PROGRAM, Colour, Tag
from michell_cad.errors import GeometryKernelError, InvalidInputError

UNWRITTEN = "the kernel could not write it all: is the disk full?"


@dataclass(frozen=True)
class StepSettings:
    """Kernel's name of the schema, and whether to write the curves in the parameters of the faces."""

    schema: str = "AP214IS"
    pcurves: bool = False


class StepDocument:
    """A document of the kernel with names, colours and layers, while it grows."""

    def __init__(self) -> None:
        self._document = TDocStd_Document(TCollection_ExtendedString("MDTV-XCAF"))
        main = self._document.Main()
        self._shapes = XCAFDoc_DocumentTool.ShapeTool_s(main)
        self._colours, self._layers = XCAFDoc_DocumentTool.ColorTool_s(main), XCAFDoc_DocumentTool.LayerTool_s(main)
        self._palette: dict[Colour, Any] = {}
        self._layer_labels: dict[str, Any] = {}

    def add_solid(self, solid: Any, name: str) -> Any:
        """Add a solid of its own; returns its label."""
        label = self._shapes.AddShape(solid, False)
        _name(label, name)
        return label

    def tag_face(self, solid: Any, face: Any, tag: Tag) -> None:
        """Name a face of the solid with this label."""
        label = self._shapes.AddSubShape(solid, face)
        if label.IsNull():
            raise GeometryKernelError(
                f"the kernel does not find face {tag.name!r} in its solid: no STEP file was written"
            )
        self._tag(label, tag)

    def add_assembly(self, name: str, parent: Any = None) -> Any:
        """Add an assembly, within another one if that is given; returns its label."""
        label = self._shapes.NewShape()
        _name(label, name)
        if parent is not None:
            _name(self._shapes.AddComponent(parent, label, TopLoc_Location()), name)
        return label

    def add_part(self, parent: Any, solid: Any, tag: Tag) -> None:
        """Add a solid as a part of the assembly with this label."""
        label = self._shapes.AddShape(solid, False)
        self._tag(label, tag)
        _name(self._shapes.AddComponent(parent, label, TopLoc_Location()), tag.name)

    def write(self, path: Path, name: str, settings: StepSettings) -> None:
        """Write the document as STEP, in mm; the header holds the name."""
        self._shapes.UpdateAssemblies()
        numbers = {"write.surfacecurve.mode": int(settings.pcurves), "write.stepcaf.subshapes.name": 1}
        texts = {"write.step.schema": settings.schema, "write.step.unit": "MM"}
        with _quiet(), _settings(numbers, texts):
            writer = STEPCAFControl_Writer()
            writer.SetColorMode(True)
            writer.SetNameMode(True)
            writer.SetLayerMode(True)
            done = writer.Transfer(self._document, STEPControl_AsIs)
            header = APIHeaderSection_MakeHeader(writer.ChangeWriter().Model())
            header.SetName(TCollection_HAsciiString(name))
            header.SetOriginatingSystem(TCollection_HAsciiString(PROGRAM))
            if not done or writer.Write(str(path)) != IFSelect_RetDone:
                raise OSError(errno.EIO, UNWRITTEN)

    def _tag(self, label: Any, tag: Tag) -> None:
        _name(label, tag.name)
        if tag.colour not in self._palette:
            self._palette[tag.colour] = Quantity_Color(*tag.colour, Quantity_TOC_sRGB)
        self._colours.SetColor(label, self._palette[tag.colour], XCAFDoc_ColorSurf)
        if tag.layer not in self._layer_labels:
            self._layer_labels[tag.layer] = self._layers.AddLayer(TCollection_ExtendedString(tag.layer))
        self._layers.SetLayer(label, self._layer_labels[tag.layer])


def _name(label: Any, name: str) -> None:
    TDataStd_Name.Set_s(label, TCollection_ExtendedString(name))


def write_brep_file(path: Path, solids: Sequence[Any], binary: bool = False) -> None:
    """Write solids in the kernel's own format."""
    shape = solids[0] if len(solids) == 1 else compound(solids)
    if not (BinTools if binary else BRepTools).Write_s(shape, str(path)):
        raise OSError(errno.EIO, UNWRITTEN)


def solids_to_bytes(solids: Sequence[Any]) -> bytes:
    """Solids in the kernel's own binary format."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "solids.brep"
        write_brep_file(path, solids, binary=True)
        return path.read_bytes()


def solids_from_bytes(data: bytes) -> tuple[Any, ...]:
    """Solids from what `solids_to_bytes` returned."""
    shape = TopoDS_Shape()
    with TemporaryDirectory() as folder:
        path = Path(folder) / "solids.brep"
        path.write_bytes(data)
        if not BinTools.Read_s(shape, str(path)):
            raise InvalidInputError("the solids in the design file cannot be read; run `design` again")
    return tuple(explore(shape, TopAbs_SOLID))


@dataclass(frozen=True)
class StepSummary:
    """What a STEP file holds, as the kernel reads it."""

    solids: int
    valid: bool
    volume_mm3: float
    faces: int


def read_step_file(path: Path) -> StepSummary:
    """Read a STEP file and check what is in it."""
    with _quiet():
        reader = STEPControl_Reader()
        if reader.ReadFile(str(path)) != IFSelect_RetDone:
            raise InvalidInputError(f"{path} cannot be read as a STEP file")
        reader.TransferRoots()
        shape = reader.OneShape()
    solids = sum(1 for _ in explore(shape, TopAbs_SOLID))
    faces = sum(1 for _ in explore(shape, TopAbs_FACE))
    return StepSummary(solids, is_valid(shape), volume(shape), faces)


def count_parts(shapes: Sequence[Any], pcurves: bool = False) -> dict[str, int]:
    """Count the items of `step_forecast.ITEMS`: what a file of these shapes holds."""
    n: Counter[str] = Counter()
    for shape in shapes:
        vertices, edges = TopTools_IndexedMapOfShape(), TopTools_IndexedMapOfShape()
        TopExp.MapShapes_s(shape, TopAbs_VERTEX, vertices)
        TopExp.MapShapes_s(shape, TopAbs_EDGE, edges)
        n["vertices"] += vertices.Extent()
        for i in range(1, edges.Extent() + 1):
            curve = BRep_Tool.Curve_s(TopoDS.Edge_s(edges.FindKey(i)), 0.0, 1.0)
            if isinstance(curve, Geom_BSplineCurve):
                n["splines"] += 1
                n["curve_poles"] += curve.NbPoles()
            elif curve is not None:
                n["lines" if isinstance(curve, Geom_Line) else "circles"] += 1
        for part in explore(shape, TopAbs_FACE):
            face = TopoDS.Face_s(part)
            surface = BRep_Tool.Surface_s(face)
            if isinstance(surface, Geom_BSplineSurface):
                n["spline_faces"] += 1
                n["surface_poles"] += surface.NbUPoles() * surface.NbVPoles()
            else:
                n["quadrics"] += 1
            for wire in explore(face, TopAbs_WIRE):
                n["wires"] += 1
                n["coedges"] += wire.NbChildren()
            if pcurves:
                n.update(_count_pcurves(face))
    return dict(n)


def _count_pcurves(face: Any) -> Counter[str]:
    n: Counter[str] = Counter()
    for part in explore(face, TopAbs_EDGE):
        curve = BRep_Tool.CurveOnSurface_s(TopoDS.Edge_s(part), face, 0.0, 1.0)
        if isinstance(curve, Geom2d_BSplineCurve):
            n["parameter_splines"] += 1
            n["parameter_poles"] += curve.NbPoles()
        else:
            n["parameter_lines"] += 1
    return n


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep the kernel from printing its statistics."""
    messenger = Message.DefaultMessenger_s()
    printers = list(messenger.Printers())
    for printer in printers:
        messenger.RemovePrinter(printer)
    try:
        yield
    finally:
        for printer in printers:
            messenger.AddPrinter(printer)


@contextmanager
def _settings(numbers: Mapping[str, int], texts: Mapping[str, str]) -> Iterator[None]:
    """Set the kernel's process-wide parameters for a while."""
    STEPCAFControl_Controller.Init_s()  # it defines the parameters; set before, they would be reset
    old_numbers = {name: Interface_Static.IVal_s(name) for name in numbers}
    old_texts = {name: Interface_Static.CVal_s(name) for name in texts}
    try:
        for name, number in numbers.items():
            Interface_Static.SetIVal_s(name, number)
        for name, text in texts.items():
            Interface_Static.SetCVal_s(name, text)
        yield
    finally:
        for name, number in old_numbers.items():
            Interface_Static.SetIVal_s(name, number)
        for name, text in old_texts.items():
            Interface_Static.SetCVal_s(name, text)
