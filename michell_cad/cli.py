"""The command line: `michell-cad design | edit | knobs | faces | check | schema | plugin`.

Only typer is imported here; CAD and solvers load inside the commands that need them, so that help comes at once.
"""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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
    """Design the truss of a job: STEP, STL, layout, design file, picture and report."""
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
def schema() -> None:
    """Print the JSON Schema of the job file."""
    from michell_cad.cli_inspect import show_schema

    show_schema(_console())


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


def _print_summary(console: "Console", report: dict[str, Any], out: Path) -> None:
    from rich.table import Table

    truss, solid, alignment, summary = (report[key] for key in ("truss", "solid", "alignment", "summary"))
    families = ", ".join(f"{count} {name}" for name, count in truss["curves_per_family"].items())
    fallback = ", ".join(f"{count} {kind}" for kind, count in solid["fallback_nodes"].items()) or "none"
    rows = [
        ("truss", f"{truss['members']} members, {truss['nodes']} nodes; curves: {families}"),
        ("cell edge", f"{truss['spacing_mm']:.3g} mm, shortest member {truss['shortest_member_mm']:.3g} mm"),
        (
            "follows the stress",
            f"shear residual {alignment['curve_shear_residual']:.2f}, uncarried stress "
            f"{alignment['uncarried_stress']:.2f} (0 is exact)",
        ),
        (
            "solid",
            f"{solid['solids']} valid solid{'s' * (solid['solids'] != 1)}, {solid['faces']} faces, "
            f"{solid['filleted_nodes']} nodes with fillets; fallbacks: {fallback}",
        ),
        (
            "material",
            f"{solid['volume_mm3']:.4g} mm3, {100 * summary['volume_fraction']:.1f} % of the part, "
            f"{summary['mass_g']:.4g} g",
        ),
        ("written to", str(out)),
    ]
    table = Table(show_header=False, box=None, pad_edge=False)
    for name, text in rows:
        table.add_row(f"[bold]{name}", text)
    console.print(table)
    for note in report["notes"]:
        console.print(f"[yellow]note[/]: {note}")


if __name__ == "__main__":
    main()
