"""All file formats of the solid by their names, and which one a file name means."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from michell_cad.arrays import require
from michell_cad.cad.beam_lattice import export_beam_lattice
from michell_cad.cad.brep import export_brep
from michell_cad.cad.built import BuiltSolid
from michell_cad.cad.glb import export_glb
from michell_cad.cad.step import FORMS, SCHEMAS, export_step
from michell_cad.cad.stl import export_stl
from michell_cad.cad.threemf import export_3mf
from michell_cad.errors import InvalidInputError

FormatName = Literal["step", "stl", "3mf", "3mf-beams", "glb", "brep"]
FORMATS: tuple[FormatName, ...] = get_args(FormatName)

SUFFIXES: Mapping[FormatName, tuple[str, ...]] = {
    "3mf-beams": (".beams.3mf",),
    "step": (".step", ".stp"),
    "stl": (".stl",),
    "3mf": (".3mf",),
    "glb": (".glb",),
    "brep": (".brep", ".brp"),
}
"""How file names of each format end; the first ending of several is the one that is written. Longer ones go first."""


@dataclass(frozen=True)
class ExportOptions:
    """What formats leave to choose: see `export_step` and `export_brep`."""

    step_form: str | None = None
    step_schema: str = "AP214"
    pcurves: bool = False
    brep_binary: bool = False

    def __post_init__(self) -> None:
        known = self.step_form is None or self.step_form in FORMS
        require(known, f"step_form must be one of {', '.join(FORMS)}, found {self.step_form!r}")
        known = ", ".join(SCHEMAS)
        require(self.step_schema in SCHEMAS, f"step_schema must be one of {known}, found {self.step_schema!r}")


def file_name(stem: str, name: FormatName) -> str:
    """The file name of a format."""
    return stem + SUFFIXES[name][0]


def format_of(path: str | Path) -> FormatName:
    """The format that a file name means.

    Raises
    ------
    InvalidInputError
        If there is none.
    """
    path = Path(path)
    for name, suffixes in SUFFIXES.items():
        if path.name.lower().endswith(suffixes):
            return name
    known = ", ".join(suffix for suffixes in SUFFIXES.values() for suffix in suffixes)
    raise InvalidInputError(f"{path}: no format has the extension {path.suffix or '(none)'}; known are {known}")


def export_solid(
    solid: BuiltSolid,
    path: str | Path,
    options: ExportOptions | None = None,
    progress: Callable[[float], None] | None = None,
) -> None:
    """Write the solid in the format that the file name means.

    Raises
    ------
    InvalidInputError
        For an unknown extension, and what the format's own function refuses.
    """
    o, name = options or ExportOptions(), format_of(path)
    if name == "step":
        export_step(solid, path, o.step_form, o.step_schema, o.pcurves, progress)
    elif name == "brep":
        export_brep(solid, path, o.brep_binary, progress)
    else:
        plain = {"stl": export_stl, "3mf": export_3mf, "3mf-beams": export_beam_lattice, "glb": export_glb}
        plain[name](solid, path, progress)
