"""The commands of the add-in, one folder each."""

from .draw_truss import entry as draw_truss
from .edit_parameters import entry as edit_parameters
from .import_step import entry as import_step
from .set_material import entry as set_material

_COMMANDS = (draw_truss, edit_parameters, set_material, import_step)


def start() -> None:
    """Put all commands into the toolbar."""
    for command in _COMMANDS:
        command.start()


def stop() -> None:
    """Take all commands away."""
    for command in _COMMANDS:
        command.stop()
