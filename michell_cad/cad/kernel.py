"""The CAD kernel (Open CASCADE through OCP): the only file that touches it.

Shapes are made from the tables of a `ShellPlan` by the lowest-level builder, without booleans and without sewing.
"""

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int
from OCP.BRep import BRep_Builder
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepGProp import BRepGProp
from OCP.Geom import (
    Geom_BSplineCurve,
    Geom_BSplineSurface,
    Geom_Circle,
    Geom_CylindricalSurface,
    Geom_Ellipse,
    Geom_Line,
    Geom_SphericalSurface,
    Geom_ToroidalSurface,
)
from OCP.Geom2d import Geom2d_BSplineCurve, Geom2d_Line
from OCP.gp import gp_Ax2, gp_Ax3, gp_Dir, gp_Dir2d, gp_Pnt, gp_Pnt2d
from OCP.GProp import GProp_GProps
from OCP.TColgp import TColgp_Array1OfPnt, TColgp_Array1OfPnt2d, TColgp_Array2OfPnt
from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal, TColStd_Array2OfReal
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FORWARD, TopAbs_REVERSED
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Compound, TopoDS_Edge, TopoDS_Face, TopoDS_Shell, TopoDS_Solid, TopoDS_Vertex, TopoDS_Wire

from michell_cad.cad.shell_plan import CurveForm, PcurveForm, ShellPlan, SurfaceForm
from michell_cad.cad.spheres import DEGREE, fit_knots
from michell_cad.cad.tubes import AROUND_KNOTS, KNOTS, WEIGHTS, circle_parameter

Progress = Callable[[float], None]

CIRCLE_DEGREE = 9
"""Degree of the constant spline t(angle) that tells where a point of a circle lies on a rational tube."""


def make_solids(plan: ShellPlan, progress: Progress | None = None) -> tuple[list[Any], list[Any]]:
    """Build the solids of a plan, one per component.

    Returns the solids and the faces in the order of the plan (TopoDS handles).
    """
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
    rows = list(
        zip(*(x.tolist() for x in (c.wire, c.edge, c.reversed_, c.form, c.pcurve)), strict=True)
    )
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
    wire, number = None, -1
    for w, e, reverse, form, pcurve in coedges:
        if w != number:
            if wire is not None:
                wire.Closed(True)
                builder.Add(face, wire)
            wire, number = TopoDS_Wire(), w
            builder.MakeWire(wire)
        edge = edges[e]
        curve = pcurves(form, pcurve, e)
        if e in seams:
            one, reversed_first = seams.pop(e)
            # The kernel wants the pcurve of the forward use first.
            pair = (curve, one) if reversed_first else (one, curve)
            builder.UpdateEdge(edge, pair[0], pair[1], surface, nowhere, float(tolerance[e]))
        else:
            seams[e] = (curve, reverse)
        builder.Add(wire, edge.Oriented(TopAbs_REVERSED if reverse else TopAbs_FORWARD))
    wire.Closed(True)
    builder.Add(face, wire)
    for e, (curve, _) in seams.items():
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
    seams = plan.tube_poles[:, 0].tolist()
    knots, mults = _knots(KNOTS)

    def make(form: int, i: int) -> Any:
        if form == CurveForm.LINE:
            return Geom_Line(gp_Pnt(*origins[i]), gp_Dir(*axes[i]))
        if form == CurveForm.TUBE_SEAM:
            poles = TColgp_Array1OfPnt(1, len(seams[i]))
            for k, point in enumerate(seams[i], 1):
                poles.SetValue(k, gp_Pnt(*point))
            return Geom_BSplineCurve(poles, knots, mults, 3)
        first, second = radii[i]
        return Geom_Circle(place(i), first) if first == second else Geom_Ellipse(place(i), first, second)

    return make


def _surface_maker(plan: ShellPlan) -> Callable[[int], Any]:
    place = _placer(plan, gp_Ax3)
    radii = plan.frames.radii.tolist()
    forms, numbers = plan.faces.form.tolist(), plan.faces.surface.tolist()
    around, along = _knots(AROUND_KNOTS), _knots(KNOTS)
    columns = plan.tube_poles.shape[2]
    weights = TColStd_Array2OfReal(1, len(WEIGHTS), 1, columns)
    for i, weight in enumerate(WEIGHTS.tolist(), 1):
        for j in range(1, columns + 1):
            weights.SetValue(i, j, weight)

    def tube(m: int) -> Any:
        poles = TColgp_Array2OfPnt(1, len(WEIGHTS), 1, columns)
        for i, row in enumerate(plan.tube_poles[m].tolist(), 1):
            for j, point in enumerate(row, 1):
                poles.SetValue(i, j, gp_Pnt(*point))
        return Geom_BSplineSurface(poles, weights, around[0], along[0], around[1], along[1], 2, 3)

    def make(f: int) -> Any:
        form, i = forms[f], numbers[f]
        if form == SurfaceForm.TUBE:
            return tube(i)
        if form == SurfaceForm.TORUS:
            return Geom_ToroidalSurface(place(i), *radii[i])
        kind = Geom_SphericalSurface if form == SurfaceForm.SPHERE else Geom_CylindricalSurface
        return kind(place(i), radii[i][0])

    return make


