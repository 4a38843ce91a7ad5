"""Solids of the CAD kernel as the records of a STEP file, see `step_text`.

Only what trusses consist of, and the commonest surfaces of parts: lines, circles, ellipses and splines; planes,
cylinders, cones, spheres, tori and splines. Solids with others, or with cavities, are left to the kernel's own writer.
"""

# OCP is a binary module: pyright cannot see what it defines.
# pyright: reportAttributeAccessIssue=false

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Tool
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepTools import BRepTools_WireExplorer
from OCP.Geom import (
    Geom_BSplineCurve,
    Geom_BSplineSurface,
    Geom_Circle,
    Geom_ConicalSurface,
    Geom_CylindricalSurface,
    Geom_ElementarySurface,
    Geom_Ellipse,
    Geom_Line,
    Geom_Plane,
    Geom_RectangularTrimmedSurface,
    Geom_SphericalSurface,
    Geom_ToroidalSurface,
    Geom_TrimmedCurve,
)
from OCP.ShapeAnalysis import ShapeAnalysis_ShapeTolerance
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_FORWARD, TopAbs_SHELL, TopAbs_VERTEX
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS, TopoDS_Iterator
from OCP.TopTools import TopTools_IndexedMapOfShape

from michell_cad.cad.kernel import explore, no_garbage_collection
from michell_cad.cad.step_text import Schema, StepText, Tag, listed, quoted, reals

Loop = list[tuple[int, bool]]
"""Number of each edge, and whether it is walked along its curve."""


class _NotWritten(Exception):
    """A shape that has no records here."""


def solid_text(
    solids: Sequence[Any],
    names: Sequence[str],
    faces: Sequence[Any],
    tags: Sequence[Tag],
    schema: Schema,
    progress: Callable[[float], None],
) -> StepText | None:
    """The records of solids with these names, each a product of its own, whose faces have these tags.

    Returns None if there is a curve or surface among them that only the kernel's writer knows.
    """
    text = StepText(_largest_coordinate(solids))
    numbers = TopTools_IndexedMapOfShape(len(faces))
    for face in faces:
        numbers.Add(face)
    with no_garbage_collection():
        try:
            layers = []
            for i, (solid, name) in enumerate(zip(solids, names, strict=True)):
                layers += _add_solid(text, solid, name, numbers, tags, schema)
                progress((i + 1) / len(solids))
            text.layers(layers)
        except _NotWritten:
            return None
    return text


def _add_solid(
    text: StepText, solid: Any, name: str, numbers: Any, tags: Sequence[Tag], schema: Schema
) -> list[tuple[str, int]]:
    """Add a solid as a product; returns layer and record of each face."""
    if sum(1 for _ in explore(solid, TopAbs_SHELL)) != 1:
        raise _NotWritten
    topology = _Topology(text, solid)
    records, styled, layers = [], [], []
    for part in explore(solid, TopAbs_FACE):
        tag = tags[numbers.FindIndex(part) - 1]
        record = topology.face(TopoDS.Face_s(part), tag.name)
        records.append(record)
        styled.append(text.add(f"STYLED_ITEM('color',(#{text.style(tag.colour)}),#{record})"))
        layers.append((tag.layer, record))
    shell = text.add(f"CLOSED_SHELL('',({listed(records)}))")
    brep = text.add(f"MANIFOLD_SOLID_BREP({quoted(name)},#{shell})")
    text.product(name, brep, ShapeAnalysis_ShapeTolerance().Tolerance(solid, 0), styled, schema)
    return layers


