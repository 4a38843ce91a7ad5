"""The host programs that the tests of add-ins run, and how."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EXERCISED: list[str] = []
"""Hosts that were really run, for the end of the test run to say so."""

LIMIT = 900
"""Seconds that a host may take for a script."""


def find_freecad(program: str = "freecadcmd") -> str:
    """The program, or a skip that says what is missing."""
    for name in (program, program.replace("freecad", "FreeCAD").replace("cmd", "Cmd")):
        if shutil.which(name):
            return name
    pytest.skip(f"{program} is not installed (Debian: apt-get install freecad)")


def freecad_home(folder: Path) -> dict[str, str]:
    """An environment in which FreeCAD finds the add-in of this project, and the add-in this Python."""
    from michell_cad.plugins import install_plugin

    home = folder / "home"
    install_plugin("freecad", home / ".local" / "share" / "FreeCAD" / "Mod")
    python = folder / "python"  # FreeCAD's add-in hides PYTHONPATH from the worker, so the wrapper sets it
    python.write_text(f'#!/bin/sh\nPYTHONPATH="{ROOT}" exec "{sys.executable}" "$@"\n')
    python.chmod(0o755)
    kept = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "VIRTUAL_ENV", "XDG_DATA_HOME")}
    return kept | {"HOME": str(home), "MICHELL_CAD_PYTHON": str(python), "QTWEBENGINE_DISABLE_SANDBOX": "1"}


def run_freecad(script: Path, environment: dict[str, str], **values: str) -> subprocess.CompletedProcess[str]:
    """Run a script in FreeCAD without a window."""
    program = find_freecad()
    done = subprocess.run(
        [program, str(script)],
        env=environment | values,
        capture_output=True,
        text=True,
        timeout=LIMIT,
        check=False,
        stdin=subprocess.DEVNULL,
    )
    told = next((line for line in done.stdout.splitlines() if line.startswith("FreeCAD ")), "FreeCAD")
    if told not in EXERCISED:
        EXERCISED.append(told)
    return done
