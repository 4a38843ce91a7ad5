"""Draw Truss: choose a layout, turn the knobs, draw it as native features, or import its STEP if it is too large."""

from pathlib import Path
from typing import Any

import adsk.core
import adsk.fusion

from ...host import events, toolbar
from ...host.drawing import draw_truss
from ...host.knob_command import open_dialog
from ...host.step_import import choose_file, choose_step, import_step
from ...logic.knobs import default_values, read_knobs
from ...logic.layout import read_layout
from ...logic.plan import TooLargeError

COMMAND = "MichellTrussDraw"


def start() -> None:
    """Add the button."""
    toolbar.add_button(
        COMMAND, "Draw Truss", "Draw a truss of michell_cad as native bodies by family.", __file__, _created
    )


def stop() -> None:
    """Take the button away."""
    toolbar.remove_button(COMMAND)


def _created(args: adsk.core.CommandCreatedEventArgs) -> None:
    events.active_design()
    path = choose_file("Truss layout of michell_cad", "Truss layouts (*.json)")
    if path is None:
        return
    layout, knobs = read_layout(path), read_knobs()

    def draw(design: adsk.fusion.Design, values: dict[str, Any]) -> None:
        try:
            draw_truss(design, layout, knobs, values)
        except TooLargeError as error:
            _offer_step(design, error, path)

    open_dialog(args.command, layout, knobs, default_values(knobs) | layout.knobs, draw)


def _offer_step(design: adsk.fusion.Design, error: TooLargeError, layout_file: Path) -> None:
    """Ask whether to import the STEP instead; if not, the command ends with the reason."""
    if not events.ask(f"{error}\n\nImport the STEP now?"):
        raise error
    step = choose_step(str(layout_file.parent))
    if step is None:
        raise error
    import_step(design, step)
