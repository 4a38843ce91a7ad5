"""How strong the cantilever is: its stiffness against braced grids, its volume against Michell's, the gain by sizing.

    python tests/benchmarks/strength.py DIR [--resolution 16] [--stride 2 1] [--spacing-weight 0.3] [--layers hug]
                                            [--volume-fraction 0.09] [--node-ratio 1.3]
                                            [--skip-sizing]

DIR holds `cantilever_beam.npz`. All trusses have straight chords, equal members, and the same union volume; for every
resolution the offset of the kept curves is searched (each family by itself, all combinations). Stiffness is the
compliance of the braced grid over that of the truss. V* is Michell's volume for a strip with the load at mid-height,
7.027 F h / sigma for a strip of length 2 h; sqrt(C E V) / (F L k) is 1 for a truss of it, all of whose material is
stressed alike; V counts every member by itself, as for bars with pins. Sizing is for five load cases (the load, and
tilted by 5 degrees to four sides).
"""

import argparse
import itertools
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import get_args

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

import michell_cad as mc
from michell_cad.building import buildable
from michell_cad.cad.mesh import mesh_truss
from michell_cad.cad.prepare import prepare_truss
from michell_cad.job import Setup
from michell_cad.parametrization import ParametrizationOptions
from michell_cad.strength import (
    StrengthenOptions,
    build_beam_model,
    carry_over_loads,
    solve_beams,
    straighten,
    strengthen,
)
from michell_cad.strength.comparison import regular_grid, scale_to_union
from michell_cad.strength.comparison.grids import Diagonals
from michell_cad.strength.mechanism import leave_out_loose_parts
from michell_cad.strength.sizing_groups import SizedBy
from michell_cad.truss import SizedTruss

GRIDS = {(4, 2, 2): 1.25, (6, 3, 3): 1.40, (8, 4, 4): 1.55}
"""Braced grids, and the stiffness over theirs that is wanted, whichever way their diagonals run."""

MICHELL = 7.027
"""V* sigma / (F h) of a cantilever strip of height h and length 2 h, load at mid-height of its end."""


@dataclass(frozen=True)
class Figures:
    """Compliance, N mm; sum |N| L over V* sigma; sqrt(C E V) over Michell's; first yield, N."""

    compliance: float
    force_path: float
    michell: float
    first_yield: float


def measure(problem: mc.DesignProblem, sized: SizedTruss) -> Figures:
    sized, _ = leave_out_loose_parts(problem, sized)
    loading = carry_over_loads(problem, sized.truss)
    model = build_beam_model(sized, problem.material, straight=sized.truss.straight)
    solution = solve_beams(model, loading)
    F = float(np.linalg.norm(problem.load_cases[0].force.sum(0)))
    height = float(np.sort(np.ptp(problem.mesh.vertices, axis=0))[1])
    best = MICHELL * F * height
    path = float(np.einsum("ek,ek->", np.abs(solution.axial_force[0]), model.weights))
    C, E = float(solution.compliances[0]), problem.material.youngs_modulus
    first_yield = F * problem.material.yield_strength / solution.peak_stress.max()
    return Figures(C, path / best, float(np.sqrt(C * E * model.volume)) / best, float(first_yield))


def with_volume(truss: mc.Truss, volume: float) -> SizedTruss:
    """Equal members of a union volume."""
    r = np.sqrt(volume / (np.pi * truss.lengths.sum()))
    return scale_to_union(SizedTruss(truss, np.full((len(truss.members), 3), r)), volume)


def best_offset(problem: mc.DesignProblem, design: mc.Design, stride: int, volume: float) -> tuple[Figures, SizedTruss]:
    """The stiffest of all choices of offsets of the three families."""
    found = []
    for offset in itertools.product(range(stride), repeat=3):
        chosen = mc.apply_knobs(design.truss, mc.Knobs(every=stride, offset=offset)).truss
        sized = with_volume(straighten(chosen), volume)
        found.append((measure(problem, sized), sized))
    return min(found, key=lambda item: item[0].compliance)


