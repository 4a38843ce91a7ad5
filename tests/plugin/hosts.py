"""The host programs that the tests of add-ins run, and how."""

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
HOSTS = ("FreeCAD without a window", "FreeCAD with a window", "CQ-editor", "build123d", "CadQuery", "Fusion (a fake)")
"""Whose tests there are; Fusion itself runs nowhere here, a recording fake stands for it."""

EXERCISED: dict[str, str] = {}
"""Hosts that were really run, with their versions, for the end of the test run to say so."""

LIMIT = 900
"""Seconds that a host may take for a script."""


def exercised(host: str, version: str = "") -> None:
    """Note that a host was really run."""
    assert host in HOSTS, host
    EXERCISED[host] = version


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


def need_screen() -> None:
    """Skip, saying what is missing, where no screen can be made and photographed."""
    for tool, package in (("xvfb-run", "xvfb"), ("import", "imagemagick")):
        if shutil.which(tool) is None:
            pytest.skip(f"{tool} is not installed (Debian: apt-get install {package})")


def run_on_screen(
    command: Sequence[str], environment: Mapping[str, str], limit: float = LIMIT
) -> subprocess.CompletedProcess[str]:
    """Run a program with a window, on a screen that nobody sees (Xvfb)."""
    screen = ["xvfb-run", "-a", "-s", "-screen 0 1400x900x24"]
    return subprocess.run(
        [*screen, *command], env=environment, capture_output=True, text=True, timeout=limit, check=False
    )


def alike(picture: np.ndarray, colour: Sequence[float]) -> int:
    """How many pixels (n, 3) have the hue of a colour: a lit surface has it at another brightness."""
    wanted, length = np.array(colour) / np.linalg.norm(colour), np.linalg.norm(picture, axis=1)
    return int(((picture @ wanted > 0.995 * length) & (length > 60)).sum())


def run_freecad(script: Path, environment: dict[str, str], **values: str) -> subprocess.CompletedProcess[str]:
    """Run a script in FreeCAD without a window."""
    program = find_freecad()
    shared = {"PYTHONPATH": str(script.parent)}  # steps that scripts share; the worker does not see it
    done = subprocess.run(
        [program, str(script)],
        env=environment | shared | values,
        capture_output=True,
        text=True,
        timeout=LIMIT,
        check=False,
        stdin=subprocess.DEVNULL,
    )
    told = next((line for line in done.stdout.splitlines() if line.startswith("FreeCAD ")), "FreeCAD")
    exercised("FreeCAD without a window", told)
    return done