def _pcurve_maker(plan: ShellPlan) -> Callable[[int, int, int], Any]:
    lines = plan.pcurve_lines.tolist()
    whole = _knots(fit_knots() * 2 * np.pi)
    ranges = plan.edges.ranges
    tube_ends = [_circle_on_tube(0.0), _circle_on_tube(1.0)]

    def make(form: int, i: int, edge: int) -> Any:
        if form == PcurveForm.LINE:
            (u, v), (du, dv) = lines[i]
            return Geom2d_Line(gp_Pnt2d(u, v), gp_Dir2d(du, dv))
        if form != PcurveForm.FITTED:
            return tube_ends[form == PcurveForm.TUBE_END]
        first, last = ranges[edge]
        knots, mults = whole
        if (first, last) != (0.0, 2 * np.pi):
            knots, mults = _knots(first + (last - first) * fit_knots())
        return Geom2d_BSplineCurve(_points_2d(plan.pcurve_poles[i]), knots, mults, DEGREE)

    return make


def _points_2d(points: np.ndarray) -> TColgp_Array1OfPnt2d:
    array = TColgp_Array1OfPnt2d(1, len(points))
    for k, (u, v) in enumerate(points.tolist(), 1):
        array.SetValue(k, gp_Pnt2d(u, v))
    return array


def _circle_on_tube(v: float) -> Any:
    """The spline (t(angle), v) at the start of a tube, (1 - t(angle), v) at its end, over the angles of a circle."""
    from scipy.interpolate import make_interp_spline

    knots, poles = [0.0] * (CIRCLE_DEGREE + 1), []
    nodes = (1 - np.cos(np.pi * np.arange(CIRCLE_DEGREE + 1) / CIRCLE_DEGREE)) / 2
    for quarter in range(4):
        # t is smooth within a quarter only, so the quarters are pieces that just join.
        x = (quarter + nodes) * np.pi / 2
        piece = make_interp_spline(nodes, circle_parameter(x), CIRCLE_DEGREE)
        bezier = piece.c
        poles += list(bezier if quarter == 0 else bezier[1:])
        knots += [(quarter + 1) * np.pi / 2] * (CIRCLE_DEGREE + (quarter == 3))
    t = np.array(poles) if v == 0 else 1 - np.array(poles)
    return Geom2d_BSplineCurve(
        _points_2d(np.stack([t, np.full(len(t), v)], axis=1)), *_knots(np.array(knots)), CIRCLE_DEGREE
    )


def _knots(repeated: np.ndarray) -> tuple[TColStd_Array1OfReal, TColStd_Array1OfInteger]:
    values, counts = np.unique(repeated, return_counts=True)
    knots, mults = TColStd_Array1OfReal(1, len(values)), TColStd_Array1OfInteger(1, len(values))
    for k, (value, count) in enumerate(zip(values.tolist(), counts.tolist(), strict=True), 1):
        knots.SetValue(k, value)
        mults.SetValue(k, count)
    return knots, mults


def is_valid(shape: Any) -> bool:
    """Whether the kernel's own check finds no fault in a shape."""
    return BRepCheck_Analyzer(shape).IsValid()


def invalid_faces(shape: Any, faces: Sequence[Any]) -> list[int]:
    """Numbers of the faces in which the kernel's check finds a fault."""
    check = BRepCheck_Analyzer(shape)
    faulty = []
    for i, face in enumerate(faces):
        parts = [face]
        explorer = TopExp_Explorer(face, TopAbs_EDGE)
        while explorer.More():
            parts.append(explorer.Current())
            explorer.Next()
        if not all(check.IsValid(part) for part in parts):
            faulty.append(i)
    return faulty


def volume(shape: Any, accuracy: float = 1e-5) -> float:
    """Volume in mm^3. `accuracy` is relative; the kernel's own default errs by 1e-4 and more on splines."""
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties, accuracy, True, False)
    return properties.Mass()
