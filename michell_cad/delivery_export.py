"""From a design file to the files of its solid, in the formats that their names mean."""

from collections.abc import Callable, Sequence
from pathlib import Path

from michell_cad.building import Progress, build_united, size_finished
from michell_cad.cad import BuiltSolid, ExportOptions, export_solid, forecast_step, format_of
from michell_cad.design_file import open_structure
from michell_cad.errors import InvalidInputError
from michell_cad.files import writing_files


def export_design(
    design_file: str | Path,
    files: Sequence[Path],
    options: ExportOptions,
    force: bool = False,
    progress: Progress = lambda stage, fraction: None,
    tell: Callable[[str], None] = lambda text: None,
) -> BuiltSolid:
    """Build the solid of a design file and write it to files, in the formats that their names mean; all or none.

    Raises
    ------
    InvalidInputError
        For a bad design file; for a name without a format or given twice; for a file that exists, unless `force`.
    GeometryKernelError
        If no valid solid comes out.
    """
    formats = [format_of(file) for file in files]
    for file in files:
        if file.exists() and not (force and file.is_file()):
            what = "is a folder" if file.is_dir() else "exists; name a new file, or add --force to replace it"
            raise InvalidInputError(f"{file} {what}")
    if len(set(files)) != len(files):
        raise InvalidInputError("the same file is named twice")
    path = Path(design_file)
    with writing_files(files) as partials:
        structure = open_structure(path)
        solid = build_united(structure, size_finished(structure), progress)
        for k, (name, file, partial) in enumerate(zip(formats, files, partials, strict=True)):
            if name == "step":
                size = forecast_step(solid, options.step_form, options.pcurves)
                tell(f"{file} will take about {size / 1e6:.3g} MB")
            export_solid(solid, partial, options)
            progress("export", (k + 1) / len(files))
    return solid
