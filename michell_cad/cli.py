"""The command line: `michell-cad design | edit | export | strength | compare | knobs | faces | check | schema ...`.

Only typer is imported here; CAD and solvers load inside the commands that need them, so that help comes at once.
"""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from michell_cad.errors import InvalidInputError, MichellError

if TYPE_CHECKING:
    from rich.console import Console

INTERRUPTED = "interrupted; nothing was written"

BAD_INPUT, FAILED = 2, 1
"""Exit codes: the input has to change; or the program could not do it, or was interrupted."""

app = typer.Typer(
    help="Stress-aligned trusses of any 3D part, as editable CAD solids.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


class PluginAction(StrEnum):
    """What to do with an add-in."""

    install = "install"
    remove = "remove"


class PluginHost(StrEnum):
    """The hosts that have an add-in, see `michell_cad.plugins`."""

    freecad = "freecad"
    fusion = "fusion"


JobFile = Annotated[Path, typer.Argument(metavar="JOB.toml", help="The job file; see `michell-cad schema`.")]
Force = Annotated[bool, typer.Option("--force", help="Write into the folder even if it exists.")]


@app.command()
def design(
    job: JobFile,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the results; must not exist yet.")],
    force: Force = False,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Compute all stages, also those kept from earlier runs.")
    ] = False,
) -> None:
    """Design the truss of a job: the solid's files, layout, design file, picture and report."""
    from michell_cad.delivery import deliver_job
    from michell_cad.stage_cache import StageCache

    console = _console()
    with _stage_bars(console) as progress:
        report = deliver_job(job, out, force, progress, StageCache() if fresh else None)
    _print_summary(console, report, out)


@app.command(
    context_settings={"allow_extra_args": True, "ignore_unknown_options": True},
    epilog="Every knob is an option, too: --radius 1.2 --family compression --entasis 0.4 --every 2; "
    "see `michell-cad knobs`.",
)
def edit(
    context: typer.Context,
    design: Annotated[Path, typer.Argument(metavar="DESIGN", help="design.npz, or the folder that holds it.")],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the results; must not exist yet.")],
    settings: Annotated[list[str] | None, typer.Option("--set", metavar="KNOB=VALUE", help="Turn a knob.")] = None,
    script: Annotated[Path | None, typer.Option(metavar="EDITS.toml", help="Edits and knobs, in a file.")] = None,
    undo: Annotated[int, typer.Option(min=0, help="Leave out this many of the design's last edits.")] = 0,
    force: Force = False,
) -> None:
    """Turn knobs of a finished design and edit it; nothing upstream is computed again."""
    from michell_cad.cli_edit import read_knob_options
    from michell_cad.delivery_edit import deliver_edit

    if str(design).startswith("-"):
        raise InvalidInputError(f"michell-cad edit: DESIGN comes first, before {design}")
    console = _console()
    changes = read_knob_options(context.args, settings or [])
    with _stage_bars(console) as progress:
        report = deliver_edit(design, out, changes, script, undo, force=force, progress=progress)
    _print_summary(console, report, out)


@app.command()
def knobs() -> None:
    """List the knobs with units, bounds, defaults and help texts."""
    from michell_cad.cli_edit import print_knobs

    print_knobs(_console())


@app.command()
def export(
    design_file: Annotated[Path, typer.Argument(metavar="DESIGN.npz", help="A design file of `michell-cad design`.")],
    files: Annotated[
        list[Path],
        typer.Argument(metavar="FILE...", help="What to write: .step .stl .3mf .beams.3mf .glb .brep"),
    ],
    step_form: Annotated[
        str | None,
        typer.Option(help="solid, or assembly: a solid per curve and per node; default: what there is."),
    ] = None,
    step_schema: Annotated[str, typer.Option(help="AP214 or AP242.")] = "AP214",
    pcurves: Annotated[bool, typer.Option("--pcurves", help="STEP with the edges in parameters of faces.")] = False,
    brep_binary: Annotated[bool, typer.Option("--brep-binary", help="BREP in binary, not as text.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace files that exist.")] = False,
) -> None:
    """Write the solid of a finished design to files, in the formats that their names mean."""
    from michell_cad.cad.formats import ExportOptions
    from michell_cad.delivery_export import export_design

    console = _console()
    options = ExportOptions(step_form, step_schema, pcurves, brep_binary)
    with _stage_bars(console) as progress:
        export_design(design_file, files, options, force, progress, console.print)
    for file in files:
        console.print(f"{file}: {_megabytes(file.stat().st_size)}")


@app.command()
def strength(
    design: Annotated[Path, typer.Argument(metavar="DESIGN", help="design.npz, or the folder that holds it.")],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the results; must not exist yet.")],
    solid: Annotated[bool, typer.Option("--solid", help="Check the solid by quadratic tets, too; minutes.")] = False,
    size: Annotated[float | None, typer.Option(metavar="MM", help="Size of the tets; default: from members.")] = None,
    force: Force = False,
) -> None:
    """Stresses of a finished design in a picture and figures, and decks for CalculiX and Abaqus."""
    from michell_cad.delivery_strength import deliver_strength

    console = _console()
    with _stage_bars(console) as progress:
        report = deliver_strength(design, out, solid, size, force, progress)
    _print_strength(console, report, out)