def sizing_gains(problem: mc.DesignProblem, design: mc.Design, sized: SizedTruss, node_ratio: float) -> None:
    """First yield of radii per member and per curve over that of equal members, of the same volume; five load cases.

    Both are made buildable, and measured as built, with the balls of their nodes. The solid of sized members weighs
    more than that of equal ones of the same sum of member volumes, since its nodes are larger: by how much is printed.
    """
    part = (problem, design.stress_field, design.parametrization, sized)
    knobs = mc.Knobs(node_ratio=node_ratio)
    equal = mesh_truss(prepare_truss(sized, knobs)).volume
    wishes: tuple[tuple[SizedBy, float], ...] = (("member", 3.5), ("curve", 2.0))
    for by, wanted in wishes:
        options = StrengthenOptions(straight=True, size_by=by, buckling=False)
        start = time.process_time()
        built, report, _ = strengthen(*part, options, buildable(knobs))
        assert report is not None
        prepared = prepare_truss(built, knobs)
        changes = prepared.changes.merged_nodes + prepared.changes.rerouted_members
        heavier = mesh_truss(prepared).volume / equal
        figures = measure(problem, strengthen(*part, replace(options, criterion="compliance"))[0])
        print(
            f"  sized by {by}, nodes from {node_ratio:g} radii: first yield x {report.failure_gain:.2f} as built "
            f"(wanted {wanted}; the solid weighs x {heavier:.2f}; building it again changes {changes} places); "
            f"for stiffness sqrt(CEV)/Michell {figures.michell:.3f} {'(1.35), ' if by == 'member' else ''}sum|N|L/V* "
            f"{figures.force_path:.3f}; {time.process_time() - start:.0f} CPU s",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="DIR")
    parser.add_argument("--resolution", type=float, nargs="+", default=[16.0])
    parser.add_argument("--stride", type=int, nargs="+", default=[2, 1])
    parser.add_argument("--spacing-weight", type=float, default=0.3)
    parser.add_argument("--layers", choices=("clear", "hug"), default="hug")
    parser.add_argument("--volume-fraction", type=float, default=0.09)
    parser.add_argument("--node-ratio", type=float, default=1.3)
    parser.add_argument("--skip-sizing", action="store_true")
    arguments = parser.parse_args()
    problem = mc.build_problem(Setup(), mc.read_part(arguments.folder / "cantilever_beam.npz"))
    volume = arguments.volume_fraction * float(problem.mesh.volumes.sum())
    grids = {}
    for cells, diagonals in itertools.product(GRIDS, get_args(Diagonals)):
        grid = with_volume(regular_grid(problem.mesh, cells, diagonals=diagonals), volume)
        grids[cells, diagonals] = measure(problem, grid)
        print(f"grid {cells} {diagonals}, {len(grid.truss.members)} members: {grids[cells, diagonals]}", flush=True)
    for resolution in arguments.resolution:
        parametrization = ParametrizationOptions(spacing_weight=arguments.spacing_weight)
        options = mc.DesignOptions(resolution, layers=arguments.layers, parametrization=parametrization)
        design = mc.design(problem, options)
        for stride in arguments.stride:
            figures, sized = best_offset(problem, design, stride, volume)
            over = "; ".join(
                f"{d} " + " ".join(f"{grids[c, d].compliance / figures.compliance:.2f} ({w})" for c, w in GRIDS.items())
                for d in get_args(Diagonals)
            )
            print(
                f"resolution {resolution:g}, every {stride}, {len(sized.truss.members)} members: stiffness over grids "
                f"(wanted) {over}; sum|N|L/V* {figures.force_path:.3f} (1.20); sqrt(CEV)/Michell "
                f"{figures.michell:.3f} (1.7); first yield {figures.first_yield:.0f} N",
                flush=True,
            )
            if not arguments.skip_sizing:
                sizing_gains(problem, design, sized, arguments.node_ratio)


if __name__ == "__main__":
    main()
