"""From a job file to a folder of results: the main job, stage by stage, whole or not at all."""

import json
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from michell_cad.cad import TrussSolid, build_solid, export_step, export_stl
from michell_cad.cad.prepare import prepare_truss
from michell_cad.design_file import save_design
from michell_cad.domain import read_part
from michell_cad.errors import InvalidInputError
from michell_cad.job import Job, build_problem, read_job
from michell_cad.knobs import Knobs, apply_knobs
from michell_cad.parametrization import ParametrizationOptions
from michell_cad.picture import render_truss
from michell_cad.pipeline import GOOD_CELLS_PER_EDGE, Design, DesignOptions, StageTime, design
from michell_cad.problem import DesignProblem
from michell_cad.report import report_design
from michell_cad.splines import fit_splines
from michell_cad.strength import StrengthenReport, strength_block, strengthen, strengthen_block
from michell_cad.truss import SizedTruss
from michell_cad.truss_json import write_truss_json

Progress = Callable[[str, float], None]

STEP_FILE, STL_FILE, LAYOUT_FILE = "truss.step", "truss.stl", "truss.json"
DESIGN_FILE, PICTURE_FILE, REPORT_FILE = "design.npz", "preview.png", "report.json"


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
    with _whole_folder(folder) as partial:
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
    with _timed("sizing", times, progress):
        sized, sizing, sizing_notes = _size(result, job)
    with _timed("solid", times, progress):
        solid = build_solid(sized, job.knobs, progress=lambda fraction: progress("solid", fraction))
    built = solid.prepared.sized
    with _timed("export", times, progress):
        splines = fit_splines(built.truss)
        if job.output.step:
            export_step(solid, folder / STEP_FILE)
            progress("export", 0.6)
        if job.output.stl:
            export_stl(solid.mesh, folder / STL_FILE)
        write_truss_json(folder / LAYOUT_FILE, built, splines, job.knobs)
        save_design(folder / DESIGN_FILE, result, job.knobs)
        if job.output.preview:
            render_truss(folder / PICTURE_FILE, result.problem.mesh, built, splines, up=up)
    with _timed("strength", times, progress):
        strength, strength_notes = strength_block(
            result.problem, result.stress_field, result.parametrization, built, solid.report.volume_mm3
        )
    report = report_design(result, built.truss, times)
    step_bytes = (folder / STEP_FILE).stat().st_size if job.output.step else None
    report["solid"] = report_solid(solid) | {"step_bytes": step_bytes}
    report["summary"] |= _material_summary(result.problem, solid)
    report["sizing"], report["strength"] = strengthen_block(sizing), strength
    report["knobs"] = job.knobs.model_dump(mode="json")
    report["notes"] = _notes(report, job.knobs) + sizing_notes + strength_notes + list(solid.report.messages)
    (folder / REPORT_FILE).write_text(json.dumps(report, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    return report


def _size(result: Design, job: Job) -> tuple[SizedTruss, StrengthenReport | None, list[str]]:
    """Size the truss as the job wishes, and again as the solid changes it: thick members merge nodes and give way to
    each other, and forces go with them."""
    part = result.problem, result.stress_field, result.parametrization
    options = job.sizing.options
    sized, first, notes = strengthen(*part, apply_knobs(result.truss, job.knobs), options)
    if first is None:
        return sized, None, notes
    buildable = prepare_truss(sized, job.knobs).sized
    volume_fraction = first.volume_mm3 / float(result.problem.mesh.volumes.sum())
    again = replace(options, braces=False, volume_fraction=volume_fraction)
    sized, second, more = strengthen(*part, buildable, again)
    assert second is not None
    # Gains compare with equal members of the truss that the knobs chose.
    gain = first.failure_gain * second.failure_factor / first.failure_factor
    return sized, replace(second, options=options, failure_gain=gain), list(dict.fromkeys([*notes, *more]))


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
def _whole_folder(folder: Path) -> Iterator[Path]:
    """Yield an empty folder beside `folder`; move its files there when the block ends without an exception."""
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        partial = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    except OSError as error:
        raise InvalidInputError(f"--out {folder} cannot be written ({error.strerror}); name another folder") from error
    try:
        yield partial
        partial.chmod(0o755)
        if folder.exists():
            for file in sorted(partial.iterdir()):
                file.replace(folder / file.name)
        else:
            partial.replace(folder)
    finally:
        shutil.rmtree(partial, ignore_errors=True)


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