class _Topology:
    """Vertices and edges of a solid by number, with their records, and its faces one by one."""

    def __init__(self, text: StepText, solid: Any) -> None:
        self._text = text
        vertices, self._edges = TopTools_IndexedMapOfShape(), TopTools_IndexedMapOfShape()
        TopExp.MapShapes_s(solid, TopAbs_VERTEX, vertices)
        TopExp.MapShapes_s(solid, TopAbs_EDGE, self._edges)
        points = (BRep_Tool.Pnt_s(TopoDS.Vertex_s(vertices.FindKey(i + 1))) for i in range(vertices.Extent()))
        self._vertices = [text.add(f"VERTEX_POINT('',#{_point(text, point)})") for point in points]
        self._ends, self._records = [(-1, -1)], [0]
        for i in range(self._edges.Extent()):
            edge = TopoDS.Edge_s(self._edges.FindKey(i + 1).Oriented(TopAbs_FORWARD))
            a, b = (vertices.FindIndex(end) - 1 for end in (TopExp.FirstVertex_s(edge), TopExp.LastVertex_s(edge)))
            self._ends.append((a, b))
            if BRep_Tool.Degenerated_s(edge):  # a pole of a sphere: the file knows no such edges
                self._records.append(0)
                continue
            curve = _record(text, _basis(BRep_Tool.Curve_s(edge, 0.0, 1.0)), CURVES)
            ends = f"#{self._vertices[a]},#{self._vertices[b]}"
            self._records.append(text.add(f"EDGE_CURVE('',{ends},#{curve},.T.)"))

    def face(self, face: Any, name: str) -> int:
        """Record of a face; its loops run about its outward normal, as it is used in the solid."""
        text, bounds = self._text, []
        for wire in _parts(face):
            bounds.append(text.add(f"FACE_BOUND('',#{self._bound(self._loop(wire, face))},.T.)"))
        surface = _basis(BRep_Tool.Surface_s(face))
        # The file knows right-handed frames only; without its mirror a surface has the other side in front.
        mirrored = isinstance(surface, Geom_ElementarySurface) and not surface.Position().Direct()
        along = _logical((face.Orientation() == TopAbs_FORWARD) != mirrored)
        return text.add(f"ADVANCED_FACE({quoted(name)},({listed(bounds)}),#{_record(text, surface, SURFACES)},{along})")

    def _bound(self, loop: Loop) -> int:
        text = self._text
        if len(loop) == 2 and loop[0][0] == loop[1][0]:  # there and back again: a whole sphere has no edge
            return text.add(f"VERTEX_LOOP('',#{self._vertices[self._ends[loop[0][0]][0]]})")
        edges = [text.add(f"ORIENTED_EDGE('',*,*,#{self._records[e]},{_logical(along)})") for e, along in loop]
        return text.add(f"EDGE_LOOP('',({listed(edges)}))")

    def _loop(self, wire: Any, face: Any) -> Loop:
        """The edges of a wire head to tail, in the order in which they bound the face."""
        loop = self._numbered(_parts(wire))
        # Where seams go there and back at once, as they may on a torus, the ends of edges do not tell their order.
        if len(loop) == 2 or all(loop[i - 1][0] != edge[0] for i, edge in enumerate(loop)):
            for found in (loop, loop[::-1]):
                if self._is_chain(found):
                    return found
        walk, edges = BRepTools_WireExplorer(TopoDS.Wire_s(wire), face), []
        while walk.More():
            edges.append(walk.Current())
            walk.Next()
        found = self._numbered(edges)
        if len(found) != len(loop) or not self._is_chain(found):
            raise _NotWritten
        return found

    def _numbered(self, edges: Sequence[Any]) -> Loop:
        found = [(self._edges.FindIndex(edge), edge.Orientation() == TopAbs_FORWARD) for edge in edges]
        return [(e, along) for e, along in found if self._records[e]]

    def _is_chain(self, loop: Loop) -> bool:
        ends = [self._ends[e] if along else self._ends[e][::-1] for e, along in loop]
        return bool(ends) and all(ends[i - 1][1] == end[0] for i, end in enumerate(ends))


def _parts(shape: Any) -> list[Any]:
    """The parts that a shape consists of, as it uses them."""
    walk, found = TopoDS_Iterator(shape), []
    while walk.More():
        found.append(walk.Value())
        walk.Next()
    return found


def _largest_coordinate(solids: Sequence[Any]) -> float:
    box = Bnd_Box()
    for solid in solids:
        BRepBndLib.AddClose_s(solid, box)
    return float(np.abs([box.CornerMin().Coord(), box.CornerMax().Coord()]).max())


def _logical(value: bool) -> str:
    return ".T." if value else ".F."


def _point(text: StepText, point: Any) -> int:
    return text.point(point.X(), point.Y(), point.Z())


def _direction(text: StepText, direction: Any) -> int:
    return text.direction(direction.X(), direction.Y(), direction.Z())


def _placement(text: StepText, shape: Any, along: bool = True) -> int:
    """Number of the frame of a curve or surface, with its axis or against it."""
    place = shape.Position()
    axis = place.Direction() if along else place.Direction().Reversed()
    return text.placement(_point(text, place.Location()), _direction(text, axis), _direction(text, place.XDirection()))


def _elementary(text: StepText, name: str, surface: Any, *lengths: float) -> int:
    values = "".join(f",{text.length(value)}" for value in lengths)
    return text.share(f"{name}('',#{_placement(text, surface)}{values})")


def _basis(shape: Any) -> Any:
    """The whole curve or surface of which this may be a part."""
    while isinstance(shape, Geom_TrimmedCurve | Geom_RectangularTrimmedSurface):
        shape = shape.BasisCurve() if isinstance(shape, Geom_TrimmedCurve) else shape.BasisSurface()
    return shape


def _record(text: StepText, shape: Any, kinds: Mapping[type, Callable[[StepText, Any], int]]) -> int:
    if type(shape) not in kinds:
        raise _NotWritten
    return kinds[type(shape)](text, shape)


