"""Swept profiles and node bodies as solids of the CAD kernel (Open CASCADE through OCP), made edge by edge.

A sweep has one face for each side of the profile and each stretch of its path, and plane ends. All edges are shared, so
the shell is closed by construction. Faces are planes where a stretch is a prism with a straight side, else B-splines
(see `sweeps` for their poles).
"""

# OCP is a binary module: pyright cannot see what it defines.
# pyright: reportAttributeAccessIssue=false

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from OCP.BRep import BRep_Builder
from OCP.BRepPrimAPI import BRepPrimAPI_MakeSphere
from OCP.Geom import Geom_BSplineCurve, Geom_BSplineSurface, Geom_Line, Geom_Plane
from OCP.Geom2d import Geom2d_BSplineCurve
from OCP.gp import gp_Ax3, gp_Dir, gp_Pnt, gp_Pnt2d
from OCP.TColgp import TColgp_Array1OfPnt, TColgp_Array1OfPnt2d, TColgp_Array2OfPnt
from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal
from OCP.TopAbs import TopAbs_FACE, TopAbs_FORWARD, TopAbs_REVERSED
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shell, TopoDS_Solid, TopoDS_Vertex, TopoDS_Wire

from michell_cad.cad.kernel import explore
from michell_cad.cad.sweep_hulls import Hull
from michell_cad.cad.sweeps import Stretch, Sweep
from michell_cad.profiles import Profile

TOLERANCE = 1e-6
"""Of edges and vertices (relative to the radius), as for round trusses."""

LEAST_TOLERANCE = 1e-7
"""The kernel's smallest, mm."""


Place = tuple[float, float]
"""Parameters (u, v) on a face."""


class _Edge(NamedTuple):
    """An edge and its range of parameters."""

    shape: Any
    first: float
    last: float


class _Solid:
    """A solid while it grows."""

    def __init__(self, tolerance: float) -> None:
        self.builder, self.nowhere = BRep_Builder(), TopLoc_Location()
        self.tolerance = max(tolerance, LEAST_TOLERANCE)
        self.shell = TopoDS_Shell()
        self.builder.MakeShell(self.shell)
        self.edges: list[_Edge] = []

    def vertex(self, point: np.ndarray) -> Any:
        """Add a vertex."""
        vertex = TopoDS_Vertex()
        self.builder.MakeVertex(vertex, gp_Pnt(*point.tolist()), self.tolerance)
        return vertex

    def edge(self, curve: Any, first: float, last: float, start: Any, end: Any) -> _Edge:
        """Add an edge along a curve, from its first to its last parameter."""
        shape = TopoDS_Edge()
        self.builder.MakeEdge(shape, curve, self.tolerance)
        self.builder.Add(shape, start.Oriented(TopAbs_FORWARD))
        self.builder.Add(shape, end.Oriented(TopAbs_REVERSED))
        self.edges.append(_Edge(shape, first, last))
        return self.edges[-1]

    def line(self, a: np.ndarray, b: np.ndarray, start: Any, end: Any) -> _Edge:
        """Add a straight edge."""
        length = float(np.linalg.norm(b - a))
        return self.edge(Geom_Line(gp_Pnt(*a.tolist()), gp_Dir(*(b - a).tolist())), 0.0, length, start, end)

    def spline(self, poles: np.ndarray, knots: np.ndarray, degree: int, start: Any, end: Any) -> _Edge:
        """Add an edge along a B-spline."""
        curve = Geom_BSplineCurve(_array(poles), *_knots(knots), degree)
        return self.edge(curve, float(knots[0]), float(knots[-1]), start, end)

    def face(self, surface: Any, around: Sequence[tuple[_Edge, bool]], flipped: bool = False) -> Any:
        """Add a face with one wire of edges, each run forward or backward; a flipped one faces the other way."""
        face, wire = TopoDS_Face(), TopoDS_Wire()
        self.builder.MakeFace(face, surface, self.nowhere, self.tolerance)
        self.builder.MakeWire(wire)
        for edge, forward in around:
            self.builder.Add(wire, edge.shape.Oriented(TopAbs_FORWARD if forward else TopAbs_REVERSED))
        wire.Closed(True)
        self.builder.Add(face, wire)
        if flipped:
            face.Reverse()
        self.builder.Add(self.shell, face)
        return face

    def on_surface(self, edge: _Edge, surface: Any, *places: tuple[Place, Place]) -> None:
        """Tell where an edge runs in the parameters of a face: straight from a place to another; twice for a seam."""
        curves = []
        for a, b in places:
            poles = TColgp_Array1OfPnt2d(1, 2)
            poles.SetValue(1, gp_Pnt2d(*a))
            poles.SetValue(2, gp_Pnt2d(*b))
            curves.append(Geom2d_BSplineCurve(poles, *_knots(np.repeat([edge.first, edge.last], 2)), 1))
        self.builder.UpdateEdge(edge.shape, *curves, surface, self.nowhere, self.tolerance)

    def finished(self) -> Any:
        """The solid."""
        # The range comes last: adding a pcurve resets it.
        for edge in self.edges:
            self.builder.Range(edge.shape, edge.first, edge.last)
        self.shell.Closed(True)
        solid = TopoDS_Solid()
        self.builder.MakeSolid(solid)
        self.builder.Add(solid, self.shell)
        return solid


