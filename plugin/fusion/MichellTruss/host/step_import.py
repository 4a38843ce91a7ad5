"""Import the STEP that michell_cad writes beside the layout: the whole model, united, with fillets."""

from pathlib import Path

import adsk.core
import adsk.fusion

from ..logic.layout import LayoutError
from . import events

STEP_FILE = "truss.step"
"""Name under which michell-cad writes the STEP."""


def choose_file(title: str, kinds: str, folder: str = "") -> Path | None:
    """Ask for a file; None if the designer changes their mind."""
    dialog = events.application().userInterface.createFileDialog()
    dialog.title = title
    dialog.filter = kinds
    dialog.isMultiSelectEnabled = False
    if folder:
        dialog.initialDirectory = folder
    return Path(dialog.filename) if dialog.showOpen() == adsk.core.DialogResults.DialogOK else None


def choose_step(folder: str = "") -> Path | None:
    """The STEP in a folder if it is there, or else one that the designer chooses."""
    beside = Path(folder) / STEP_FILE
    if folder and beside.is_file():
        return beside
    return choose_file("STEP file of the truss", "STEP files (*.step;*.stp)", folder)


def import_step(design: adsk.fusion.Design, path: Path) -> None:
    """Import a STEP file as components of the design's root.

    Raises
    ------
    LayoutError
        If the file is not there or Fusion cannot read it.
    """
    if not path.is_file():
        raise LayoutError(f"{path.name} is not there any more. Write it with michell-cad and try again.")
    manager = events.application().importManager
    if not manager.importToTarget(manager.createSTEPImportOptions(str(path)), design.rootComponent):
        raise LayoutError(f"Fusion could not import {path.name}. Write it again with michell-cad.")
