"""Event handlers that Fusion calls, and how the add-in speaks to the designer.

Fusion keeps no reference to a handler, so this module does. Every call from Fusion passes `_guarded`, the one place
that turns errors into dialogs: a `LayoutError` is a text for the designer, anything else is a fault of the add-in.
"""

import traceback
from collections.abc import Callable
from typing import TypeVar

import adsk.core
import adsk.fusion

from ..logic.layout import LayoutError

TITLE = "Michell Truss"

_alive: list[list[adsk.core.EventHandler]] = [[]]
"""The handlers of the add-in itself, and then those of each open command."""

Args = TypeVar("Args", bound=adsk.core.EventArgs)


class _OnCommandCreated(adsk.core.CommandCreatedEventHandler):
    def __init__(self, act: Callable[[adsk.core.CommandCreatedEventArgs], None]) -> None:
        super().__init__()
        self._act = act

    def notify(self, eventArgs: adsk.core.CommandCreatedEventArgs) -> None:
        _keep_while_open(eventArgs.command)
        _guarded(self._act, eventArgs)


class _OnCommand(adsk.core.CommandEventHandler):
    def __init__(self, act: Callable[[adsk.core.CommandEventArgs], None]) -> None:
        super().__init__()
        self._act = act

    def notify(self, eventArgs: adsk.core.CommandEventArgs) -> None:
        _guarded(self._act, eventArgs)


class _OnValidate(adsk.core.ValidateInputsEventHandler):
    def __init__(self, act: Callable[[adsk.core.ValidateInputsEventArgs], None]) -> None:
        super().__init__()
        self._act = act

    def notify(self, eventArgs: adsk.core.ValidateInputsEventArgs) -> None:
        _guarded(self._act, eventArgs)


class _OnCompute(adsk.fusion.CustomFeatureEventHandler):
    def __init__(self, act: Callable[[adsk.fusion.CustomFeatureEventArgs], None]) -> None:
        super().__init__()
        self._act = act

    def notify(self, eventArgs: adsk.fusion.CustomFeatureEventArgs) -> None:
        _guarded(self._act, eventArgs)


def on_created(
    definition: adsk.core.CommandDefinition, act: Callable[[adsk.core.CommandCreatedEventArgs], None]
) -> None:
    """Call `act` when the command's dialog is made."""
    handler = _OnCommandCreated(act)
    definition.commandCreated.add(handler)
    _alive[0].append(handler)


def on_command(event: adsk.core.CommandEvent, act: Callable[[adsk.core.CommandEventArgs], None]) -> None:
    """Call `act` at an event of the newest command: execute, executePreview, destroy."""
    handler = _OnCommand(act)
    event.add(handler)
    _alive[-1].append(handler)


def on_validate(event: adsk.core.ValidateInputsEvent, act: Callable[[adsk.core.ValidateInputsEventArgs], None]) -> None:
    """Call `act` when Fusion asks whether the inputs of a dialog are valid."""
    handler = _OnValidate(act)
    event.add(handler)
    _alive[-1].append(handler)


def on_compute(
    definition: adsk.fusion.CustomFeatureDefinition, act: Callable[[adsk.fusion.CustomFeatureEventArgs], None]
) -> None:
    """Call `act` when a custom feature is computed again."""
    handler = _OnCompute(act)
    definition.customFeatureCompute.add(handler)
    _alive[0].append(handler)


def forget() -> None:
    """Let go of all handlers."""
    _alive[:] = [[]]


def application() -> adsk.core.Application:
    """Fusion."""
    return adsk.core.Application.get()


def active_design() -> adsk.fusion.Design:
    """The open design.

    Raises
    ------
    LayoutError
        If no design is open, or it keeps no history, without which there are no parameters.
    """
    design = adsk.fusion.Design.cast(application().activeProduct)
    if not design:
        raise LayoutError("No design is open. Open or create a design in the Design workspace and try again.")
    if design.designType != adsk.fusion.DesignTypes.ParametricDesignType:
        raise LayoutError(
            "This design keeps no history, so it has no parameters. Right-click its root in the browser, choose "
            "'Capture Design History', and try again."
        )
    return design


def tell(text: str) -> None:
    """Show a text."""
    application().userInterface.messageBox(
        text,
        TITLE,
        adsk.core.MessageBoxButtonTypes.OKButtonType,
        adsk.core.MessageBoxIconTypes.WarningIconType,
    )


def ask(text: str) -> bool:
    """Ask a question that is answered by yes or no."""
    answer = application().userInterface.messageBox(
        text,
        TITLE,
        adsk.core.MessageBoxButtonTypes.YesNoButtonType,
        adsk.core.MessageBoxIconTypes.QuestionIconType,
    )
    return answer == adsk.core.DialogResults.DialogYes


def show_fault() -> None:
    """Show the error being handled as a fault of the add-in, and write all of it to Fusion's log."""
    report = traceback.format_exc()
    application().log(report, adsk.core.LogLevels.ErrorLogLevel, adsk.core.LogTypes.ConsoleLogType)
    tell(f"Something went wrong in the add-in. Please report this:\n\n{report.strip().splitlines()[-1]}")


def _keep_while_open(command: adsk.core.Command) -> None:
    """Keep the handlers that are connected from now on until the command ends: they hold its layout."""
    own: list[adsk.core.EventHandler] = []
    _alive.append(own)

    def release(_: adsk.core.CommandEventArgs) -> None:
        _alive[:] = [handlers for handlers in _alive if handlers is not own]

    on_command(command.destroy, release)


def _guarded(act: Callable[[Args], None], args: Args) -> None:
    try:
        act(args)
    except LayoutError as error:
        if not _undone(args, str(error)):
            tell(str(error))
    except Exception:  # noqa: BLE001 the border to the host: whatever goes wrong is shown, not lost
        _undone(args, "The add-in failed, and the command was undone.")
        show_fault()


def _undone(args: adsk.core.EventArgs, text: str) -> bool:
    """Have Fusion undo a command and show why; False if the event is none of a command, so nothing can be undone."""
    command = adsk.core.CommandEventArgs.cast(args)
    if not command:
        return False
    command.executeFailed = True
    command.executeFailedMessage = text
    return True
