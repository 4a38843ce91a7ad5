"""The buttons of the toolbar and the entries of the menu."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import FreeCAD as App
import FreeCADGui as Gui
from PySide import QtGui

from michell_workbench import messages, trusses
from michell_workbench.bodies import FacesGone
from michell_workbench.client import WorkerError
from michell_workbench.places import icon
from michell_workbench.texts import translate


class Command:
    """One of them.

    Parameters
    ----------
    name : of the icon.
    text, tip : what the designer reads.
    act : what it does.
    """

    def __init__(self, name: str, text: str, tip: str, act: Callable[[], None]) -> None:
        self._resources = {"Pixmap": icon(name), "MenuText": text, "ToolTip": tip}
        self._act = act

    def GetResources(self) -> dict[str, str]:
        """What FreeCAD shows."""
        return self._resources

    def IsActive(self) -> bool:
        """All commands need a document."""
        return App.ActiveDocument is not None

    def Activated(self) -> None:
        """Do it; what goes wrong becomes a dialog."""
        try:
            self._act()
        except (WorkerError, FacesGone, ValueError, OSError) as error:
            tell(str(error))


def add_commands() -> list[str]:
    """Register all commands; returns their names."""
    commands = {
        "Michell_New": Command(
            "truss",
            translate("MichellCAD", "New truss..."),
            translate("MichellCAD", "Pick supports and loads on a body and compute its stress-aligned truss"),
            new_truss,
        ),
        "Michell_Edit": Command(
            "edit",
            translate("MichellCAD", "Supports and loads..."),
            translate("MichellCAD", "Change what the selected truss was computed from, and compute it again"),
            edit_truss,
        ),
        "Michell_Export": Command(
            "export",
            translate("MichellCAD", "Export truss..."),
            translate("MichellCAD", "Write the selected truss as STEP (named, coloured faces) or STL (watertight)"),
            export_truss,
        ),
        "Michell_SaveJob": Command(
            "job",
            translate("MichellCAD", "Save job file..."),
            translate("MichellCAD", "Write the job of the selected truss for the command line: michell-cad design"),
            save_truss_job,
        ),
    }
    for name, command in commands.items():
        Gui.addCommand(name, command)
    return list(commands)


def tell(text: str) -> None:
    """A dialog with one message."""
    QtGui.QMessageBox.warning(Gui.getMainWindow(), translate("MichellCAD", "Michell truss"), text)


def new_truss() -> None:
    """Open an empty form."""
    from michell_workbench.panel import open_panel

    open_panel(None)


def edit_truss() -> None:
    """Open the form of the selected truss."""
    from michell_workbench.panel import open_panel

    open_panel(_selected())


def export_truss() -> None:
    """Ask for a file and write the selected truss."""
    truss = _selected()
    path = ask_file(translate("MichellCAD", "Export truss"), truss.Name + ".step", "STEP (*.step *.stp);;STL (*.stl)")
    if path:
        trusses.export(truss, path)


def save_truss_job() -> None:
    """Ask for a file and write the job of the selected truss."""
    truss = _selected()
    path = ask_file(translate("MichellCAD", "Save job file"), truss.Name + ".toml", "TOML (*.toml)")
    if path:
        trusses.save_job(truss, path)


def ask_file(title: str, name: str, kinds: str) -> str:
    """A path from the designer, beside the document if it has been saved; empty if there is none."""
    beside = Path(App.ActiveDocument.FileName).parent if App.ActiveDocument.FileName else Path.home()
    path, _ = QtGui.QFileDialog.getSaveFileName(Gui.getMainWindow(), title, str(beside / name), kinds)
    return path


def _selected() -> Any:
    for obj in Gui.Selection.getSelection():
        if trusses.is_truss(obj):
            return obj
    raise ValueError(messages.not_a_truss())
