"""The add-in's panel in the Solid tab, and the buttons in it."""

from collections.abc import Callable
from pathlib import Path

import adsk.core

from ..logic.layout import LayoutError
from . import events

WORKSPACE, TAB = "FusionSolidEnvironment", "SolidTab"
PANEL = "MichellTrussPanel"


def add_button(
    command: str, name: str, tooltip: str, entry_file: str, created: Callable[[adsk.core.CommandCreatedEventArgs], None]
) -> None:
    """Define a command with the icons beside its entry file and put its button into the panel."""
    ui = events.application().userInterface
    remove_button(command)
    panels = _panels()
    icons = str(Path(entry_file).parent / "resources")
    definition = ui.commandDefinitions.addButtonDefinition(command, name, tooltip, icons)
    events.on_created(definition, created)
    panel = panels.itemById(PANEL) or panels.add(PANEL, events.TITLE, "", False)
    control = panel.controls.addCommand(definition, "", False)
    control.isPromoted = True


def remove_button(command: str) -> None:
    """Take a command and its button away, and the panel with its last button."""
    ui = events.application().userInterface
    panel = _panels().itemById(PANEL)
    if panel:
        control = panel.controls.itemById(command)
        if control:
            control.deleteMe()
        if not panel.controls.count:
            panel.deleteMe()
    definition = ui.commandDefinitions.itemById(command)
    if definition:
        definition.deleteMe()


def _panels() -> adsk.core.ToolbarPanels:
    """The panels of the Solid tab."""
    workspace = events.application().userInterface.workspaces.itemById(WORKSPACE)
    tab = workspace.toolbarTabs.itemById(TAB) if workspace else None
    if not tab:
        raise LayoutError("Fusion's Solid tab was not found: start the add-in from the Design workspace.")
    return tab.toolbarPanels
