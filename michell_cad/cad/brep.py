"""BREP files, the CAD kernel's own format: nothing is converted, so reading one is quick; it holds no names."""

from collections.abc import Callable
from pathlib import Path

from michell_cad.cad.solid import TrussSolid
from michell_cad.files import path_with_suffix, writing


def export_brep(
    solid: TrussSolid, path: str | Path, binary: bool = False, progress: Callable[[float], None] | None = None
) -> None:
    """Write the solids as BREP, in mm, as text or binary; the file is there whole or not at all.

    Raises
    ------
    InvalidInputError
        For another extension than .brep or .brp, and if the file cannot be written.
    """
    from michell_cad.cad import kernel_files

    with writing(path_with_suffix(path, ".brep", ".brp")) as partial:
        kernel_files.write_brep_file(partial, solid.solids, binary)
    if progress is not None:
        progress(1.0)
