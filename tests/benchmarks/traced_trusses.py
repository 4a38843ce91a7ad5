"""What following the stress is worth: the traced truss against the one of Eq. 11 alone, sized per member.

    python tests/benchmarks/traced_trusses.py DIR [NAME ...] [--fraction 0.09] [--equal-length] [--criterion stress]

DIR holds `problems.json` (a list with `name`, `file` and `rho`) and the `.npz` problems that it names. Both trusses of
a problem have its own rho; as a median cell is then not of the same size, --equal-length gives the second one the total
length of the first, so that equal members of one volume have one radius. Alike for both are loads and held region,
straight members, the sum of pi r^2 L (a fraction of the part's volume), and the smallest and the largest radius in mm.
Printed: members, spacing, compliance with equal members and sized, and their ratios, the first truss over the second:
below 1 the first is stiffer. Loose parts of a truss are left out.
"""

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Literal

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

import michell_cad as mc
from michell_cad.job import Setup
from michell_cad.parametrization import ParametrizationOptions
from michell_cad.strength import SizingOptions, carry_over_loads, keep_supported, size_members

SMALLEST_SHARE = 0.2
"""Smallest radius, of both trusses, over the smaller of the two radii of equal members."""

LARGEST_SHARE = 5.0
"""Largest radius, of both trusses, over the larger of the two."""

LENGTH_TOLERANCE = 0.02
"""Relative difference of total lengths that counts as none: the length jumps as curves come and go."""

RETRACES = 6
"""Attempts at an equal length."""


def trace(problem: mc.DesignProblem, follow_stress: bool, **density: float) -> mc.Truss:
    """The truss of a problem, with or without the stage that follows the stress, without its loose parts."""
    parametrization = ParametrizationOptions(follow_stress=follow_stress)
    truss = mc.design(problem, mc.DesignOptions(parametrization=parametrization, **density)).truss
    return keep_supported(problem, truss)


def trace_pair(problem: mc.DesignProblem, rho: float, equal_length: bool) -> tuple[mc.Truss, mc.Truss]:
    """Both trusses of a problem."""
    first, second = trace(problem, True, resolution=rho), trace(problem, False, resolution=rho)
    candidates = [second]
    for _ in range(RETRACES if equal_length else 0):
        excess = candidates[-1].lengths.sum() / first.lengths.sum()
        if abs(excess - 1) <= LENGTH_TOLERANCE:
            break
        candidates.append(trace(problem, False, spacing=candidates[-1].spacing * excess**0.5))
    length = first.lengths.sum() if equal_length else second.lengths.sum()
    return first, min(candidates, key=lambda truss: abs(truss.lengths.sum() - length))


def size_both(
    problem: mc.DesignProblem,
    trusses: tuple[mc.Truss, mc.Truss],
    fraction: float,
    criterion: Literal["compliance", "stress"] = "compliance",
) -> str:
    """Size both trusses at the same volume; one line of the table."""
    volume = fraction * float(problem.mesh.volumes.sum())
    uniform = [np.sqrt(volume / (np.pi * truss.lengths.sum())) for truss in trusses]
    options = SizingOptions(criterion, SMALLEST_SHARE * min(uniform), LARGEST_SHARE * max(uniform))
    start = time.process_time()
    a, b = (
        size_members(truss, problem.material, carry_over_loads(problem, truss), volume, options, strict=False)[1]
        for truss in trusses
    )
    first, second = trusses
    return (
        f"{len(first.members):>7} {len(second.members):>7}{first.spacing:>9.4g}{second.spacing:>9.4g}"
        f"{a.compliances[0]:>12.4g}{b.compliances[0]:>12.4g}{a.compliances[0] / b.compliances[0]:>7.3f}"
        f"{a.compliances[-1]:>12.4g}{b.compliances[-1]:>12.4g}{a.compliances[-1] / b.compliances[-1]:>7.3f}"
        f"{len(a.compliances):>5}{len(b.compliances):>4}{time.process_time() - start:>7.1f}"
        + ("" if a.converged and b.converged else " *")
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="DIR")
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--fraction", type=float, default=0.09)
    parser.add_argument("--equal-length", action="store_true")
    parser.add_argument("--criterion", choices=("compliance", "stress"), default="compliance")
    arguments = parser.parse_args()
    print(
        f"{'problem':<24}{'members':>15}{'spacing mm':>18}{'compliance N mm':>24}{'ratio':>7}{'sized':>24}{'ratio':>7}"
        f"{'steps':>9}{'cpu s':>7}"
    )
    for entry in json.loads((arguments.folder / "problems.json").read_text()):
        if not arguments.names or entry["name"] in arguments.names:
            problem = mc.build_problem(Setup(), mc.read_part(arguments.folder / entry["file"]))
            trusses = trace_pair(problem, entry["rho"], arguments.equal_length)
            line = size_both(problem, trusses, arguments.fraction, arguments.criterion)
            print(f"{entry['name']:<24}{line}", flush=True)
    print("* the radii had not settled")


if __name__ == "__main__":
    main()
