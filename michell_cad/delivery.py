"""From a job file to a folder of results: the main job, stage by stage, whole or not at all."""

import json
import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from michell_cad.cad import ExportOptions, TrussSolid, build_solid, export_solid, file_name, forecast_step, format_of
from michell_cad.design_file import load_design, save_design
from michell_cad.domain import read_part
from michell_cad.errors import InvalidInputError
from michell_cad.files import writing_files, writing_folder
from michell_cad.job import Job, build_problem, read_job
from michell_cad.knobs import Knobs, apply_knobs
from michell_cad.parametrization import ParametrizationOptions
from michell_cad.picture import render_truss
from michell_cad.pipeline import GOOD_CELLS_PER_EDGE, Design, DesignOptions, StageTime, design
from michell_cad.problem import DesignProblem
from michell_cad.report import report_design
from michell_cad.splines import fit_splines
from michell_cad.truss_json import write_truss_json

Progress = Callable[[str, float], None]

SOLID_STEM = "truss"
"""Files of the solid have this name and the extension of their format."""

LAYOUT_FILE, DESIGN_FILE, PICTURE_FILE, REPORT_FILE = "truss.json", "design.npz", "preview.png", "report.json"


def deliver_job(
    job_file: str | Path, folder: str | Path, force: bool = False, progress: Progress = lambda stage, fraction: None
) -> dict[str, Any]:
    """Run a job and write its results to `folder`; returns the report.

    Nothing appears in `folder` before everything is done. An existing folder is refused unless `force`; then the new
    files replace those of the same name, and others stay.

    Raises
    ------
    InvalidInputError
        For a bad job, part or folder.
    ConvergenceError, GeometryKernelError
        If a stage fails.
    """
    folder = Path(folder)
    job = read_job(job_file)
    _require_place(folder, force)
    times: list[StageTime] = []
    with _timed("mesh", times, progress):
        part = read_part(job.part.file, job.part.units, job.mesh.size)
        problem = build_problem(job, part)
    result = design(problem, design_options(job), progress)
    times.extend(result.times)
    with writing_folder(folder) as partial:
        report = _write_results(partial, result, job, part.outline.up, times, progress)
    return report


def design_options(job: Job) -> DesignOptions:
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


def _write_results(
    folder: Path, result: Design, job: Job, up: int, times: list[StageTime], progress: Progress
) -> dict[str, Any]:
    with _timed("solid", times, progress):
        sized = apply_knobs(result.truss, job.knobs)
        solid = build_solid(sized, job.knobs, progress=lambda fraction: progress("solid", fraction))
    built = solid.prepared.sized
    with _timed("export", times, progress):
        splines = fit_splines(built.truss)
        files = [file_name(SOLID_STEM, name) for name in job.output.formats]
        for k, file in enumerate(files):
            export_solid(solid, folder / file, job.output.options)
            progress("export", 0.8 * (k + 1) / len(files))
        write_truss_json(folder / LAYOUT_FILE, built, splines, job.knobs)
        save_design(folder / DESIGN_FILE, result, job.knobs)
        if job.output.preview:
            render_truss(folder / PICTURE_FILE, result.problem.mesh, built, splines, up=up)
    report = report_design(result, built.truss, times)
    report["solid"] = report_solid(solid)
    report["files"] = {file: {"bytes": (folder / file).stat().st_size} for file in files}
    if "step" in job.output.formats:
        step = report["files"][file_name(SOLID_STEM, "step")]
        step["forecast_bytes"] = forecast_step(solid, job.output.step_form, job.output.pcurves)
    report["summary"] |= _material_summary(result.problem, solid)
    report["knobs"] = job.knobs.model_dump(mode="json")
    report["notes"] = _notes(report, job.knobs) + list(solid.report.messages)
    (folder / REPORT_FILE).write_text(json.dumps(report, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    return report


def export_design(
    design_file: str | Path,
    files: Sequence[Path],
    options: ExportOptions,
    force: bool = False,
    progress: Progress = lambda stage, fraction: None,
    tell: Callable[[str], None] = lambda text: None,
) -> TrussSolid:
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
    with writing_files(files) as partials:
        result, knobs = load_design(design_file)
        solid = build_solid(apply_knobs(result.truss, knobs), knobs, progress=lambda part: progress("solid", part))
        for k, (name, file, partial) in enumerate(zip(formats, files, partials, strict=True)):
            if name == "step":
                size = forecast_step(solid, options.step_form, options.pcurves)
                tell(f"{file} will take about {size / 1e6:.3g} MB")
            export_solid(solid, partial, options)
            progress("export", (k + 1) / len(files))
    return solid


def report_solid(solid: TrussSolid) -> dict[str, Any]:
    """The `solid` block of the report."""
    r = solid.report
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
    }


def _material_summary(problem: DesignProblem, solid: TrussSolid) -> dict[str, float]:
    volume = solid.report.volume_mm3
    return {
        "volume_fraction": volume / float(problem.mesh.volumes.sum()),
        "mass_g": volume * problem.material.density,
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
    return notes


def _require_place(folder: Path, force: bool) -> None:
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
