"""Runs as CQ-editor: renders a script, takes a picture, turns a knob, and names a design file that is not there."""

import json
import os
import subprocess
import sys
import traceback
from pathlib import Path

sys.path.insert(0, os.environ["PLUGIN_FOLDER"])
from PyQt5.QtCore import Qt, QTimer
from start import app, open_window

FOLDER = Path(os.environ["WALK_FOLDER"])
HIDDEN = ("console", "log", "traceback_viewer", "cq_object_inspector", "variables_viewer")
"""Panes that would take the room of the picture."""

found: dict = {}


def leave(code: int) -> None:
    """Write what was found and end."""
    (FOLDER / "cq_editor.json").write_text(json.dumps(found))
    sys.stdout.flush()
    os._exit(code)


def guarded(step):
    """A step that ends the program with its traceback if it fails."""

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


def render(old: str = "", new: str = "") -> dict:
    """Change the script in the editor and run it: what the traceback pane says, and the objects of the tree."""
    editor, tree = window.components["editor"], window.components["object_tree"].CQ
    editor.set_text(editor.get_text_with_eol().replace(old, new))
    window.components["debugger"].render()
    objects = [tree.child(k) for k in range(tree.childCount())]
    return {
        "said": window.components["traceback_viewer"].current_exception.text(),
        "objects": [item.text(0) for item in objects],
        "volume": sum(item.shape.toCompound().Volume() for item in objects if item.shape is not None),
    }


@guarded
def show() -> None:
    """Render and look from a corner."""
    found["shown"] = render()
    viewer = window.components["viewer"]
    viewer.iso_view()
    viewer.fit()
    QTimer.singleShot(1000, take_picture)


@guarded
def take_picture() -> None:
    """Take the picture; then run the script again, with another knob and with another file."""
    subprocess.run(["import", "-window", "root", str(FOLDER / "cq_editor.png")], check=True)
    found["turned"] = render("fillet_ratio = 0.4", "fillet_ratio = 0.2")
    found["missing"] = render("design.npz", "missing.npz")
    leave(0)


window = open_window(sys.argv[1])
window.resize(1400, 900)
for name in HIDDEN:
    if name in window.docks:
        window.docks[name].hide()
window.resizeDocks([window.docks["editor"]], [560], Qt.Horizontal)
QTimer.singleShot(500, show)
app.exec_()
