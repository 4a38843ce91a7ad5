"""From a job file to a folder of results: the main job, stage by stage, whole or not at all."""

import json
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from michell_cad.building import Progress, build_united, size_finished
from michell_cad.cad import (
    BuiltSolid,
    KeptSolid,
    SweptReport,
    coloured_triangles,
    export_solid,
    file_name,
    forecast_step,
    keep_material,
)
from michell_cad.design_file import DESIGN_FILE, save_design
from michell_cad.domain import Outline, Part, mesh_outline, read_outline
from michell_cad.edits import (
    NO_EDITS,
    Attach,
    EditList,
    Structure,
    attachment_frames,
    build_sheets,
    tagged_members,
    write_script,
)
from michell_cad.errors import InvalidInputError
from michell_cad.files import writing_folder
from michell_cad.job import Setup, build_problem, read_job, require_faces
from michell_cad.knobs import Knobs
from michell_cad.output_section import OutputSection
from michell_cad.palette import group_colour
from michell_cad.parametrization import ParametrizationOptions
from michell_cad.picture import ShownMesh, render_truss
from michell_cad.pipeline import GOOD_CELLS_PER_EDGE, Design, DesignOptions, StageTime, design
from michell_cad.report import report_design
from michell_cad.splines import fit_splines
from michell_cad.stage_cache import StageCache
from michell_cad.strength import strength_block, strengthen_block
from michell_cad.tet_mesh import TetMesh
from michell_cad.truss import SizedTruss
from michell_cad.truss_json import write_truss_json

SOLID_STEM = "truss"
"""Files of the solid have this name and the extension of their format."""

LAYOUT_FILE, PICTURE_FILE, REPORT_FILE = "truss.json", "preview.png", "report.json"
EDITS_FILE, SHEETS_FILE, ATTACHMENTS_FILE = "edits.toml", "sheets.step", "attachments.step"
SHEET_COLOUR, ATTACHMENT_COLOUR = (0.5, 0.7, 0.5), (0.93, 0.78, 0.2)


def deliver_job(
    job_file: str | Path,
    folder: str | Path,
    force: bool = False,
    progress: Progress = lambda stage, fraction: None,
    cache: StageCache | None = None,
) -> dict[str, Any]:
    """Run a job and write its results to `folder`; returns the report.

    Nothing appears in `folder` before everything is done. An existing folder is refused unless `force`; then the new
    files replace those of the same name, and others stay. Stages whose result is in `cache` (default: that of the user)
    are not run again.

    Raises
    ------
    InvalidInputError
        For a bad job, part or folder.
    ConvergenceError, GeometryKernelError
        If a stage fails.
    """
    folder = Path(folder)
    job, cache = read_job(job_file), cache or StageCache.usual()
    require_place(folder, force)
    times: list[StageTime] = []
    outline = read_outline(job.part.file, job.part.units)
    structure = design_outline(outline, job, progress, cache, times)
    with writing_folder(folder) as partial:
        report = write_results(partial, structure, NO_EDITS, job.output, outline.up, times, progress)
    return report


def design_structure(job_file: str | Path, progress: Progress = lambda stage, fraction: None) -> tuple[Structure, int]:
    """Design the truss of a job without building it; for hosts. Returns it with the axis that points up in pictures.

    Errors as for `deliver_job`.
    """
    job = read_job(job_file)
    outline = read_outline(job.part.file, job.part.units)
    return design_outline(outline, job, progress), outline.up


def design_outline(
    outline: Outline,
    setup: Setup,
    progress: Progress = lambda stage, fraction: None,
    cache: StageCache | None = None,
    times: list[StageTime] | None = None,
) -> Structure:
    """Mesh a part and design its truss, as a job says that may come from anywhere.

    Parameters
    ----------
    outline : the part.
    setup : the job.
    progress : called with the name of a stage and the finished fraction of it.
    cache : see `deliver_job`.
    times : of the stages; theirs are added.

    Raises
    ------
    InvalidInputError, ConvergenceError, GeometryKernelError
        As `deliver_job`.
    """
    cache, times = cache or StageCache.usual(), [] if times is None else times
    require_faces(setup, outline)
    kept = kept_materials(setup, outline)
    with _timed("mesh", times, progress):
        part = _mesh_part(outline, setup, cache)
    result = design(build_problem(setup, part), design_options(setup), progress, cache)
    times.extend(result.times)
    return replace(NO_EDITS.replay(result, setup.knobs), kept=kept, sizing=setup.sizing.options)


def _mesh_part(outline: Outline, setup: Setup, cache: StageCache) -> Part:
    """Fill a part with tets, which is a stage like others."""
    inputs = (outline.surface, outline.mesh, setup.mesh.size)
    return Part(outline, cache.keep("mesh", TetMesh, inputs, lambda: mesh_outline(outline, setup.mesh.size).mesh))


