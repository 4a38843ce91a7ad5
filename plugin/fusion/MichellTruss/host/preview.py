"""A quick look at what would be drawn: the curves in the colours of their families, as custom graphics."""

import adsk.core
import adsk.fusion

from ..logic.colours import COLOURS
from ..logic.plan import Plan
from .drawing import nurbs

_WEIGHT = 2.0
"""Width of the lines, pixels."""


def show_preview(design: adsk.fusion.Design, plan: Plan) -> None:
    """Show the curves; Fusion takes them away before the next preview and when the command ends."""
    group = design.rootComponent.customGraphicsGroups.add()
    for tube in plan.tubes:
        line = group.addCurve(nurbs(tube))
        colour = adsk.core.Color.create(*COLOURS.get(tube.family, COLOURS["feature"]), 255)
        line.color = adsk.fusion.CustomGraphicsSolidColorEffect.create(colour)
        line.weight = _WEIGHT