@app.command()
def compare(
    job: JobFile,
    cells: Annotated[str, typer.Option(help="Cells of the grids along the longest side of the part.")] = "4,6,8",
    voxels: Annotated[int, typer.Option(min=0, help="Voxels of the stiffness bound, about; 0: no bound.")] = 8000,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Folder for the figures and the voxels; default: none.")
    ] = None,
    force: Force = False,
) -> None:
    """Put the truss of a job beside grids, conforming cells, a ground structure and voxels of as much material."""
    from michell_cad.comparison_table import compare_job, print_comparison, write_comparison
    from michell_cad.delivery import require_place

    sizes = cells.split(",")
    if not all(size.strip().isdigit() and 1 <= int(size) <= 40 for size in sizes):
        raise InvalidInputError(f"--cells {cells}: expected whole numbers from 1 to 40 with commas, such as 4,6,8")
    console = _console()
    if out is not None:
        require_place(out, force)
    with _stage_bars(console) as progress:
        comparison = compare_job(job, tuple(int(size) for size in sizes), voxels, progress)
    print_comparison(comparison, console)
    if out is not None:
        write_comparison(comparison, out)
        console.print(f"results: {out}", markup=False, highlight=False)


@app.command()
def faces(
    part: Annotated[Path, typer.Argument(metavar="PART", help="A part: .step .brep .stl .obj .3mf ...")],
    units: Annotated[str | None, typer.Option(help="Unit of the part's coordinates: mm, cm, m or in.")] = None,
    out: Annotated[Path | None, typer.Option("--out", metavar="PNG", help="Where to write the picture.")] = None,
) -> None:
    """Number the faces of a part, with a selector that picks each, in a table and a picture."""
    from michell_cad.cli_inspect import show_faces

    show_faces(part, units, out, _console())


@app.command()
def check(
    job: JobFile,
    out: Annotated[Path | None, typer.Option("--out", metavar="PNG", help="Where to write the picture.")] = None,
) -> None:
    """Say what a job would fix, load and mesh, in a table and a picture, without computing."""
    from michell_cad.cli_inspect import check_job

    check_job(job, out, _console())


@app.command()
def schema(
    what: Annotated[
        Literal["job", "edits"], typer.Argument(metavar="[job|edits]", help="The job file, or an edit script.")
    ] = "job",
) -> None:
    """Print the JSON Schema of the job file, or of edit scripts."""
    from michell_cad.cli_inspect import show_schema

    show_schema(what, _console())


@app.command()
def plugin(
    action: Annotated[PluginAction, typer.Argument(help="What to do.", show_default=False)],
    host: Annotated[PluginHost, typer.Argument(help="The host program.", show_default=False)],
    into: Annotated[
        Path | None, typer.Option("--into", metavar="DIR", help="The host's folder of add-ins; default: the usual one.")
    ] = None,
) -> None:
    """Put an add-in where its host program looks for it, or take it away."""
    from michell_cad.plugins import install_plugin, remove_plugin

    if action is PluginAction.install:
        _console().print(f"installed {install_plugin(host.value, into)}; restart the host")
    else:
        _console().print(f"removed {remove_plugin(host.value, into)}")


def main() -> None:
    """Run the command line; every expected error becomes one message on standard error and an exit code."""
    interruptions = _count_interruptions()
    try:
        app(standalone_mode=False)
    except InvalidInputError as error:
        _fail(str(error), BAD_INPUT)
    except MichellError as error:
        _fail(str(error), FAILED)
    except MemoryError:
        _fail("out of memory; use a coarser mesh (mesh.size) or a smaller resolution", FAILED)
    except (Exception, KeyboardInterrupt) as error:
        if interruptions:
            _fail(INTERRUPTED, FAILED)
        # click's own messages (a missing argument, an unknown option) know how to show themselves
        show = getattr(error, "show", None)
        if show is None:
            raise
        show()
        sys.exit(getattr(error, "exit_code", BAD_INPUT))
    if interruptions:  # click may make a plain return of an interruption
        _fail(INTERRUPTED, FAILED)


def _count_interruptions() -> list[int]:
    """A list that grows with each Ctrl-C: libraries turn KeyboardInterrupt into errors of their own, so it is noted."""
    seen: list[int] = []

    def note(number: int, frame: object) -> None:
        seen.append(number)
        raise KeyboardInterrupt

    signal.signal(signal.SIGINT, note)
    return seen


def _fail(message: str, code: int) -> None:
    sys.stderr.write(f"michell-cad: {message}\n")
    sys.exit(code)


def _console() -> "Console":
    from rich.console import Console

    return Console(soft_wrap=True)


