"""Put the add-ins that ship with this package where their hosts look for them, and take them away again."""

import json
import os
import shutil
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from michell_cad.errors import InvalidInputError

RECORD = "installed.json"
"""File in an installed add-in: which Python has michell_cad, and that the folder is ours to replace or remove."""

SOURCES = (Path(__file__).parent / "plugin", Path(__file__).parents[1] / "plugin")
"""Where the add-ins are: in the installed package, or beside the package in a checkout."""


@dataclass(frozen=True)
class HostProgram:
    """A program that takes add-ins.

    Parameters
    ----------
    title : for messages.
    source : the add-in's folder among `SOURCES`.
    folder : its name where the host looks.
    places : where the host looks, by platform (`sys.platform`); ``~`` and environment variables are replaced.
    """

    title: str
    source: str
    folder: str
    places: Mapping[str, str]


HOSTS = {
    "freecad": HostProgram(
        "FreeCAD",
        "freecad",
        "MichellCAD",
        {
            "linux": "$XDG_DATA_HOME/FreeCAD/Mod",
            "darwin": "~/Library/Application Support/FreeCAD/Mod",
            "win32": "$APPDATA/FreeCAD/Mod",
        },
    ),
    "fusion": HostProgram(
        "Fusion",
        "fusion/MichellTruss",
        "MichellTruss",
        {
            "darwin": "~/Library/Application Support/Autodesk/Autodesk Fusion 360/API/AddIns",
            "win32": "$APPDATA/Autodesk/Autodesk Fusion 360/API/AddIns",
        },
    ),
}


def install_plugin(host: str, into: Path | None = None) -> Path:
    """Copy an add-in to where its host looks, replacing an earlier copy; returns its folder.

    Parameters
    ----------
    host : one of `HOSTS`.
    into : the host's folder of add-ins; default: the usual one of this platform.

    Raises
    ------
    InvalidInputError
        If there is no usual folder on this platform, a folder of that name is not ours, or it cannot be written.
    """
    target = plugin_folder(host, into)
    source = _source(host)
    if target.exists() and not (target / RECORD).is_file():
        raise InvalidInputError(f"{target} is there and was not put there by michell-cad: move it away first")
    record = {"python": sys.executable, "michell_cad": _version()}
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        beside = Path(tempfile.mkdtemp(prefix=".michell-", dir=target.parent))
        try:
            copy = beside / target.name
            shutil.copytree(source, copy, ignore=shutil.ignore_patterns("__pycache__"))
            (copy / RECORD).write_text(json.dumps(record) + "\n", encoding="utf-8")
            if target.exists():
                target.rename(beside / "old")
            copy.rename(target)
        finally:
            shutil.rmtree(beside, ignore_errors=True)
    except OSError as error:
        raise InvalidInputError(
            f"{target} cannot be written ({error.strerror}); name another folder by --into"
        ) from error
    return target


def remove_plugin(host: str, into: Path | None = None) -> Path:
    """Remove an add-in that `install_plugin` has put there; returns the folder that is gone.

    Raises
    ------
    InvalidInputError
        If it is not there, or not ours.
    """
    target = plugin_folder(host, into)
    if not target.is_dir():
        raise InvalidInputError(f"{target}: no add-in is installed there")
    if not (target / RECORD).is_file():
        raise InvalidInputError(f"{target} was not put there by michell-cad: remove it yourself if it is not wanted")
    shutil.rmtree(target)
    return target


def plugin_folder(host: str, into: Path | None = None) -> Path:
    """Where the add-in of a host belongs.

    Raises
    ------
    InvalidInputError
        If nothing is known for this platform.
    """
    program = HOSTS[host]
    if into is not None:
        return into / program.folder
    place = program.places.get(sys.platform)
    if place is None:
        raise InvalidInputError(
            f"{program.title} does not run on this system ({sys.platform}); to copy the add-in all the same, name a "
            "folder by --into"
        )
    known = {"XDG_DATA_HOME": str(Path.home() / ".local" / "share")} | dict(os.environ)
    for name, value in known.items():
        place = place.replace(f"${name}/", f"{value}/")
    return Path(place).expanduser() / program.folder


def _source(host: str) -> Path:
    for folder in SOURCES:
        if (folder / HOSTS[host].source).is_dir():
            return folder / HOSTS[host].source
    raise InvalidInputError(f"this installation of michell_cad has no add-in for {HOSTS[host].title}; install it again")


def _version() -> str:
    try:
        return version("michell_cad")
    except PackageNotFoundError:  # run from its folder, not installed
        return "(not installed)"
