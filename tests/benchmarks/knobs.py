"""What turning a knob of a finished design costs, in CPU time, and which stages upstream it calls (none).

    python tests/benchmarks/knobs.py DIR [NAME] [--radius 0.07] [--entasis 0.3]

DIR holds `problems.json` (a list with `name`, `file` and `rho`) and the `.npz` problems that it names; without NAME it
is `holey_pillar`, of about 5,000 members. The design is made and saved once. Then the file is opened and a knob turned;
the radius is relative to the cell edge. Printed: seconds and ms per member of every step from the opened file on.
"""

import argparse
import json
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[2]))

import michell_cad as mc
import michell_cad.pipeline as pipeline
from michell_cad.building import size_finished
from michell_cad.cad import build_solid, export_step, mesh_truss, prepare_truss, preview_truss
from michell_cad.cad.mesh import FEWEST_SEGMENTS, SEGMENTS
from michell_cad.design_file import load_saved, save_design
from michell_cad.edits import change_knobs
from michell_cad.job import Setup

STAGES = ("solve_elasticity", "fit_frame_field", "parametrize", "trace_isocurves", "clean_network")
"""What lies upstream of every knob, as the pipeline calls it."""


def count_calls(counts: Counter[str]) -> None:
    """Have the pipeline count the calls of its stages."""

    def counted(name: str, stage: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **options: Any) -> Any:
            counts[name] += 1
            return stage(*arguments, **options)

        return call

    for name in STAGES:
        setattr(pipeline, name, counted(name, getattr(pipeline, name)))


def turn_knob(file: Path, changes: dict[str, float]) -> None:
    """Open a design, turn knobs, and go all the way to a STEP file."""
    clock = time.process_time
    start = clock()
    saved = load_saved(file)
    structure = saved.replay(change_knobs(saved.knobs, changes), saved.edits)
    count = len(structure.truss.members)
    print(f"{count} members, opened in {clock() - start:.2f} s")

    def timed(what: str, work: Callable[[], Any], note: Callable[[Any], str] = lambda result: "") -> Any:
        start = clock()
        result = work()
        spent = clock() - start
        print(f"{what:<28}{spent:>8.2f} s{1e3 * spent / count:>9.3f} ms a member  {note(result)}", flush=True)
        return result

    sizing = timed("radii", lambda: size_finished(structure))
    sized, knobs = sizing.sized, sizing.knobs
    timed("preview mesh", lambda: preview_truss(sized, knobs), lambda mesh: f"{len(mesh.triangles)} triangles")
    prepared = timed("preparation", lambda: prepare_truss(sized, knobs))
    for segments in (FEWEST_SEGMENTS, SEGMENTS):
        timed(
            f"watertight mesh, {segments}-gons",
            lambda segments=segments: mesh_truss(prepared, segments),
            lambda mesh: f"{len(mesh.triangles)} triangles, watertight: {mesh.is_watertight}",
        )
    solid = timed(
        "solid with its checks", lambda: build_solid(sized, knobs), lambda solid: f"{solid.report.faces} faces"
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "truss.step"
        timed(
            "STEP", lambda: export_step(solid, path), lambda _: f"{path.stat().st_size / 1e3 / count:.1f} kB a member"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="DIR")
    parser.add_argument("name", nargs="?", default="holey_pillar", metavar="NAME")
    parser.add_argument("--radius", type=float, default=0.07)
    parser.add_argument("--entasis", type=float, default=0.3)
    arguments = parser.parse_args()
    entries = json.loads((arguments.folder / "problems.json").read_text())
    entry = next(entry for entry in entries if entry["name"] == arguments.name)
    problem = mc.build_problem(Setup(), mc.read_part(arguments.folder / entry["file"]))
    counts = Counter[str]()
    count_calls(counts)
    made = mc.design(problem, mc.DesignOptions(resolution=entry["rho"]))
    print(f"{arguments.name}, designed by " + ", ".join(f"{name}: {counts[name]}" for name in STAGES) + " calls")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "design.npz"
        save_design(file, made, mc.Knobs())
        counts.clear()
        # What compiled loops cost to load is no part of the knob.
        prepared = prepare_truss(mc.apply_knobs(made.truss, mc.Knobs()), mc.Knobs())
        mesh_truss(prepared)
        turn_knob(file, {"radius": arguments.radius * made.truss.spacing, "entasis": arguments.entasis})
    print(f"calls upstream of the knob: {counts.total()}")


if __name__ == "__main__":
    main()
