"""What the commands with a knob dialog share: the dialog, its checks, its preview, and what OK does."""

from collections.abc import Callable
from typing import Any

import adsk.core
import adsk.fusion

from ..logic.knobs import Knob, check_values
from ..logic.layout import Layout, LayoutError
from ..logic.plan import Plan, make_plan, refuse_too_large
from ..logic.selection import DRAWN, apply_knobs
from . import events
from .dialog import KnobDialog
from .preview import show_preview


def open_dialog(
    command: adsk.core.Command,
    layout: Layout,
    knobs: tuple[Knob, ...],
    values: dict[str, Any],
    draw: Callable[[adsk.fusion.Design, dict[str, Any]], None],
) -> None:
    """Fill a command's dialog with the knobs; OK calls `draw` with their values."""
    check_values(knobs, values)
    dialog = KnobDialog(command.commandInputs, knobs, values)

    def planned() -> Plan:
        check_values(knobs, dialog.values())
        return make_plan(layout, apply_knobs(layout, dialog.values()))

    def validate(args: adsk.core.ValidateInputsEventArgs) -> None:
        try:
            check_values(knobs, dialog.values())
            apply_knobs(layout, dialog.values())
        except LayoutError as error:
            args.areInputsValid = False
            dialog.say(str(error))

    def preview(_: adsk.core.CommandEventArgs) -> None:
        plan = planned()
        show_preview(events.active_design(), plan)
        dialog.say(_summary(plan, knobs))

    def execute(_: adsk.core.CommandEventArgs) -> None:
        draw(events.active_design(), dialog.values())

    events.on_validate(command.validateInputs, validate)
    events.on_command(command.executePreview, preview)
    events.on_command(command.execute, execute)
    command.okButtonText = "Draw"


def _summary(plan: Plan, knobs: tuple[Knob, ...]) -> str:
    """What OK will do, in words."""
    counts = (f"{sum(tube.family == family for tube in plan.tubes)} {family}" for family in plan.families)
    lines = [f"{len(plan.tubes)} bodies: {', '.join(counts)}; {len(plan.spheres)} nodes."]
    left = [knob.title for knob in knobs if knob.name not in DRAWN]
    if left:
        lines.append(f"{' and '.join(left)}: in the STEP of michell-cad only.")
    try:
        refuse_too_large(plan)
    except LayoutError as error:
        lines.append(str(error))
    return "\n".join(lines)
