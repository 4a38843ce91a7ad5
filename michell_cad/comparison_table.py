"""What `michell-cad compare` shows: the truss of a job beside its rivals, in a table without a winner."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from michell_cad.building import Progress
from michell_cad.cad import resolve_radius
from michell_cad.cad.stl import write_stl
from michell_cad.delivery import design_options
from michell_cad.domain import read_part
from michell_cad.files import writing_folder
from michell_cad.job import build_problem, read_job
from michell_cad.knobs import apply_knobs
from michell_cad.metrics import rms_shear
from michell_cad.pipeline import design
from michell_cad.strength import build_beam_model, strengthen
from michell_cad.strength.braces import SHEAR_LIMIT
from michell_cad.strength.comparison import (
    Candidate,
    Row,
    VoxelDesign,
    VoxelOptions,
    compare_trusses,
    optimise_voxels,
    require_voxels,
    standard_rivals,
    union_volume,
    voxel_rows,
    voxel_surface,
)

COLUMNS = ("", "members", "yield", "m.buckle", "f.buckle", "tilted", "f.u Nmm", "mass g", "pins")
"""Factors of the loads at first yield, at which a member and the frame buckle, at first yield of tilted loads; the
compliance; the mass; the share of the loads that pins could not carry. Short, to fit a terminal of 80 columns."""

TABLE_FILE, SURFACE_FILE, DENSITY_FILE = "comparison.json", "voxels.stl", "voxels.npz"

FULL = 0.5
"""Voxels of more than this density are in the STL file."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """The truss of a job, in the first row, beside its rivals.

    Parameters
    ----------
    rows : see `Row`.
    voxels : densities behind the last three rows, if they were wanted.
    overlap : of the members' volumes in this truss, the share that is counted twice.
    shear : rms frame shear of this truss.
    off_axis_degrees : tilt of the loads that are off axis.
    notes : what a user should know.
    """

    rows: tuple[Row, ...]
    voxels: VoxelDesign | None
    overlap: float
    shear: float
    off_axis_degrees: float
    notes: tuple[str, ...]


def compare_job(job_file: str | Path, sizes: tuple[int, ...], voxels: int, progress: Progress) -> Comparison:
    """Design the truss of a job and measure it and its rivals.

    Parameters
    ----------
    job_file : the job.
    sizes : cells of the grids along the longest side of the part.
    voxels : in the part, about; 0: none.
    progress : called with the name of a stage and the finished fraction of it.

    Raises
    ------
    InvalidInputError
        For a bad job, voxels too large for memory, or too few of them for the part.
    ConvergenceError
        If a stage fails.
    """
    job = read_job(job_file)
    problem = build_problem(job, read_part(job.part.file, job.part.units, job.mesh.size))
    if voxels:
        require_voxels(problem, voxels)
    result = design(problem, design_options(job), progress)
    progress("rivals", 0.0)
    options, truss = job.sizing.options, result.truss
    part = float(problem.mesh.volumes.sum())
    knobs = resolve_radius(
        job.knobs, lambda knobs: apply_knobs(truss, knobs), truss.spacing, part, problem.material.density
    )
    sized, _, notes = strengthen(
        problem, result.stress_field, result.parametrization, apply_knobs(truss, knobs), options
    )
    name = "this truss" + ("" if options.size_by is None else ", sized")
    spacing = truss.spacing * float(np.mean(knobs.every))
    rivals, missing = standard_rivals(problem, options, sizes, spacing)
    progress("rivals", 0.5)
    volume = union_volume(sized)
    rows = compare_trusses(problem, [Candidate(name, sized), *rivals], volume, options.off_axis_degrees)
    progress("rivals", 1.0)
    densities = None
    if voxels:
        progress("voxels", 0.0)
        densities = optimise_voxels(problem, volume, VoxelOptions(voxels), lambda f: progress("voxels", f))
        rows += voxel_rows(problem, densities, volume)
    single = volume / build_beam_model(sized, problem.material, straight=False).volume
    shear = rms_shear(problem.mesh, result.stress_field.stress, result.parametrization.tangents)
    return Comparison(tuple(rows), densities, 1 - single, shear, options.off_axis_degrees, (*notes, *missing))


def print_comparison(comparison: Comparison, console: Console) -> None:
    """Print the table and what its columns mean."""
    table = Table(box=None, header_style="bold", pad_edge=False, collapse_padding=True)
    for k, column in enumerate(COLUMNS):
        table.add_column(column, justify="left" if k == 0 else "right", no_wrap=True)
    for row in comparison.rows:
        table.add_row(*_cells(row))
    console.print(table)
    console.print(
        "yield, m.buckle, f.buckle: factors of the loads at first yield, at which a member and the whole frame "
        "buckle; f.u: compliance; pins: share of the loads that pin joints could not carry"
    )
    console.print(
        "braced, zigzag: a diagonal in every cell face, parallel or in turns; hexes: cells that conform to the faces "
        "of the part and ignore its stress"
    )
    console.print(
        f"all: union volume {comparison.rows[0].volume_fraction:.1%} of the part (of this truss members overlap by "
        f"{comparison.overlap:.1%}), the same loads and held regions; factors are of the given loads, tilted: the "
        f"worst of {comparison.off_axis_degrees:g} degrees to four sides; members are bare beams, before "
        "building: without the balls of their nodes"
    )
    if comparison.voxels is not None:
        found = comparison.voxels
        console.print(
            f"voxels: {len(found.density):,} of {found.model.edges.max():.3g} mm, for the given loads only; bound: no "
            "structure of this volume has a smaller f.u, but for what voxels do to the faces of the part and trusses "
            "to its loads, which they take at nodes; p = 1: densities from empty to full; p = 3: nearly empty or full "
            f"ones, a local optimum (grey share {found.grey:.2f})"
        )
    warning = "; above it braces are likely to pay" if comparison.shear > SHEAR_LIMIT else ""
    console.print(f"rms frame shear of this truss {comparison.shear:.2f} (limit {SHEAR_LIMIT:g}{warning})")
    for note in comparison.notes:
        console.print(f"[yellow]note[/]: {note}")


def write_comparison(comparison: Comparison, folder: str | Path) -> None:
    """Write the figures, and the densities of the voxels and the surface of those that are full, to a folder.

    Raises
    ------
    InvalidInputError
        If the folder cannot be written.
    """
    with writing_folder(Path(folder)) as partial:
        figures = {"rows": [asdict(row) for row in comparison.rows], "notes": comparison.notes}
        text = json.dumps(figures, indent=1, allow_nan=False) + "\n"
        (partial / TABLE_FILE).write_text(text, encoding="utf-8")
        if comparison.voxels is not None:
            found, model = comparison.voxels, comparison.voxels.model
            write_stl(partial / SURFACE_FILE, model.nodes[voxel_surface(model, found.density > FULL)])
            np.savez(
                partial / DENSITY_FILE,
                centres=model.centres,
                edges=model.edges,
                density=found.density,
                sheet_density=found.sheet_density,
            )


def _cells(row: Row) -> list[str]:
    def figure(value: float | None, form: str = ".3g") -> str:
        return "-" if value is None else format(value, form)

    return [
        row.name,
        figure(row.members, "d"),
        figure(row.yield_factor),
        figure(row.member_buckling),
        figure(row.frame_buckling),
        figure(row.off_axis_yield),
        f"{row.compliance:.4g}",
        f"{row.mass_g:.4g}",
        figure(row.pin_joint_residual, ".2f"),
    ]