def design_job(job_file: str | Path, options: DesignOptions | None = None, cache: StageCache | None = None) -> Design:
    """Design the truss of a job without building it; for scripts.

    Parameters
    ----------
    job_file : the job; its knobs and outputs play no part.
    options : instead of those of the job.
    cache : see `deliver_job`.
    """
    job, cache = read_job(job_file), cache or StageCache.usual()
    part = _mesh_part(read_outline(job.part.file, job.part.units), job, cache)
    return design(build_problem(job, part), options or design_options(job), cache=cache)


def design_options(job: Setup) -> DesignOptions:
    """The options of the stages that a job states."""
    return DesignOptions(
        resolution=job.options.resolution,
        spacing=job.options.spacing,
        layers=job.options.layers,
        parametrization=ParametrizationOptions(
            spacing_weight=job.options.spacing_weight,
            follow_stress=job.options.follow_stress,
            spacing_bounds=job.options.spacing_bounds,
        ),
    )


def kept_materials(job: Setup, part: Outline | Part) -> tuple[KeptSolid, ...]:
    """What the `[[keep]]` tables of a job keep of its part.

    Raises
    ------
    InvalidInputError, GeometryKernelError
        As `keep_material`; the message begins with "keep" and the number of the table.
    """
    return tuple(
        keep_material(part, keep, keep.depth, keep.clearance or keep.depth, f"keep {number}")
        for number, keep in enumerate(job.keep, 1)
    )


