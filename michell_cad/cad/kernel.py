"""The CAD kernel (Open CASCADE through OCP): only this file and its neighbours `kernel_*.py` touch it.

Shapes are made from the tables of a `ShellPlan` by the lowest-level builder, without booleans and without sewing.
"""

# OCP is a binary module: pyright cannot see what it defines.
# pyright: reportAttributeAccessIssue=false

import gc
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepGProp import BRepGProp_Domain, BRepGProp_Face, BRepGProp_Vinert
from OCP.Geom import (
    Geom_BSplineCurve,
    Geom_BSplineSurface,
    Geom_Circle,
    Geom_CylindricalSurface,
    Geom_Ellipse,
    Geom_Line,
    Geom_Plane,
    Geom_SphericalSurface,
    Geom_ToroidalSurface,
)
from OCP.Geom2d import Geom2d_BSplineCurve, Geom2d_Line
from OCP.gp import gp_Ax2, gp_Ax3, gp_Dir, gp_Dir2d, gp_Pnt, gp_Pnt2d
from OCP.TColgp import TColgp_Array1OfPnt, TColgp_Array1OfPnt2d, TColgp_Array2OfPnt
from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal, TColStd_Array2OfReal
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_FORWARD, TopAbs_REVERSED
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import (
    TopoDS,
    TopoDS_Compound,
    TopoDS_Edge,
    TopoDS_Face,
    TopoDS_Shell,
    TopoDS_Solid,
    TopoDS_Vertex,
    TopoDS_Wire,
)
from scipy.interpolate import make_interp_spline

from michell_cad.cad.fits import FITS
from michell_cad.cad.shell_plan import CurveForm, PcurveForm, ShellPlan, SurfaceForm
from michell_cad.cad.tubes import AROUND_KNOTS, SECTION_COUNTS, WEIGHTS, circle_parameter, tube_knots

Progress = Callable[[float], None]

CIRCLE_DEGREE = 9
"""Degree of the constant spline t(angle) that tells where a point of a circle lies on a rational tube."""


def make_solids(plan: ShellPlan, progress: Progress | None = None) -> tuple[list[Any], list[Any]]:
    """Build the solids of a plan, one per component.

    Returns the solids and the faces in the order of the plan (TopoDS handles).
    """
    with no_garbage_collection():
        return _make_solids(plan, progress)