@contextmanager
def _stage_bars(console: "Console") -> Iterator[Callable[[str, float], None]]:
    """One bar per stage as it starts; a plain line per finished stage where there is no terminal."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    bars = Progress(
        TextColumn("{task.description:<16}"), BarColumn(), TimeElapsedColumn(), console=console, transient=False
    )
    tasks: dict[str, Any] = {}

    def progress(stage: str, fraction: float) -> None:
        if stage not in tasks:
            tasks[stage] = bars.add_task(stage, total=1.0)
        bars.update(tasks[stage], completed=fraction)

    with bars:
        yield progress


def _print_strength(console: "Console", report: dict[str, Any], out: Path) -> None:
    beams, solid = report["strength"], report["solid_check"]
    console.print(
        f"beams: peak {beams['peak_stress_mpa']:.4g} MPa on {beams['peak_stress']['curve']}, yields at "
        f"{beams['yield_factor']:.3g} of the loads; compliance {beams['compliance_nmm']:.4g} N mm",
        markup=False,
    )
    if solid is not None:
        console.print(
            f"solid: {solid['tets']:,} quadratic tets; peak {solid['peak_stress_mpa']:.4g} MPa, "
            f"{solid['solid_over_beam_peak']:.2f} of the beams'; yields at {solid['yield_factor']:.3g} of the loads; "
            f"compliance {solid['compliance_nmm']:.4g} N mm (beams over solid "
            f"{solid['beam_over_solid_compliance']:.3f})",
            markup=False,
        )
    for note in report["notes"]:
        console.print(f"note: {note}", markup=False)
    console.print(f"results: {out}", markup=False, highlight=False)


def _print_summary(console: "Console", report: dict[str, Any], out: Path) -> None:
    from rich.table import Table

    truss, solid, alignment, summary = (report[key] for key in ("truss", "solid", "alignment", "summary"))
    families = ", ".join(f"{count} {name}" for name, count in truss["curves_per_family"].items())
    rows = [
        ("truss", f"{truss['members']} members, {truss['nodes']} nodes; curves: {families}"),
        ("cell edge", f"{truss['spacing_mm']:.3g} mm, shortest member {truss['shortest_member_mm']:.3g} mm"),
        (
            "follows the stress",
            f"shear residual {alignment['curve_shear_residual']:.2f}, uncarried stress "
            f"{alignment['uncarried_stress']:.2f} (0 is exact)",
        ),
        ("solid", _solid_line(solid)),
        (
            "material",
            f"{solid['volume_mm3']:.4g} mm3, {100 * summary['volume_fraction']:.1f} % of the part, "
            f"{summary['mass_g']:.4g} g",
        ),
        ("strength", _strength_line(report["strength"])),
        ("files", ", ".join(_describe_file(name, entry) for name, entry in report["files"].items())),
        ("written to", str(out)),
    ]
    table = Table(show_header=False, box=None, pad_edge=False)
    for name, text in rows:
        table.add_row(f"[bold]{name}", text)
    console.print(table)
    for note in report["notes"]:
        console.print(f"[yellow]note[/]: {note}")


def _solid_line(solid: dict[str, Any]) -> str:
    if "profile" in solid:
        return (
            f"profile {solid['profile']}, aspect {solid['profile_aspect']:g}, nodes as {solid['node_form']}s: "
            f"{solid['parts']} valid solids for curves and nodes, their united mesh in {solid['solids']} piece"
            f"{'s' * (solid['solids'] != 1)} of genus {solid['genus']}"
        )
    fallback = ", ".join(f"{count} {kind}" for kind, count in solid["fallback_nodes"].items()) or "none"
    return (
        f"{solid['solids']} valid solid{'s' * (solid['solids'] != 1)}, {solid['faces']} faces, "
        f"{solid['filleted_nodes']} nodes with fillets; fallbacks: {fallback}"
    )


def _describe_file(name: str, entry: dict[str, int]) -> str:
    forecast = f" (forecast {_megabytes(entry['forecast_bytes'])})" if "forecast_bytes" in entry else ""
    return f"{name} {_megabytes(entry['bytes'])}{forecast}"


def _megabytes(size: int) -> str:
    return f"{size / 1e6:.3g} MB"


def _strength_line(strength: dict[str, Any] | None) -> str:
    if strength is None:
        return "not known, see the notes"
    force, moment = strength["first_yield_n"], strength["first_yield_nmm"]
    load = f"{force:.4g} N" if force is not None else f"{moment:.4g} N mm"
    factor = strength["buckling_factor"]
    buckling = "nothing buckles" if factor is None else f"a member buckles at {factor:.3g} x the loads"
    return (
        f"first yield at {load}, {strength['yield_factor']:.3g} x the loads; {buckling}\n"
        f"peak stress {strength['peak_stress_mpa']:.4g} MPa on {strength['peak_stress']['curve']}, largest "
        f"displacement {strength['displacement_mm']:.3g} mm\n"
        f"{100 * strength['mass_share']:.1f} % of the mass of the solid part, "
        f"{strength['compliance_over_solid']:.3g} x its compliance; pin-joint residual "
        f"{strength['pin_joint_residual']:.2f}, rms frame shear {strength['rms_frame_shear']:.2f}"
    )


if __name__ == "__main__":
    main()
