"""Edit Truss: the knobs of a truss in the document; OK draws it again.

A double click on the custom feature in the timeline starts the same command.
"""

from typing import Any

import adsk.core
import adsk.fusion

from ...host import events, toolbar
from ...host.document import selected_truss
from ...host.drawing import redraw_truss
from ...host.features import EDIT_COMMAND
from ...host.knob_command import open_dialog
from ...host.parameters import read_parameters, shown_numbers
from ...logic.knobs import read_knobs
from ...logic.selection import apply_knobs


def start() -> None:
    """Add the button."""
    toolbar.add_button(
        EDIT_COMMAND, "Edit Truss", "Change family, radius, entasis and density of a drawn truss.", __file__, _created
    )


def stop() -> None:
    """Take the button away."""
    toolbar.remove_button(EDIT_COMMAND)


def _created(args: adsk.core.CommandCreatedEventArgs) -> None:
    design, knobs = events.active_design(), read_knobs()
    truss = selected_truss(design)
    drawn_with = truss.values
    numbers = shown_numbers(knobs, drawn_with, apply_knobs(truss.layout, drawn_with))
    values = read_parameters(design, truss.prefix, numbers, drawn_with)

    def draw(design: adsk.fusion.Design, values: dict[str, Any]) -> None:
        redraw_truss(design, truss, knobs, values)

    open_dialog(args.command, truss.layout, knobs, values, draw)
