"""Draw a planned truss as native features: sketches, sweeps and lofts in one component per family.

All numbers come from `logic.plan` in centimetres. A tube is a fixed spline in a sketch, circles on planes across it
whose radii are expressions of the user parameters, and a sweep of the one circle, or a loft of the several along the
spline as centre line. `PipeFeatures.createInput` would save the circle, but is newer than the classes that the add-in
is checked against.
"""

import math
from typing import Any

import adsk.core
import adsk.fusion

from ..logic.isosurface import Isosurface
from ..logic.knobs import Knob
from ..logic.layout import Layout, LayoutError
from ..logic.plan import Plan, Sphere, Tube, make_plan, refuse_too_large
from ..logic.selection import apply_knobs
from . import events, features
from .appearance import colour_family, give_material
from .document import GROUP, DrawnTruss, free_prefix
from .parameters import radius_expression, shown_numbers, write_parameters

Numbers = dict[str, tuple[Knob, float]]

NODES = "nodes"
"""Name of the component of the node spheres."""


def draw_truss(
    design: adsk.fusion.Design,
    layout: Layout,
    knobs: tuple[Knob, ...],
    values: dict[str, Any],
    prefix: str | None = None,
) -> DrawnTruss:
    """Draw a layout with knobs into the design, under a component of its own.

    Parameters
    ----------
    prefix : what the names of its user parameters begin with (default: a free one).

    Raises
    ------
    LayoutError
        If the knobs leave nothing, the truss is too large for native features, or the designer cancels.
    """
    chosen = apply_knobs(layout, values)
    plan = make_plan(layout, chosen)
    refuse_too_large(plan)
    prefix = prefix or free_prefix(design)
    numbers = shown_numbers(knobs, values, chosen)
    write_parameters(design, prefix, numbers)
    occurrence = design.rootComponent.occurrences.addNewComponent(adsk.core.Matrix3D.create())
    occurrence.component.name = f"Michell truss {prefix.strip('_').removeprefix('michell')}"
    truss = DrawnTruss(occurrence)
    with _Progress(len(plan.tubes)) as progress:
        for family in plan.families:
            _draw_family(design, truss, prefix, family, plan, numbers, progress)
    _draw_nodes(truss, prefix, plan.spheres, numbers)
    truss.store(prefix, layout, values)
    return truss


def redraw_truss(
    design: adsk.fusion.Design, truss: DrawnTruss, knobs: tuple[Knob, ...], values: dict[str, Any]
) -> DrawnTruss:
    """Draw a truss of the document again with other knobs, with the same parameters and materials."""
    layout, prefix, materials = truss.layout, truss.prefix, truss.materials
    chosen = apply_knobs(layout, values)
    refuse_too_large(make_plan(layout, chosen))
    truss.occurrence.deleteMe()
    drawn = draw_truss(design, layout, knobs, values, prefix)
    drawn.remember_materials(materials)
    for entry in materials:
        give_material(design, drawn, Isosurface(entry["axis"], entry["value"], ""), entry["material"])
    return drawn


def _draw_family(
    design: adsk.fusion.Design,
    truss: DrawnTruss,
    prefix: str,
    family: str,
    plan: Plan,
    numbers: Numbers,
    progress: "_Progress",
) -> None:
    occurrence = _add_component(truss, prefix, family)
    component = occurrence.component
    colour_family(design, occurrence, family)
    first, last = None, None
    for tube in plan.tubes:
        if tube.family == family:
            path, last = _draw_tube(component, tube, prefix, numbers)
            first = first or path
            progress.step()
    if first and last:
        features.add_feature(component, first, last, prefix, family, numbers)
    component.isSketchFolderLightBulbOn = False
    component.isConstructionFolderLightBulbOn = False


def _add_component(truss: DrawnTruss, prefix: str, name: str) -> adsk.fusion.Occurrence:
    occurrence = truss.occurrence.component.occurrences.addNewComponent(adsk.core.Matrix3D.create())
    occurrence.component.name = f"{truss.occurrence.component.name} {name}"
    occurrence.component.attributes.add(GROUP, "prefix", prefix)
    return occurrence


