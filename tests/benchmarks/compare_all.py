"""The sized truss beside the sized braced grid of about as many members, on every given problem: who is stiffer, who is
stronger, and why.

    python tests/benchmarks/compare_all.py DIR [--only NAME ...] [--designs DIR] [--most 1500] [--volume-fraction 0.09]
                                               [--criterion stress] [--shear-limit 0.12] [--node-ratio 1.3]
                                               [--diagonals parallel]

DIR holds the problems and `problems.json` with their resolutions. Designs are made, or read from NAME*.npz files of
`--designs` that the design command wrote. Of every design each n-th curve is kept, n the least with at most `--most`
members, and diagonals in its cell faces, zigzag or parallel (which makes a weaker grid). Both have straight members
sized one by one, by the same rules, for the given loads and these tilted by 5 degrees to four sides, buckling
respected; both are made buildable as one solid, sized at the volume at which that solid has 9 % of the part, and scaled
to it exactly. Figures are those of the
beam model of the truss as built, with the balls of its nodes. Ratios are ours over the grid's, above 1 is better:
stiffness (compliance of the grid over ours), load at first yield, at first yield or member buckling, at either of the
tilted loads, and at the buckling of the whole frame.
"""

import argparse
import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

import michell_cad as mc
from michell_cad.building import buildable
from michell_cad.cad.mesh import mesh_truss
from michell_cad.cad.prepare import prepare_truss
from michell_cad.design_file import load_design
from michell_cad.errors import MichellError
from michell_cad.job import Setup
from michell_cad.metrics import rms_shear
from michell_cad.strength import (
    StrengthenOptions,
    add_off_axis_cases,
    build_beam_model,
    carry_over_loads,
    solve_beams,
    straighten,
    strengthen,
)
from michell_cad.strength.braces import SHEAR_LIMIT
from michell_cad.strength.comparison import regular_grid
from michell_cad.strength.comparison.grids import Diagonals
from michell_cad.strength.frame_buckling import frame_buckling
from michell_cad.strength.mechanism import leave_out_loose_parts
from michell_cad.strength.member_buckling import member_buckling_factors
from michell_cad.strength.pin_joints import pin_joint_residual
from michell_cad.strength.strengthen import size_for_loads
from michell_cad.truss import SizedTruss

VOLUME_EXPONENT = 2.3
"""The volume of a solid goes with about this power of its radii: members with the square, balls with the cube."""

ROUNDS = 3
"""Rounds of scaling to the volume, which jumps where members merge."""

CELLS = range(2, 61)
"""Numbers of cells of grids along the longest side that are tried."""


@dataclass(frozen=True)
class Figures:
    """What a truss as built carries, and by what it fails first; factors are of the loads, `bending` is the share of
    bending and torsion in the energy."""

    members: int
    volume: float
    compliance: float
    first_yield: float
    failure: float
    tilted: float
    frame: float
    residual: float
    force_path: float
    bending: float
    cause: str


