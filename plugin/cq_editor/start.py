"""Start CQ-editor with the settings that trusses need: `python start.py [SCRIPT]`.

* Modules stay loaded between two runs of a script. CQ-editor unloads them, and NumPy refuses to be loaded again.
* Curved faces are shown with fewer triangles. With CQ-editor's own settings a truss takes minutes.

CQ-editor remembers settings when it is closed; they are under Edit > Preferences, Debugger and 3D Viewer.
"""

import sys

from cq_editor.__main__ import MainWindow, app

DEVIATION, ANGLE = 1e-3, 0.4
"""Of the triangles: relative to the size of a shape, and between neighbours, radians; CQ-editor has 1e-5 and 0.1."""


def open_window(script: str | None) -> MainWindow:
    """The window of CQ-editor with a script in its editor."""
    window = MainWindow(filename=script)
    window.components["debugger"].preferences["Reload imported modules"] = False
    viewer = window.components["viewer"].preferences
    viewer["Deviation"], viewer["Angular deviation"] = DEVIATION, ANGLE
    window.show()
    return window


if __name__ == "__main__":
    window = open_window(sys.argv[1] if len(sys.argv) > 1 else None)
    sys.exit(app.exec_())
