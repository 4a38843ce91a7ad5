"""Import Truss STEP: the whole model as michell_cad united it, with its fillets, as one import."""

import adsk.core

from ...host import events, toolbar
from ...host.step_import import choose_step, import_step

COMMAND = "MichellTrussStep"


def start() -> None:
    """Add the button."""
    toolbar.add_button(
        COMMAND, "Import Truss STEP", "Import the united model that michell_cad exported.", __file__, _created
    )


def stop() -> None:
    """Take the button away."""
    toolbar.remove_button(COMMAND)


def _created(args: adsk.core.CommandCreatedEventArgs) -> None:
    events.on_command(args.command.execute, _execute)


def _execute(_: adsk.core.CommandEventArgs) -> None:
    design = events.active_design()
    path = choose_step()
    if path is not None:
        import_step(design, path)
