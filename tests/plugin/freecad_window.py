"""Runs inside FreeCAD with a window: chooses the workbench, picks faces, computes, turns a knob, takes a picture."""

import json
import os
import subprocess
import time
import traceback
from pathlib import Path

import FreeCAD as App
import FreeCADGui as Gui
import Part
from PySide import QtCore

FOLDER = Path(os.environ["WALK_FOLDER"])
found: dict = {}


def leave(code: int) -> None:
    """Write what was found and end FreeCAD."""
    from michell_workbench import session

    (FOLDER / "window.json").write_text(json.dumps(found))
    session.close()
    os._exit(code)


def guarded(step):
    """A step that ends FreeCAD with its traceback if it fails: a window swallows exceptions."""

    def run() -> None:
        done = False
        try:
            step()
            done = True
        finally:
            if not done:
                found["error"] = traceback.format_exc()
                leave(1)

    return run


@guarded
def begin() -> None:
    """Up to the button that computes."""
    from michell_workbench import panel as panels

    global panel
    Gui.activateWorkbench("MichellWorkbench")
    found["commands"] = [name for name in Gui.listCommands() if name.startswith("Michell_")]
    document = App.newDocument("Window")
    body = document.addObject("Part::Feature", "Bar")
    body.Shape = Part.makeBox(80, 40, 40)
    document.recompute()
    told: list[str] = []
    panels.tell = told.append
    panel = panels.open_panel(None)
    panel.compute()
    pick(panel._guarded(panel.add_support))
    pick(panel.add_support, "Face1")
    panel.vector[2].setValue(-500.0)
    pick(panel.add_load, "Face2")
    panel.resolution.setValue(4.0)
    panel.mesh_size.setValue(10.0)
    found["told"] = told
    found["lists"] = [panel.supports.item(0).text(), panel.loads.item(0).text()]
    found["materials"] = panel.material.count()
    found["computing"] = 0
    panel.compute()
    QtCore.QTimer.singleShot(100, cancel)


def pick(act, *names: str) -> None:
    """Select faces, press a button, select nothing."""
    for name in names:
        Gui.Selection.addSelection("Window", "Bar", name)
    act()
    Gui.Selection.clearSelection()


@guarded
def cancel() -> None:
    """Cancel the first run, then run again."""
    if panel._computation is not None:
        found["computing"] += 1
        panel.cancel()
        QtCore.QTimer.singleShot(200, cancel)
        return
    found["cancelled"] = [panel.note.text(), [obj.Name for obj in App.ActiveDocument.Objects]]
    panel.compute()
    QtCore.QTimer.singleShot(200, finish)


@guarded
def finish() -> None:
    """When it is computed: turn a knob, look."""
    if panel._computation is not None:
        QtCore.QTimer.singleShot(200, finish)
        return
    found["note"] = panel.note.text()
    truss = panel.truss
    panel.reject()
    truss.Entasis = 0.4
    App.ActiveDocument.recompute()
    Gui.Selection.addSelection(truss)
    Gui.activeDocument().activeView().viewIsometric()
    Gui.SendMsgToActiveView("ViewFit")
    for _ in range(20):
        Gui.updateGui()
        time.sleep(0.05)
    found["colours"] = len(set(truss.ViewObject.DiffuseColor))
    found["painted"] = len(truss.ViewObject.DiffuseColor) == len(truss.Shape.Faces)
    found["knobs"] = json.loads(truss.Built)
    found["body_shown"] = bool(truss.Body.ViewObject.Visibility)
    subprocess.run(["import", "-window", "root", str(FOLDER / "window.png")], check=True)
    found["german"] = in_german(truss)
    leave(0)


def in_german(truss) -> dict:
    """The form of the truss, and what the object is, after a change of the language."""
    from michell_workbench import messages
    from michell_workbench import panel as panels

    Gui.setLocale("German")
    form = panels.open_panel(truss)
    return {
        "buttons": [form.compute_button.text(), form.cancel_button.text(), form.job_button.text()],
        "title": form.form.windowTitle(),
        "body": form.body_label.text(),
        "message": messages.cancelled(),
    }


QtCore.QTimer.singleShot(1000, begin)
