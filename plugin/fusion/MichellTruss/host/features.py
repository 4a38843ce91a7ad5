"""The custom feature of the add-in: it groups what was drawn for a family, and keeps the node spheres up to date.

Its parameters are the user parameters of the truss, so a change of one of them computes it again. The tubes follow by
their own expressions; the spheres are not parametric and are made anew.
"""

from pathlib import Path

import adsk.core
import adsk.fusion

from ..logic.knobs import Knob, check_values, read_knobs
from ..logic.layout import LayoutError
from ..logic.plan import Sphere, node_spheres
from ..logic.selection import apply_knobs
from ..logic.units import host_unit
from . import events
from .document import component_prefix, drawn_trusses
from .parameters import read_parameters, shown_numbers

FEATURE = "MichellCad.MichellTruss"
EDIT_COMMAND = "MichellTrussEdit"
"""The command that a double click on the feature in the timeline starts."""

_ICONS = str(Path(__file__).parents[1] / "commands" / "draw_truss" / "resources")

_LOST = "API_COMPUTE_ERROR"
"""Fusion's message for a feature that cannot be computed; it takes no text of one's own."""

_definition: adsk.fusion.CustomFeatureDefinition | None = None


def start() -> None:
    """Define the custom feature, so that Fusion knows the add-in that computes it."""
    global _definition
    _definition = adsk.fusion.CustomFeatureDefinition.create(FEATURE, events.TITLE, _ICONS)
    _definition.editCommandId = EDIT_COMMAND
    events.on_compute(_definition, _compute)


def stop() -> None:
    """Let go of the definition."""
    global _definition
    _definition = None


def add_feature(
    component: adsk.fusion.Component,
    first: adsk.core.Base,
    last: adsk.core.Base,
    prefix: str,
    name: str,
    numbers: dict[str, tuple[Knob, float]],
) -> None:
    """Group the timeline entries from `first` to `last` of a component, with the user parameters as parameters."""
    assert _definition is not None, "the add-in was not started"
    custom = component.features.customFeatures
    given = custom.createInput(_definition)
    for parameter, (knob, _) in numbers.items():
        value = adsk.core.ValueInput.createByString(prefix + parameter)
        given.addCustomParameter(parameter, parameter.replace("_", " "), value, host_unit(knob.unit), True)
    given.setStartAndEndFeatures(first, last)
    custom.add(given).name = f"{events.TITLE} {name}"


def sphere_body(sphere: Sphere) -> adsk.fusion.BRepBody:
    """A sphere that belongs to no document yet."""
    return adsk.fusion.TemporaryBRepManager.get().createSphere(adsk.core.Point3D.create(*sphere.centre), sphere.radius)


def _compute(args: adsk.fusion.CustomFeatureEventArgs) -> None:
    """Check the parameters, and give the spheres the radii that they ask for."""
    component = args.customFeature.parentComponent
    design = events.active_design()
    # A truss that is just being drawn is not stored yet: its bodies are new and right.
    truss = next((one for one in drawn_trusses(design) if one.prefix == component_prefix(component)), None)
    if truss is None:
        return
    knobs, layout = read_knobs(), truss.layout
    try:
        before = truss.values
        numbers = shown_numbers(knobs, before, apply_knobs(layout, before))
        values = read_parameters(design, truss.prefix, numbers, before)
        check_values(knobs, values)
        # The curves are those that were drawn: density and family change with Edit Truss only.
        drawn = {name: before[name] for name in ("family", "every", "offset") if name in before}
        spheres = node_spheres(layout, apply_knobs(layout, values | drawn))
    except LayoutError as error:
        args.computeStatus.statusMessages.addError(_LOST, "")
        events.application().log(str(error), adsk.core.LogLevels.ErrorLogLevel, adsk.core.LogTypes.ConsoleLogType)
        return
    _update_spheres(component, spheres)


def _update_spheres(component: adsk.fusion.Component, spheres: tuple[Sphere, ...]) -> None:
    """Replace the spheres of the component of the nodes; other components have no base feature."""
    bases = component.features.baseFeatures
    if not bases.count:
        return
    base = bases.item(0)
    base.startEdit()
    for number, sphere in enumerate(spheres):
        base.updateBody(base.bodies.item(number), sphere_body(sphere))
    base.finishEdit()