def _line(text: StepText, line: Any) -> int:
    place = line.Position()
    vector = text.share(f"VECTOR('',#{_direction(text, place.Direction())},1.)")
    return text.share(f"LINE('',#{_point(text, place.Location())},#{vector})")


def _circle(text: StepText, circle: Any) -> int:
    return text.share(f"CIRCLE('',#{_placement(text, circle)},{text.length(circle.Radius())})")


def _ellipse(text: StepText, ellipse: Any) -> int:
    radii = f"{text.length(ellipse.MajorRadius())},{text.length(ellipse.MinorRadius())}"
    return text.share(f"ELLIPSE('',#{_placement(text, ellipse)},{radii})")


def _cone(text: StepText, cone: Any) -> int:
    """A cone opens along its axis in a file; to the kernel it may also close, at a negative angle."""
    angle = cone.SemiAngle()
    values = f"{text.length(cone.RefRadius())},{reals([abs(angle)])}"
    return text.share(f"CONICAL_SURFACE('',#{_placement(text, cone, angle > 0)},{values})")


def _spline_curve(text: StepText, curve: Any) -> int:
    if curve.IsPeriodic():
        raise _NotWritten
    places = range(1, curve.NbPoles() + 1)
    shape = f"{curve.Degree()},({listed([_point(text, curve.Pole(i)) for i in places])}),.UNSPECIFIED.,.F.,.F."
    spans = range(1, curve.NbKnots() + 1)
    knots = f"({_integers(map(curve.Multiplicity, spans))}),({reals(map(curve.Knot, spans))}),.UNSPECIFIED."
    if not curve.IsRational():
        return text.add(f"B_SPLINE_CURVE_WITH_KNOTS('',{shape},{knots})")
    return text.add(
        f"(BOUNDED_CURVE()B_SPLINE_CURVE({shape})B_SPLINE_CURVE_WITH_KNOTS({knots})CURVE()"
        f"GEOMETRIC_REPRESENTATION_ITEM()RATIONAL_B_SPLINE_CURVE(({reals(map(curve.Weight, places))}))"
        "REPRESENTATION_ITEM(''))"
    )


def _spline_surface(text: StepText, surface: Any) -> int:
    if surface.IsUPeriodic() or surface.IsVPeriodic():
        raise _NotWritten
    rows, columns = range(1, surface.NbUPoles() + 1), range(1, surface.NbVPoles() + 1)
    poles = ",\n".join(f"({listed([_point(text, surface.Pole(i, j)) for j in columns])})" for i in rows)
    shape = f"{surface.UDegree()},{surface.VDegree()},({poles}),.UNSPECIFIED.,.F.,.F.,.F."
    along_u, along_v = range(1, surface.NbUKnots() + 1), range(1, surface.NbVKnots() + 1)
    knots = (
        f"({_integers(map(surface.UMultiplicity, along_u))}),({_integers(map(surface.VMultiplicity, along_v))}),"
        f"({reals(map(surface.UKnot, along_u))}),({reals(map(surface.VKnot, along_v))}),.UNSPECIFIED."
    )
    if not (surface.IsURational() or surface.IsVRational()):
        return text.add(f"B_SPLINE_SURFACE_WITH_KNOTS('',{shape},{knots})")
    weights = ",\n".join(f"({reals(surface.Weight(i, j) for j in columns)})" for i in rows)
    return text.add(
        f"(BOUNDED_SURFACE()B_SPLINE_SURFACE({shape})B_SPLINE_SURFACE_WITH_KNOTS({knots})"
        f"GEOMETRIC_REPRESENTATION_ITEM()RATIONAL_B_SPLINE_SURFACE(({weights}))REPRESENTATION_ITEM('')SURFACE())"
    )


def _integers(values: Any) -> str:
    return ",".join(map(str, values))


CURVES: Mapping[type, Callable[[StepText, Any], int]] = {
    Geom_Line: _line,
    Geom_Circle: _circle,
    Geom_Ellipse: _ellipse,
    Geom_BSplineCurve: _spline_curve,
}

SURFACES: Mapping[type, Callable[[StepText, Any], int]] = {
    Geom_Plane: lambda text, s: _elementary(text, "PLANE", s),
    Geom_CylindricalSurface: lambda text, s: _elementary(text, "CYLINDRICAL_SURFACE", s, s.Radius()),
    Geom_ConicalSurface: _cone,
    Geom_SphericalSurface: lambda text, s: _elementary(text, "SPHERICAL_SURFACE", s, s.Radius()),
    Geom_ToroidalSurface: lambda text, s: _elementary(text, "TOROIDAL_SURFACE", s, s.MajorRadius(), s.MinorRadius()),
    Geom_BSplineSurface: _spline_surface,
}