def write_results(
    folder: Path,
    structure: Structure,
    edits: EditList,
    output: OutputSection,
    up: int,
    times: list[StageTime],
    progress: Progress,
) -> dict[str, Any]:
    """Build a structure and write all files; returns the report.

    Parameters
    ----------
    folder : where to write.
    structure : what to build.
    edits : what made it of its design, to be saved with it.
    output : which of the larger files are wanted.
    up : axis that points up in pictures.
    times : of the stages that were run so far.
    progress : called with the name of a stage and the finished fraction of it.
    """
    result, mesh = structure.design, structure.whole_mesh
    with _timed("sizing", times, progress):
        sizing = size_finished(structure)
    with _timed("solid", times, progress):
        solid = build_united(structure, sizing, progress)
    built, knobs = solid.sized, sizing.knobs
    with _timed("export", times, progress):
        splines = fit_splines(built.truss)
        files = [file_name(SOLID_STEM, name) for name in output.formats]
        for k, file in enumerate(files):
            export_solid(solid, folder / file, output.options)
            progress("export", 0.8 * (k + 1) / len(files))
        write_truss_json(folder / LAYOUT_FILE, built, splines, knobs)
        save_design(folder / DESIGN_FILE, result, structure.knobs, edits, up, structure.kept, structure.sizing)
        if len(edits):
            write_script(folder / EDITS_FILE, edits, structure.knobs.model_dump(mode="json", exclude_none=True))
        extras, shown = _write_extras(folder, structure, built)
        if output.preview:
            swept = _show_swept(solid) if knobs.swept else ()
            render_truss(folder / PICTURE_FILE, mesh, built, splines, up=up, solids=swept, others=shown)
    with _timed("strength", times, progress):
        strength, strength_notes = _measure_strength(structure, solid)
    report = report_design(result, built.truss, times)
    report["solid"] = report_solid(solid)
    report["files"] = {file: {"bytes": (folder / file).stat().st_size} for file in files}
    if "step" in output.formats:
        step = report["files"][file_name(SOLID_STEM, "step")]
        step["forecast_bytes"] = forecast_step(solid, output.step_form, output.pcurves)
    report["summary"] |= _material_summary(structure, solid)
    report["sizing"], report["strength"] = strengthen_block(sizing.report), strength
    report["knobs"] = knobs.model_dump(mode="json")
    report["edits"] = edits.plain()
    report |= extras
    report["notes"] = [*_notes(report, knobs), *sizing.notes, *strength_notes, *solid.report.messages]
    (folder / REPORT_FILE).write_text(json.dumps(report, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    return report


def _show_swept(solid: BuiltSolid) -> list[ShownMesh]:
    """The united mesh by families, and the nodes."""
    return [
        ShownMesh(name, group_colour(name), solid.mesh.vertices, triangles)
        for name, triangles in coloured_triangles(solid).items()
    ]


def _measure_strength(structure: Structure, solid: BuiltSolid) -> tuple[dict[str, Any] | None, list[str]]:
    if structure.joined:
        return None, ["the strength of joined trusses is not computed: the loads are known of one part only"]
    design = structure.design
    part = design.problem, design.stress_field, design.parametrization
    # Beams are round: for other profiles of that area this is their strength but for bending and buckling.
    return strength_block(*part, solid.sized, solid.report.volume_mm3, solid.node_balls)


def _write_extras(folder: Path, structure: Structure, built: SizedTruss) -> tuple[dict[str, Any], list[ShownMesh]]:
    """Write what edits add to the truss (sheets, attachments).

    Returns the report's blocks about it, and about tags; and what of it a picture shows.
    """
    report: dict[str, Any] = {}
    plates = build_sheets(structure)
    shown = [ShownMesh("sheets", SHEET_COLOUR, plate.vertices, plate.triangles) for plate in plates]
    tags = tagged_members(structure, built.truss)
    if tags:
        report["tags"] = {name: np.flatnonzero(mine).tolist() for name, mine in tags.items()}
    attachments = structure.of_kind(Attach)
    if plates or attachments:
        from michell_cad.cad.plates import export_shapes, mesh_copies, place_copies, solid_of_plate
    if plates:
        export_shapes([solid_of_plate(plate) for plate in plates], folder / SHEETS_FILE)
        report["sheets"] = [{"volume_mm3": plate.volume, "triangles": len(plate.triangles)} for plate in plates]
    if attachments:
        frames = [attachment_frames(structure, edit, built.truss) for edit in attachments]
        copies = [place_copies(edit.part, f) for edit, f in zip(attachments, frames, strict=True)]
        export_shapes(copies, folder / ATTACHMENTS_FILE)
        meshes = [mesh_copies(edit.part, f) for edit, f in zip(attachments, frames, strict=True)]
        shown += [ShownMesh("attachments", ATTACHMENT_COLOUR, *mesh) for mesh in meshes]
        report["attachments"] = [
            {"part": edit.part, "copies": len(f.origins)} for edit, f in zip(attachments, frames, strict=True)
        ]
    return report, shown


def report_solid(solid: BuiltSolid) -> dict[str, Any]:
    """The `solid` block of the report."""
    r = solid.report
    if isinstance(r, SweptReport):
        return {name: value for name, value in asdict(r).items() if name != "messages"} | {"step_forms": ["assembly"]}
    return {
        "valid": r.valid,
        "solids": r.solids,
        "volume_mm3": r.volume_mm3,
        "mesh_volume_mm3": r.mesh_volume_mm3,
        "faces": r.faces,
        "genus": r.genus,
        "expected_genus": r.expected_genus,
        "filleted_nodes": r.filleted_nodes,
        "nodes": r.nodes,
        "members": r.members,
        "creased_nodes": r.creased_nodes,
        "fallback_nodes": dict(r.fallback_nodes),
        "crossings": r.crossings,
        "curve_deviation_mm": r.curve_deviation_mm,
        "members_off_curve": r.members_off_curve,
        "design_gap_mm": r.design_gap_mm,
        "kept": None if r.kept is None else asdict(r.kept),
    }


def _material_summary(structure: Structure, solid: BuiltSolid) -> dict[str, float]:
    volume = solid.report.volume_mm3
    return {
        "volume_fraction": volume / float(structure.whole_mesh.volumes.sum()),
        "mass_g": volume * structure.design.problem.material.density,
    }


def _notes(report: dict[str, Any], knobs: Knobs) -> list[str]:
    notes = []
    ratio = report["mesh"]["cells_per_tet_edge"]
    if ratio > GOOD_CELLS_PER_EDGE:
        size = report["truss"]["spacing_mm"]
        notes.append(
            f"the truss is finer than the mesh ({ratio:.1f} cells on a tet edge): members are straight within a tet; "
            f"mesh.size = {size:.3g} mm or finer would resolve them"
        )
    cleaning = report["truss"]["cleaning"]
    if cleaning["loose_pieces"]:
        notes.append(
            f"{cleaning['loose_pieces']} loose pieces of {cleaning['loose_members']} members in all were left out: "
            "nothing touches them, neither the rest of the truss nor a support or load"
        )
    if knobs.families != ("tension", "compression", "third") or knobs.every != 1:
        notes.append("the knobs keep some of the curves only; the report's truss block is about those")
    if knobs.swept:
        notes.append(
            "members of this profile have no common CAD solid: STEP and BREP have a solid for each curve and node, "
            "STL, 3MF and GLB the united mesh; strength is that of round members of the same area"
        )
    return notes


def require_place(folder: Path, force: bool) -> None:
    if folder.exists() and not folder.is_dir():
        raise InvalidInputError(f"--out {folder} is a file; name a folder")
    if folder.exists() and not force:
        raise InvalidInputError(f"--out {folder} exists; name a new folder, or add --force to write into it")
    parent = folder.absolute()
    while not parent.exists():
        parent = parent.parent
    if not parent.is_dir() or not os.access(parent, os.W_OK | os.X_OK):
        raise InvalidInputError(f"--out {folder} cannot be written: no permission in {parent}; name another folder")


@contextmanager
def _timed(name: str, times: list[StageTime], progress: Progress) -> Iterator[None]:
    wall, cpu = time.perf_counter(), _cpu_seconds()
    progress(name, 0.0)
    yield
    progress(name, 1.0)
    times.append(StageTime(name, time.perf_counter() - wall, _cpu_seconds() - cpu))


def _cpu_seconds() -> float:
    """CPU time of this process and of its children: the mesher runs in one."""
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system
