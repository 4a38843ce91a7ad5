"""Where a profile comes from: the knob `profile` may name a file, whose outline takes its place when it is read."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

PROFILE_SUFFIXES = (".dxf", ".svg", ".step", ".stp", ".brep", ".brp")


def with_profile_file(knobs: Mapping[str, Any], folder: str | Path = ".") -> dict[str, Any]:
    """Plain values of knobs, with the outline in place of a file that `profile` names, relative to a folder.

    Raises
    ------
    InvalidInputError
        See `cad.profile_files.read_profile`.
    """
    values = dict(knobs)
    name = values.get("profile")
    if isinstance(name, str) and name.lower().endswith(PROFILE_SUFFIXES):
        from michell_cad.cad.profile_files import read_profile

        values["profile"] = read_profile(Path(folder) / name)
    return values
