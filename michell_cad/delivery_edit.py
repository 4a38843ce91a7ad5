"""From a design file, knobs and edits to a folder of results: nothing upstream is computed again."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from michell_cad.arrays import require
from michell_cad.building import Progress
from michell_cad.delivery import require_place, write_results
from michell_cad.design_file import DESIGN_FILE, load_saved
from michell_cad.edits import Attach, EditScript, change_knobs, read_script
from michell_cad.files import writing_folder
from michell_cad.output_section import OutputSection


def deliver_edit(
    design_file: str | Path,
    folder: str | Path,
    changes: Mapping[str, Any] | None = None,
    script: str | Path | None = None,
    undo: int = 0,
    output: OutputSection | None = None,
    force: bool = False,
    progress: Progress = lambda stage, fraction: None,
) -> dict[str, Any]:
    """Edit a design and write its results to `folder`, in the manner of `deliver_job`; returns the report.

    The design file stays as it is; the new one in `folder` holds the same design with the new knobs and edits.

    Parameters
    ----------
    design_file : the file, or the folder that `design` or `edit` wrote.
    folder : for the results.
    changes : of the knobs.
    script : edits to make after those that the design has, and knobs; `changes` go before these.
    undo : how many of the design's last edits to leave out.
    output : which of the larger files are wanted; default: all.
    force : whether to write into a folder that exists.
    progress : called with the name of a stage and the finished fraction of it.

    Raises
    ------
    InvalidInputError
        For a bad design file, knob, script or folder.
    GeometryKernelError
        If no valid solid comes out.
    """
    path, folder = Path(design_file), Path(folder)
    path = path / DESIGN_FILE if path.is_dir() else path
    require(
        (folder / DESIGN_FILE).resolve() != path.resolve(),
        f"--out {folder} is the folder of the design itself, which stays as it is; name another folder",
    )
    added = EditScript() if script is None else read_script(script)
    saved = load_saved(path)
    knobs = change_knobs(saved.knobs, added.knobs, f"{script}: [knobs]")
    knobs = change_knobs(knobs, changes or {})
    edits = saved.edits.undone(undo).then(*added.edits.edits)
    require_place(folder, force)
    structure = saved.replay(knobs, edits)
    for edit in structure.of_kind(Attach):
        # Now, not after the solid has been built.
        require(Path(edit.part).is_file(), f"edit 'attach': there is no file {edit.part}; expected a CAD part")
    with writing_folder(folder) as partial:
        return write_results(partial, structure, edits, output or OutputSection(), saved.up, [], progress)