def make_sweep(sweep: Sweep, profile: Profile, radius: float) -> Any:
    """The solid of a sweep; `radius` is the size that tolerances go by."""
    s = _Solid(TOLERANCE * radius)
    sides = [np.asarray(side) for side in profile.sides]
    corners = np.array([side[0] for side in sides])
    ends = [stretch.poles[0] for stretch in sweep.stretches]
    if not sweep.closed:
        ends.append(sweep.stretches[-1].poles[-1])
    vertices = [[s.vertex(point) for point in _placed(F, corners)] for F in ends]
    sections = [
        [_side_edge(s, F, side, row[k], row[(k + 1) % len(row)]) for k, side in enumerate(sides)]
        for F, row in zip(ends, vertices, strict=True)
    ]
    for i, stretch in enumerate(sweep.stretches):
        j = (i + 1) % len(ends)
        rails = [_rail(s, stretch, c, vertices[i][k], vertices[j][k]) for k, c in enumerate(corners)]
        for k, side in enumerate(sides):
            right = rails[(k + 1) % len(rails)]
            _add_wall(s, stretch, side, (sections[i][k], right, sections[j][k], rails[k]))
    if not sweep.closed:
        for i, flipped in ((0, True), (-1, False)):
            s.face(_plane(ends[i]), [(edge, True) for edge in sections[i]], flipped)
    return s.finished()


def make_ball(center: np.ndarray, radius: float) -> Any:
    """A sphere as a solid."""
    return BRepPrimAPI_MakeSphere(gp_Pnt(*np.asarray(center).tolist()), radius).Solid()


def make_hull(hull: Hull, radius: float) -> Any:
    """A convex polyhedron as a solid."""
    s = _Solid(TOLERANCE * radius)
    X = np.asarray(hull.vertices)
    vertices = [s.vertex(point) for point in X]
    edges: dict[tuple[int, int], _Edge] = {}
    for face in hull.faces:
        corners = face.tolist()
        around = []
        for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
            low, high = min(a, b), max(a, b)
            if (low, high) not in edges:
                edges[low, high] = s.line(X[low], X[high], vertices[low], vertices[high])
            around.append((edges[low, high], a < b))
        P = X[face]
        normal = np.cross(P - P[0], np.roll(P, -1, axis=0) - P[0]).sum(0)
        s.face(Geom_Plane(gp_Pnt(*P.mean(0).tolist()), gp_Dir(*normal.tolist())), around)
    return s.finished()


def faces_of(solid: Any) -> list[Any]:
    """The faces of a solid in order."""
    return list(explore(solid, TopAbs_FACE))


def _side_edge(s: _Solid, F: np.ndarray, side: np.ndarray, start: Any, end: Any) -> _Edge:
    """The edge of a section along one side of the profile."""
    points = _placed(F, side)
    if len(side) == 2:
        return s.line(points[0], points[1], start, end)
    return s.spline(points, _side_knots(side), 3, start, end)


