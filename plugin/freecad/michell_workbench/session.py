"""The one worker of this FreeCAD, and the preference that says which Python runs it."""

import atexit
import os

import FreeCAD as App

from michell_workbench.client import Worker
from michell_workbench.interpreter import find_python, worker_command

PREFERENCES = "User parameter:BaseApp/Preferences/Mod/MichellCAD"

_workers: dict[str, Worker] = {}


def worker() -> Worker:
    """The worker of the Python that the preferences name; it starts when it is first asked."""
    python = find_python(App.ParamGet(PREFERENCES).GetString("Python", ""), os.environ)
    if python not in _workers:
        close()
        _workers[python] = Worker(worker_command(python))
    return _workers[python]


def close() -> None:
    """End the worker, if there is one."""
    for old in _workers.values():
        old.close()
    _workers.clear()


atexit.register(close)