def _make_solids(plan: ShellPlan, progress: Progress | None) -> tuple[list[Any], list[Any]]:
    builder, nowhere = BRep_Builder(), TopLoc_Location()
    edges = _make_edges(builder, plan)
    surfaces = _surface_maker(plan)
    pcurves = _pcurve_maker(plan)
    shells = []
    for _ in range(plan.components):
        shell = TopoDS_Shell()
        builder.MakeShell(shell)
        shells.append(shell)
    faces = []
    c = plan.coedges
    n_faces = len(plan.faces.form)
    bounds = np.searchsorted(c.face, np.arange(n_faces + 1)).tolist()
    rows = list(zip(*(x.tolist() for x in (c.wire, c.edge, c.reversed_, c.form, c.pcurve)), strict=True))
    flipped, component = plan.faces.reversed_.tolist(), plan.faces.component.tolist()
    every = max(1, n_faces // 50)
    for f in range(n_faces):
        surface = surfaces(f)
        face = TopoDS_Face()
        builder.MakeFace(face, surface, nowhere, plan.tolerance)
        _bound_face(builder, face, surface, nowhere, rows[bounds[f] : bounds[f + 1]], edges, pcurves, plan)
        if flipped[f]:
            face.Reverse()
        builder.Add(shells[component[f]], face)
        faces.append(face)
        if progress is not None and f % every == 0:
            progress(f / n_faces)
    # The range comes last: adding a pcurve resets it.
    for edge, (first, last) in zip(edges, plan.edges.ranges.tolist(), strict=True):
        builder.Range(edge, first, last)
    solids = []
    for shell in shells:
        shell.Closed(True)
        solid = TopoDS_Solid()
        builder.MakeSolid(solid)
        builder.Add(solid, shell)
        solids.append(solid)
    return solids, faces


def _bound_face(builder, face, surface, nowhere, coedges, edges, pcurves, plan) -> None:
    """Give the face its wires, and the edges along it their pcurves."""
    tolerance = plan.edges.tolerance
    seams: dict[int, Any] = {}
    wires: dict[int, Any] = {}
    for w, e, reverse, form, pcurve in coedges:
        if w not in wires:
            wires[w] = TopoDS_Wire()
            builder.MakeWire(wires[w])
        edge = edges[e]
        curve = pcurves(form, pcurve, e)
        if e in seams:
            one, reversed_first = seams.pop(e)
            # The kernel wants the pcurve of the forward use first.
            pair = (curve, one) if reversed_first else (one, curve)
            builder.UpdateEdge(edge, pair[0], pair[1], surface, nowhere, float(tolerance[e]))
        else:
            seams[e] = (curve, reverse)
        builder.Add(wires[w], edge.Oriented(TopAbs_REVERSED if reverse else TopAbs_FORWARD))
    for wire in wires.values():
        wire.Closed(True)
        builder.Add(face, wire)
    for e, (curve, _) in seams.items():
        if curve is not None:
            builder.UpdateEdge(edges[e], curve, surface, nowhere, float(tolerance[e]))


def _make_edges(builder: BRep_Builder, plan: ShellPlan) -> list[Any]:
    vertex_tolerance = np.full(len(plan.points), plan.tolerance)
    for side in (0, 1):
        np.maximum.at(vertex_tolerance, plan.edges.ends[:, side], plan.edges.tolerance)
    vertices = []
    for (x, y, z), tolerance in zip(plan.points.tolist(), vertex_tolerance.tolist(), strict=True):
        vertex = TopoDS_Vertex()
        builder.MakeVertex(vertex, gp_Pnt(x, y, z), tolerance)
        vertices.append((vertex.Oriented(TopAbs_FORWARD), vertex.Oriented(TopAbs_REVERSED)))
    curves = _curve_maker(plan)
    edges = []
    table = plan.edges
    for form, number, (a, b), tolerance in zip(
        table.form.tolist(), table.curve.tolist(), table.ends.tolist(), table.tolerance.tolist(), strict=True
    ):
        edge = TopoDS_Edge()
        if form == CurveForm.NONE:
            builder.MakeEdge(edge)
            builder.Degenerated(edge, True)
        else:
            builder.MakeEdge(edge, curves(form, number), tolerance)
        builder.Add(edge, vertices[a][0])
        builder.Add(edge, vertices[b][1])
        edges.append(edge)
    return edges


def _placer(plan: ShellPlan, kind: Any) -> Callable[[int], Any]:
    frames = plan.frames
    origins, axes, zeros = frames.origins.tolist(), frames.axes.tolist(), frames.zeros.tolist()
    return lambda i: kind(gp_Pnt(*origins[i]), gp_Dir(*axes[i]), gp_Dir(*zeros[i]))


def _curve_maker(plan: ShellPlan) -> Callable[[int, int], Any]:
    place = _placer(plan, gp_Ax2)
    radii, origins, axes = plan.frames.radii.tolist(), plan.frames.origins.tolist(), plan.frames.axes.tolist()
    along = {count + 2: _knots(tube_knots(count)) for count in SECTION_COUNTS}

    def make(form: int, i: int) -> Any:
        if form == CurveForm.LINE:
            return Geom_Line(gp_Pnt(*origins[i]), gp_Dir(*axes[i]))
        if form == CurveForm.TUBE_SEAM:
            seam = plan.tube_poles[i][0].tolist()
            poles = TColgp_Array1OfPnt(1, len(seam))
            for k, point in enumerate(seam, 1):
                poles.SetValue(k, gp_Pnt(*point))
            return Geom_BSplineCurve(poles, *along[len(seam)], 3)
        first, second = radii[i]
        return Geom_Circle(place(i), first) if first == second else Geom_Ellipse(place(i), first, second)

    return make


def _surface_maker(plan: ShellPlan) -> Callable[[int], Any]:
    place = _placer(plan, gp_Ax3)
    radii = plan.frames.radii.tolist()
    forms, numbers = plan.faces.form.tolist(), plan.faces.surface.tolist()
    around = _knots(AROUND_KNOTS)
    along = {count + 2: (_tube_weights(count + 2), _knots(tube_knots(count))) for count in SECTION_COUNTS}

    def tube(m: int) -> Any:
        rows = plan.tube_poles[m].tolist()
        poles = TColgp_Array2OfPnt(1, len(WEIGHTS), 1, len(rows[0]))
        weights, (knots, mults) = along[len(rows[0])]
        for i, row in enumerate(rows, 1):
            for j, point in enumerate(row, 1):
                poles.SetValue(i, j, gp_Pnt(*point))
        return Geom_BSplineSurface(poles, weights, around[0], knots, around[1], mults, 2, 3)

    across = _knots(np.repeat([0.0, 1.0], 3))

    def strip(i: int) -> Any:
        poles = TColgp_Array2OfPnt(1, 3, 1, plan.strips.poles.shape[2])
        weights = TColStd_Array2OfReal(1, 3, 1, plan.strips.poles.shape[2])
        for j, (column, weight) in enumerate(
            zip(plan.strips.poles[i].transpose(1, 0, 2).tolist(), plan.strips.weights[i].tolist(), strict=True), 1
        ):
            for k, (point, w) in enumerate(zip(column, (1.0, weight, 1.0), strict=True), 1):
                poles.SetValue(k, j, gp_Pnt(*point))
                weights.SetValue(k, j, w)
        knots, mults = _knots(plan.strips.knots[i])
        return Geom_BSplineSurface(poles, weights, across[0], knots, across[1], mults, 2, plan.strips.degree)

    def make(f: int) -> Any:
        form, i = forms[f], numbers[f]
        if form == SurfaceForm.TUBE:
            return tube(i)
        if form == SurfaceForm.STRIP:
            return strip(i)
        if form == SurfaceForm.TORUS:
            return Geom_ToroidalSurface(place(i), *radii[i])
        if form == SurfaceForm.PLANE:
            return Geom_Plane(place(i))
        kind = Geom_SphericalSurface if form == SurfaceForm.SPHERE else Geom_CylindricalSurface
        return kind(place(i), radii[i][0])

    return make


def _tube_weights(columns: int) -> TColStd_Array2OfReal:
    weights = TColStd_Array2OfReal(1, len(WEIGHTS), 1, columns)
    for i, weight in enumerate(WEIGHTS.tolist(), 1):
        for j in range(1, columns + 1):
            weights.SetValue(i, j, weight)
    return weights


def _pcurve_maker(plan: ShellPlan) -> Callable[[int, int, int], Any]:
    lines = plan.pcurve_lines.tolist()
    whole = [_knots(fit.knots * 2 * np.pi) for fit in FITS]
    breaks = [np.unique(fit.knots) for fit in FITS]
    ranges = plan.edges.ranges
    on_tubes = {
        PcurveForm.TUBE_START: _circle_on_tube(0.0),
        PcurveForm.TUBE_END: _circle_on_tube(1.0, against=True),
        PcurveForm.TUBE_TOP: _circle_on_tube(1.0),
    }

    def make(form: int, i: int, edge: int) -> Any:
        if form == PcurveForm.LINE:
            (u, v), (du, dv) = lines[i]
            return Geom2d_Line(gp_Pnt2d(u, v), gp_Dir2d(du, dv))
        if form == PcurveForm.PLANAR:
            return None
        if form in on_tubes:
            return on_tubes[PcurveForm(form)]
        number = form - PcurveForm.FITTED
        first, last = ranges[edge]
        knots, mults = whole[number]
        if (first, last) != (0.0, 2 * np.pi):
            knots = _reals(first + (last - first) * breaks[number])
        return Geom2d_BSplineCurve(_points_2d(plan.pcurve_poles[number][i]), knots, mults, FITS[number].degree)

    return make


def _points_2d(points: np.ndarray) -> TColgp_Array1OfPnt2d:
    array = TColgp_Array1OfPnt2d(1, len(points))
    for k, (u, v) in enumerate(points.tolist(), 1):
        array.SetValue(k, gp_Pnt2d(u, v))
    return array


def _circle_on_tube(v: float, against: bool = False) -> Any:
    """The spline (t(angle), v), or (1 - t(angle), v) against the angle, over the angles of a circle."""
    knots, poles = [0.0] * (CIRCLE_DEGREE + 1), []
    nodes = (1 - np.cos(np.pi * np.arange(CIRCLE_DEGREE + 1) / CIRCLE_DEGREE)) / 2
    for quarter in range(4):
        # t is smooth within a quarter only, so the quarters are pieces that just join.
        x = (quarter + nodes) * np.pi / 2
        piece = make_interp_spline(nodes, circle_parameter(x), CIRCLE_DEGREE)
        bezier = piece.c
        poles += list(bezier if quarter == 0 else bezier[1:])
        knots += [(quarter + 1) * np.pi / 2] * (CIRCLE_DEGREE + (quarter == 3))
    t = 1 - np.array(poles) if against else np.array(poles)
    return Geom2d_BSplineCurve(
        _points_2d(np.stack([t, np.full(len(t), v)], axis=1)), *_knots(np.array(knots)), CIRCLE_DEGREE
    )


def _knots(repeated: np.ndarray) -> tuple[TColStd_Array1OfReal, TColStd_Array1OfInteger]:
    values, counts = np.unique(repeated, return_counts=True)
    mults = TColStd_Array1OfInteger(1, len(values))
    for k, count in enumerate(counts.tolist(), 1):
        mults.SetValue(k, count)
    return _reals(values), mults


def _reals(values: np.ndarray) -> TColStd_Array1OfReal:
    array = TColStd_Array1OfReal(1, len(values))
    for k, value in enumerate(values.tolist(), 1):
        array.SetValue(k, value)
    return array


def is_valid(shape: Any) -> bool:
    """Whether the kernel's own check finds no fault in a shape."""
    return BRepCheck_Analyzer(shape).IsValid()


def is_closed(solid: Any) -> bool:
    """Whether the faces of a solid fit together; what they look like inside is not checked again."""
    return BRepCheck_Analyzer(solid, False).IsValid()


def faulty_faces(solid: Any, faces: Sequence[Any]) -> list[int] | None:
    """Which of its faces make a solid invalid, perhaps none of them alone; None if the solid is valid."""
    check = BRepCheck_Analyzer(solid, True, True)  # geometric checks, on all processors
    if check.IsValid():
        return None
    parts = ((face, *explore(face, TopAbs_EDGE)) for face in faces)
    return [i for i, part in enumerate(parts) if not all(check.IsValid(shape) for shape in part)]


def volume(shape: Any, accuracy: float = 3e-3) -> float:
    """Volume in mm^3: the kernel's integrals over the cones between the middle of the shape and its faces.

    `accuracy` stops the kernel's adaptive integration face by face. The volume itself is then known to about 1e-5 on
    the trusses of the tests. Spheres are integrated by fixed Gauss points, which are exact there and three times as
    fast; over splines these take twenty times as long and err by 6e-4.
    """
    box = Bnd_Box()
    BRepBndLib.AddClose_s(shape, box)
    center = gp_Pnt(*((np.array(box.CornerMin().Coord()) + box.CornerMax().Coord()) / 2))
    total, surface, domain = 0.0, BRepGProp_Face(), BRepGProp_Domain()
    for part in explore(shape, TopAbs_FACE):
        face = TopoDS.Face_s(part)
        surface.Load(face)
        domain.Init(face)
        if isinstance(BRep_Tool.Surface_s(face), Geom_SphericalSurface):
            total += BRepGProp_Vinert(surface, domain, center).Mass()
        else:
            total += BRepGProp_Vinert(surface, domain, center, accuracy).Mass()
    return total


def compound(shapes: Sequence[Any]) -> Any:
    """One shape that holds all of these."""
    builder, result = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(result)
    for shape in shapes:
        builder.Add(result, shape)
    return result


def as_build123d(solids: Sequence[Any]) -> Any:
    """A build123d Solid, or a Compound of several. (`Part` around a kernel solid would have the volume 0.)"""
    import build123d

    result = build123d.Solid(solids[0]) if len(solids) == 1 else build123d.Compound(compound(solids))
    result.label = "truss"
    return result


def as_cadquery(solids: Sequence[Any]) -> Any:
    """A CadQuery Workplane that holds the solids."""
    import cadquery

    workplane = cadquery.Workplane("XY")
    return workplane.newObject([cadquery.Solid(solid) for solid in solids])


def as_cadquery_assembly(
    solids: Sequence[Any], faces: Sequence[tuple[Any, int, str, tuple[float, float, float]]]
) -> Any:
    """A CadQuery Assembly of the solids, with names and colours for faces (of solid number n)."""
    import cadquery

    whole = cadquery.Assembly(name="truss")
    for number, solid in enumerate(solids):
        whole.add(cadquery.Solid(solid), name=f"truss {number + 1}")
    parts = [whole.objects[f"truss {number + 1}"] for number in range(len(solids))]
    for face, number, name, colour in faces:
        parts[number].addSubshape(cadquery.Face(face), name=name, color=cadquery.Color(*colour))
    return whole


def explore(shape: Any, kind: Any) -> Iterator[Any]:
    """The parts of a shape of one kind; shared ones come as often as they are used."""
    explorer = TopExp_Explorer(shape, kind)
    while explorer.More():
        yield explorer.Current()
        explorer.Next()


@contextmanager
def no_garbage_collection() -> Iterator[None]:
    """Keep Python from searching for cycles: among millions of new small objects that takes a third of the time."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()