def _rail(s: _Solid, stretch: Stretch, corner: np.ndarray, start: Any, end: Any) -> _Edge:
    """The edge of a corner of the profile along a stretch."""
    poles = _along(stretch, corner[None])[0]
    if stretch.degree == 1:
        return s.line(poles[0], poles[-1], start, end)
    return s.spline(poles, np.asarray(stretch.knots), stretch.degree, start, end)


def _add_wall(s: _Solid, stretch: Stretch, side: np.ndarray, edges: tuple[_Edge, _Edge, _Edge, _Edge]) -> None:
    """The face of one side along a stretch; u runs along the side, v along the path, the normal points outward.

    `edges` are the first section, the right rail, the last section and the left rail; there is one rail, a seam, on a
    profile that is smooth all around.
    """
    bottom, right, top, left = edges
    around = [(bottom, True), (right, True), (top, False), (left, False)]
    if stretch.degree == 1 and len(side) == 2:
        P = _along(stretch, side)[:, 0]
        edge, along = P[1] - P[0], stretch.poles[-1, 0] - stretch.poles[0, 0]
        normal = np.cross(edge, along)
        s.face(Geom_Plane(gp_Pnt(*P[0].tolist()), gp_Dir(*normal.tolist())), around)
        return
    u_knots, u_degree = (np.array([0.0, 0, 1, 1]), 1) if len(side) == 2 else (_side_knots(side), 3)
    u, v = _knots(u_knots), _knots(np.asarray(stretch.knots))
    surface = Geom_BSplineSurface(_grid(_along(stretch, side)), u[0], v[0], u[1], v[1], u_degree, stretch.degree)
    s.face(surface, around)
    corners = [(x, y) for y in stretch.knots[[0, -1]].tolist() for x in u_knots[[0, -1]].tolist()]
    s.on_surface(bottom, surface, (corners[0], corners[1]))
    s.on_surface(top, surface, (corners[2], corners[3]))
    if left is right:
        s.on_surface(left, surface, (corners[1], corners[3]), (corners[0], corners[2]))
    else:
        s.on_surface(left, surface, (corners[0], corners[2]))
        s.on_surface(right, surface, (corners[1], corners[3]))


def _placed(F: np.ndarray, outline: np.ndarray) -> np.ndarray:
    """Points of the profile on a section."""
    return F[0] + outline[:, :1] * F[1] + outline[:, 1:] * F[2]


def _along(stretch: Stretch, outline: np.ndarray) -> np.ndarray:
    """Poles (points of the profile, poles of the stretch, 3) of the surface."""
    P = stretch.poles
    return P[:, 0] + outline[:, None, :1] * P[:, 1] + outline[:, None, 1:] * P[:, 2]


def _side_knots(side: np.ndarray) -> np.ndarray:
    """Knots of joined cubics, by the chords of the pieces."""
    breaks = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(side[::3], axis=0), axis=1))])
    return np.concatenate([breaks[:1], np.repeat(breaks, 3), breaks[-1:]])


def _plane(F: np.ndarray) -> Any:
    normal = np.cross(F[1], F[2])
    return Geom_Plane(gp_Ax3(gp_Pnt(*F[0].tolist()), gp_Dir(*normal.tolist()), gp_Dir(*F[1].tolist())))


def _array(points: np.ndarray) -> TColgp_Array1OfPnt:
    array = TColgp_Array1OfPnt(1, len(points))
    for k, point in enumerate(points.tolist(), 1):
        array.SetValue(k, gp_Pnt(*point))
    return array


def _grid(points: np.ndarray) -> TColgp_Array2OfPnt:
    array = TColgp_Array2OfPnt(1, len(points), 1, len(points[0]))
    for i, row in enumerate(points.tolist(), 1):
        for j, point in enumerate(row, 1):
            array.SetValue(i, j, gp_Pnt(*point))
    return array


def _knots(repeated: np.ndarray) -> tuple[TColStd_Array1OfReal, TColStd_Array1OfInteger]:
    values, counts = np.unique(repeated, return_counts=True)
    knots, mults = TColStd_Array1OfReal(1, len(values)), TColStd_Array1OfInteger(1, len(values))
    for k, (value, count) in enumerate(zip(values.tolist(), counts.tolist(), strict=True), 1):
        knots.SetValue(k, value)
        mults.SetValue(k, count)
    return knots, mults