def _draw_tube(
    component: adsk.fusion.Component, tube: Tube, prefix: str, numbers: Numbers
) -> tuple[adsk.fusion.Sketch, adsk.fusion.Feature]:
    """Draw one tube; return its first and its last timeline entry."""
    sketch = component.sketches.add(component.xYConstructionPlane)
    sketch.name = tube.name
    spline = sketch.sketchCurves.sketchFixedSplines.addByNurbsCurve(nurbs(tube))
    profiles = []
    for section in tube.sections:
        expression = radius_expression(section, prefix, numbers)
        profiles.append(_draw_circle(component, spline, section.at, section.centre, section.radius, expression))
    operation = adsk.fusion.FeatureOperations.NewBodyFeatureOperation
    if tube.is_sweep:
        path = component.features.createPath(spline, False)
        sweeps = component.features.sweepFeatures
        feature: adsk.fusion.Feature = sweeps.add(sweeps.createInput(profiles[0], path, operation))
    else:
        lofts = component.features.loftFeatures
        loft = lofts.createInput(operation)
        for profile in profiles:
            loft.loftSections.add(profile)
        loft.centerLineOrRails.addCenterLine(spline)
        loft.isClosed = tube.closed
        feature = lofts.add(loft)
    feature.name = tube.name
    body = feature.bodies.item(0)
    body.name = tube.name
    body.attributes.add(GROUP, "curve", str(tube.curve))
    return sketch, feature


def nurbs(tube: Tube) -> adsk.core.NurbsCurve3D:
    """The path of a tube, as sketches and custom graphics take it."""
    points = [adsk.core.Point3D.create(*point) for point in tube.points]
    return adsk.core.NurbsCurve3D.createNonRational(points, 3, list(tube.knots), False)


def _draw_circle(
    component: adsk.fusion.Component,
    spline: adsk.fusion.SketchFixedSpline,
    at: float,
    centre: tuple[float, float, float],
    radius: float,
    expression: str,
) -> adsk.fusion.Profile:
    """A circle across a spline at a fraction of its length, with its radius bound to an expression."""
    planes = component.constructionPlanes
    across = planes.createInput()
    across.setByDistanceOnPath(spline, adsk.core.ValueInput.createByReal(at))
    sketch = component.sketches.add(planes.add(across))
    middle = sketch.modelToSketchSpace(adsk.core.Point3D.create(*centre))
    circle = sketch.sketchCurves.sketchCircles.addByCenterRadius(middle, radius)
    off = radius * math.sqrt(0.5)
    beside = adsk.core.Point3D.create(middle.x + off, middle.y + off, 0.0)
    sketch.sketchDimensions.addRadialDimension(circle, beside, True).parameter.expression = expression
    return sketch.profiles.item(0)


def _draw_nodes(truss: DrawnTruss, prefix: str, spheres: tuple[Sphere, ...], numbers: Numbers) -> None:
    """The node spheres, in one base feature that the custom feature keeps up to date."""
    component = _add_component(truss, prefix, NODES).component
    base = component.features.baseFeatures.add()
    base.startEdit()
    for sphere in spheres:
        body = component.bRepBodies.add(features.sphere_body(sphere), base)
        body.name = f"node {sphere.node}"
    base.finishEdit()
    features.add_feature(component, base, base, prefix, NODES, numbers)


class _Progress:
    """A progress bar with a cancel button."""

    def __init__(self, steps: int) -> None:
        self._dialog = events.application().userInterface.createProgressDialog()
        self._steps, self._done = steps, 0

    def __enter__(self) -> "_Progress":
        self._dialog.isCancelButtonShown = True
        self._dialog.show(events.TITLE, "Drawing member curve %v of %m", 0, self._steps, 1)
        return self

    def __exit__(self, *_: object) -> None:
        self._dialog.hide()

    def step(self) -> None:
        """One more curve is drawn."""
        self._done += 1
        self._dialog.progressValue = self._done
        if self._dialog.wasCancelled:
            raise LayoutError("Cancelled: the design is as it was.")
