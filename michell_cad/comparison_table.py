"""What `michell-cad compare` shows: the truss of a job beside its rivals, in a table without a winner."""

from collections.abc import Callable
from pathlib import Path

from rich.console import Console
from rich.table import Table

from michell_cad.building import Progress
from michell_cad.delivery import design_options
from michell_cad.domain import read_part
from michell_cad.job import build_problem, read_job
from michell_cad.knobs import apply_knobs
from michell_cad.metrics import rms_shear
from michell_cad.pipeline import design
from michell_cad.strength import build_beam_model, strengthen
from michell_cad.strength.braces import SHEAR_LIMIT
from michell_cad.strength.comparison import Candidate, Row, compare_trusses, standard_rivals, union_volume

COLUMNS = ("", "members", "yield", "m.buckle", "f.buckle", "off axis", "f.u Nmm", "mass g", "pins")
"""Factors of the loads at first yield, at which a member and the frame buckle, at first yield of tilted loads; the
compliance; the mass; the share of the loads that pins could not carry. Short, to fit a terminal of 80 columns."""


def show_comparison(job_file: str | Path, sizes: tuple[int, ...], progress: Progress) -> Callable[[Console], None]:
    """Design the truss of a job and measure it and its rivals; returns what prints the table.

    Raises
    ------
    InvalidInputError
        For a bad job, or a ground structure too large for memory.
    ConvergenceError
        If a stage fails.
    """
    job = read_job(job_file)
    problem = build_problem(job, read_part(job.part.file, job.part.units, job.mesh.size))
    result = design(problem, design_options(job), progress)
    progress("rivals", 0.0)
    options = job.sizing.options
    sized, _, notes = strengthen(
        problem, result.stress_field, result.parametrization, apply_knobs(result.truss, job.knobs), options
    )
    name = "this truss" + ("" if options.size_by is None else ", sized")
    rivals = standard_rivals(problem, options, sizes)
    progress("rivals", 0.5)
    volume = union_volume(sized)
    rows = compare_trusses(problem, [Candidate(name, sized), *rivals], volume, options.off_axis_degrees)
    progress("rivals", 1.0)
    shear = rms_shear(problem.mesh, result.stress_field.stress, result.parametrization.tangents)
    single = volume / build_beam_model(sized, problem.material, straight=False).volume

    def show(console: Console) -> None:
        table = Table(box=None, header_style="bold", pad_edge=False)
        for k, column in enumerate(COLUMNS):
            table.add_column(column, justify="left" if k == 0 else "right", no_wrap=True)
        for row in rows:
            table.add_row(*_cells(row))
        console.print(table)
        console.print(
            "yield, m.buckle, f.buckle: factors of the loads at first yield, at which a member and the whole frame "
            "buckle; f.u: compliance; pins: share of the loads that pin joints could not carry"
        )
        console.print(
            f"all: union volume {rows[0].volume_fraction:.1%} of the part (of this truss members overlap by "
            f"{1 - single:.1%}), the same loads and held regions; factors are of the given loads, off axis: the worst "
            f"of {options.off_axis_degrees:g} degrees to four sides"
        )
        warning = "; above it braces are likely to pay" if shear > SHEAR_LIMIT else ""
        console.print(f"rms frame shear of this truss {shear:.2f} (limit {SHEAR_LIMIT:g}{warning})")
        for note in notes:
            console.print(f"[yellow]note[/]: {note}")

    return show


def _cells(row: Row) -> list[str]:
    def factor(value: float | None) -> str:
        return "-" if value is None else f"{value:.3g}"

    return [
        row.name,
        str(row.members),
        factor(row.yield_factor),
        factor(row.member_buckling),
        factor(row.frame_buckling),
        factor(row.off_axis_yield),
        f"{row.compliance:.4g}",
        f"{row.mass_g:.4g}",
        f"{row.pin_joint_residual:.2f}",
    ]
