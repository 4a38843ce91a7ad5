"""What following the stress is worth: the traced truss against the one of Eq. 11 alone, sized per member.

    python tests/benchmarks/traced_trusses.py DIR [NAME ...] [--fraction 0.09] [--equal-spacing] [--criterion compliance]

DIR holds `problems.json` (a list with `name`, `file` and `rho`) and the `.npz` problems that it names. Both trusses of a
problem have its own rho (with --equal-spacing: the second one has the spacing of the first), the same loads and held
region, straight members, the same sum of pi r^2 L (a fraction of the part's volume), and the same smallest and largest
radius in mm. Printed: nodes, members, spacing, compliance with equal members and sized, and their ratios (first truss
over second: below 1 the first is stiffer).
"""

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

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


def trace(problem: mc.DesignProblem, follow_stress: bool, **density: float) -> mc.Truss:
    """The truss of a problem, with or without the stage that follows the stress."""
    parametrization = ParametrizationOptions(follow_stress=follow_stress)
    return mc.design(problem, mc.DesignOptions(parametrization=parametrization, **density)).truss


def compare(problem: mc.DesignProblem, trusses: list[mc.Truss], fraction: float, criterion: Any) -> list[dict]:
    """Size all trusses at the same volume and report on each."""
    volume = fraction * float(problem.mesh.volumes.sum())
    uniform = [np.sqrt(volume / (np.pi * truss.lengths.sum())) for truss in trusses]
    options = SizingOptions(criterion, SMALLEST_SHARE * min(uniform), LARGEST_SHARE * max(uniform))
    rows = []
    trusses = [keep_supported(problem, truss) for truss in trusses]
    for truss in trusses:
        loading = carry_over_loads(problem, truss)
        start = time.process_time()
        report = size_members(truss, problem.material, loading, volume, options, strict=False)[1]
        rows.append(
            {
                "nodes": len(truss.nodes),
                "members": len(truss.members),
                "spacing_mm": truss.spacing,
                "compliance": report.compliances[0],
                "sized_compliance": report.compliances[-1],
                "steps": len(report.compliances),
                "converged": report.converged,
                "cpu_s": time.process_time() - start,
            }
        )
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="DIR")
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--fraction", type=float, default=0.09)
    parser.add_argument("--criterion", choices=("compliance", "stress"), default="compliance")
    parser.add_argument("--equal-spacing", action="store_true")
    arguments = parser.parse_args()
    print(
        f"{'problem':<24}{'members':>15}{'spacing mm':>18}{'compliance N mm':>24}{'ratio':>7}{'sized':>24}{'ratio':>7}"
        f"{'steps':>9}{'cpu s':>7}"
    )
    for entry in json.loads((arguments.folder / "problems.json").read_text()):
        if arguments.names and entry["name"] not in arguments.names:
            continue
        problem = mc.build_problem(Setup(), mc.read_part(arguments.folder / entry["file"]))
        first = trace(problem, True, resolution=entry["rho"])
        density = {"spacing": first.spacing} if arguments.equal_spacing else {"resolution": entry["rho"]}
        a, b = compare(problem, [first, trace(problem, False, **density)], arguments.fraction, arguments.criterion)
        mark = "" if a["converged"] and b["converged"] else " *"
        print(
            f"{entry['name']:<24}{a['members']:>7} {b['members']:>7}{a['spacing_mm']:>9.4g}{b['spacing_mm']:>9.4g}"
            f"{a['compliance']:>12.4g}{b['compliance']:>12.4g}{a['compliance'] / b['compliance']:>7.3f}"
            f"{a['sized_compliance']:>12.4g}{b['sized_compliance']:>12.4g}"
            f"{a['sized_compliance'] / b['sized_compliance']:>7.3f}{a['steps']:>5}{b['steps']:>4}"
            f"{a['cpu_s'] + b['cpu_s']:>7.1f}{mark}",
            flush=True,
        )
    print("* the radii had not settled")


if __name__ == "__main__":
    main()