def measure(problem: mc.DesignProblem, sized: SizedTruss, knobs: mc.Knobs, volume: float) -> Figures:
    """Scale a truss until its solid has the volume, and measure it as built."""
    for _ in range(ROUNDS):
        prepared = prepare_truss(sized, knobs)
        found = mesh_truss(prepared).volume
        if abs(found / volume - 1) < 5e-3:
            break
        sized = SizedTruss(sized.truss, sized.radii * (volume / found) ** (1 / VOLUME_EXPONENT))
    balls = prepared.sizes.radius
    sized, _ = leave_out_loose_parts(problem, prepared.sized)
    plain = carry_over_loads(problem, sized.truss)
    loading = add_off_axis_cases(plain)
    model = build_beam_model(sized, problem.material, straight=sized.truss.straight, joints=balls)
    columns = build_beam_model(sized, problem.material, straight=sized.truss.straight)
    solution = solve_beams(model, loading)
    own = np.arange(len(plain.names)) * (len(loading.names) // len(plain.names))
    with np.errstate(divide="ignore"):  # members without load
        yields = problem.material.yield_strength / solution.peak_stress
    buckles = member_buckling_factors(solution, columns)
    frames = [frame_buckling(solution, loading, int(case))[0] for case in own]
    N = np.abs(solution.axial_force[own])
    return Figures(
        members=len(sized.truss.members),
        volume=found / volume,
        compliance=float(plain.weights @ solution.compliances[own]),
        first_yield=float(yields[own].min()),
        failure=float(min(yields[own].min(), buckles[own].min())),
        tilted=float(min(yields.min(), buckles.min())),
        frame=min((float(f[0]) for f in frames if len(f)), default=np.inf),
        residual=float(pin_joint_residual(sized.truss, plain).max()),
        force_path=float(np.einsum("cek,ek->c", N, model.weights).max()),
        bending=float(solution.energies[own, :, 1].sum() / solution.energies[own].sum()),
        cause=first_to_fail(solution, yields, buckles, sized),
    )


def at_solid_volume(
    size: Callable[[StrengthenOptions], tuple[SizedTruss, Any]],
    options: StrengthenOptions,
    knobs: mc.Knobs,
    volume: float,
) -> tuple[SizedTruss, Any]:
    """Size twice: with the volume as the sum of the members', and with the sum whose solid has the volume.

    Radii that are the best at one volume are not at another: what buckles goes with the fourth power of the radius.
    """
    assert options.volume_fraction is not None
    solid = mesh_truss(prepare_truss(size(options)[0], knobs)).volume
    fraction = options.volume_fraction * (volume / solid) ** (2 / VOLUME_EXPONENT)
    return size(replace(options, volume_fraction=fraction))


def first_to_fail(solution, yields: np.ndarray, buckles: np.ndarray, sized: SizedTruss) -> str:
    """The member that fails first under all loads: how, how long it is, and how much of its stress is bending."""
    truss = sized.truss
    member = int(np.minimum(yields, buckles).min(0).argmin())
    curve = truss.curves[truss.curve_of_member[member]]
    length = truss.lengths[member] / np.median(truss.lengths)
    how = "buckles" if buckles[:, member].min() < yields[:, member].min() else "yields"
    case, section = np.unravel_index(solution.von_mises[:, member].argmax(), solution.von_mises[:, member].shape)
    r = solution.model.radii[member, section]
    axial = np.abs(solution.axial_force[case, member, section]) / (np.pi * r**2)
    bending = 1 - axial / solution.von_mises[case, member, section]
    thick = sized.radii[member, 1] / np.median(sized.radii)
    return f"{curve.family}, {how}, bending {bending:.0%}, length {length:.2f}, radius {thick:.2f} of the median"


def similar_grid(problem: mc.DesignProblem, members: int, diagonals: Diagonals) -> tuple[str, SizedTruss]:
    """The braced grid whose number of members is nearest."""
    extent = np.ptp(problem.mesh.vertices, axis=0)
    best: tuple[float, str, SizedTruss] | None = None
    for size in CELLS:
        a, b, c = np.maximum(np.rint(extent / extent.max() * size), 1).astype(int).tolist()
        grid = regular_grid(problem.mesh, (a, b, c), diagonals=diagonals)
        n = len(grid.members)
        if best is None or abs(np.log(n / members)) < best[0]:
            best = abs(np.log(n / members)), f"{a}x{b}x{c}", SizedTruss(grid, np.ones((n, 3)))
        if n > 1.5 * members:
            break
    assert best is not None
    return best[1:]


def make_design(folder: Path, name: str, designs: Path | None) -> mc.Design:
    if designs is not None:
        return load_design(sorted(designs.glob(f"{name}*.npz"))[0])[0]
    given = {entry["name"]: entry for entry in json.loads((folder / "problems.json").read_text())}
    problem = mc.build_problem(Setup(), mc.read_part(folder / f"{name}.npz"))
    return mc.design(problem, mc.DesignOptions(resolution=given[name]["rho"]))


def compare(design: mc.Design, arguments: argparse.Namespace) -> tuple[bool, bool]:
    """Print one problem; returns whether ours is stiffer and whether it is stronger."""
    start = time.process_time()
    problem, knobs = design.problem, mc.Knobs(node_ratio=arguments.node_ratio)
    every = 1
    while len((sized := mc.apply_knobs(design.truss, mc.Knobs(every=every))).truss.members) > arguments.most:
        every += 1
    sized = SizedTruss(straighten(sized.truss), sized.radii)
    options = StrengthenOptions(
        straight=True,
        size_by="member",
        criterion=arguments.criterion,
        braces=True,
        shear_limit=arguments.shear_limit,
        volume_fraction=arguments.volume_fraction,
    )
    build = buildable(knobs)
    shear = rms_shear(problem.mesh, design.stress_field.stress, design.parametrization.tangents)
    cells, grid = similar_grid(problem, len(sized.truss.members), arguments.diagonals)
    volume = arguments.volume_fraction * float(problem.mesh.volumes.sum())
    part = (problem, design.stress_field, design.parametrization)

    def strengthened(options: StrengthenOptions) -> tuple[SizedTruss, Any]:
        found, *rest = strengthen(*part, sized, options, build)
        return found, rest

    ours, (report, notes) = at_solid_volume(strengthened, options, knobs, volume)
    theirs, _ = at_solid_volume(
        lambda options: (size_for_loads(problem, grid, options, build), None), options, knobs, volume
    )
    a, b = (measure(problem, item, knobs, volume) for item in (ours, theirs))
    stiff = b.compliance / a.compliance
    print(
        f"  every {every}, {a.members} members ({report.braces} braces), grid {cells} {b.members}; solid volume "
        f"{a.volume:.2f} / {b.volume:.2f}\n"
        f"  ours / grid: stiffness {stiff:.2f}, yield {a.first_yield / b.first_yield:.2f}, failure "
        f"{a.failure / b.failure:.2f}, tilted {a.tilted / b.tilted:.2f}, frame buckling {a.frame / b.frame:.2f}; "
        f"sizing gains {report.failure_gain:.2f}\n"
        f"  cause: rms frame shear {shear:.2f}, pins miss {a.residual:.2f} / {b.residual:.2f}, share of "
        f"bending in the energy {a.bending:.0%} / {b.bending:.0%}, sum|N|L {a.force_path / b.force_path:.2f}\n"
        f"         first of ours: {a.cause}\n"
        f"         first of grid: {b.cause}; {time.process_time() - start:.0f} CPU s",
        flush=True,
    )
    for note in notes:
        if "braces" in note:
            print(f"         {note}", flush=True)
    return stiff > 1, a.failure > b.failure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="DIR")
    parser.add_argument("--only", nargs="+", metavar="NAME")
    parser.add_argument("--designs", type=Path, metavar="DIR")
    parser.add_argument("--most", type=int, default=1500)
    parser.add_argument("--volume-fraction", type=float, default=0.09)
    parser.add_argument("--criterion", choices=("stress", "compliance"), default="stress")
    parser.add_argument("--diagonals", choices=("zigzag", "parallel"), default="zigzag")
    parser.add_argument("--shear-limit", type=float, default=SHEAR_LIMIT)
    parser.add_argument("--node-ratio", type=float, default=1.3)
    arguments = parser.parse_args()
    given = [entry["name"] for entry in json.loads((arguments.folder / "problems.json").read_text())]
    wins = {}
    for name in arguments.only or given:
        print(name, flush=True)
        try:
            wins[name] = compare(make_design(arguments.folder, name, arguments.designs), arguments)
        except MichellError as error:
            print(f"  {error}", flush=True)
    both = [name for name, won in wins.items() if all(won)]
    print(f"stiffer and stronger on {len(both)} of {len(wins)}: {', '.join(both)}")


if __name__ == "__main__":
    main()
