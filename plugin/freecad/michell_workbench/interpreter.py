"""Which Python runs the worker: that of michell_cad, as FreeCAD's own has neither our packages nor our versions."""

import json
import os
import shutil
from collections.abc import Mapping
from pathlib import Path

from michell_workbench.places import HOME

VARIABLE = "MICHELL_CAD_PYTHON"
"""Environment variable that names the Python; for scripts."""

RECORD = HOME / "installed.json"
"""Written by `michell-cad plugin install freecad`: the Python that it ran in."""

HOST_VARIABLES = ("PYTHONHOME", "PYTHONPATH", "PYTHONSTARTUP", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH", "QT_PLUGIN_PATH")
"""What packaged FreeCADs set for their own Python and libraries, and what another Python must not see."""


def find_python(preference: str, environment: Mapping[str, str], record: Path = RECORD) -> str:
    """The first that is named: preference, environment variable, record of the installation, python3 of the path."""
    named = preference.strip() or environment.get(VARIABLE, "").strip()
    if named:
        return str(Path(named).expanduser())
    try:
        return str(json.loads(record.read_text(encoding="utf-8"))["python"])
    except (OSError, ValueError, KeyError):
        path = environment.get("PATH")
        return shutil.which("python3", path=path) or shutil.which("python", path=path) or "python3"


def worker_command(python: str) -> list[str]:
    """How to start the worker."""
    return [python, "-m", "michell_cad.worker"]


def worker_environment(environment: Mapping[str, str] | None = None) -> dict[str, str]:
    """The environment without what concerns FreeCAD's own Python."""
    given = os.environ if environment is None else environment
    return {name: value for name, value in given.items() if name not in HOST_VARIABLES}
