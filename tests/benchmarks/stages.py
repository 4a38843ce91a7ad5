"""What the stages cost against the size of the mesh: CPU time of each, and memory.

    python tests/benchmarks/stages.py PROBLEM.npz [--resolution 24] [--refine 0 1 2] [--equation-11-only] [--json OUT]

Every mesh is the given one with all tets cut in eight `--refine` times over, in a process of its own on one thread,
at the same resolution. Times are CPU seconds over `solver_unit_s`, one factorisation and one solve of the stiffness
matrix. Memory is the largest resident size while a stage ran, less that before the first stage, over `factor`: what
factorising the stiffness matrix alone adds at its peak, in another process. `total` is the largest size of the whole
process, libraries included. Reads /proc, so it needs Linux.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path

THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")
ROOT = Path(__file__).parents[2]


def memory_mb(peak: bool) -> float:
    """Resident size of this process, or its largest one since `forget_peak`, MB."""
    key = "VmHWM:" if peak else "VmRSS:"
    line = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith(key))
    return int(line.split()[1]) / 1e3


def forget_peak() -> None:
    Path("/proc/self/clear_refs").write_text("5")


def measure_stages(path: Path, resolution: float, times: int, follow_stress: bool) -> dict:
    """Run all stages once; sizes, CPU seconds and peak MB of each."""
    import michell_cad as mc
    from michell_cad.parametrization import ParametrizationOptions
    from michell_cad.warm_up import load_compiled_loops
    from tests.shapes import refined

    problem = refined(_problem(path), times)
    options = mc.DesignOptions(resolution, parametrization=ParametrizationOptions(follow_stress=follow_stress))
    load_compiled_loops()
    before, peaks = memory_mb(peak=False), {}

    def progress(stage: str, fraction: float) -> None:
        if fraction == 0:
            forget_peak()
        elif fraction == 1:
            peaks[stage] = memory_mb(peak=True) - before

    start = time.process_time()
    design = mc.design(problem, options, progress)
    return {
        "tets": len(problem.mesh.tets),
        "unknowns": int((~problem.fixed).sum()),
        "members": len(design.truss.members),
        "solver_unit_s": design.stress_field.solver_unit,
        "cpu_s": {t.name: t.cpu_s for t in design.times} | {"all": time.process_time() - start},
        "peak_mb": peaks,
        "total_mb": before + max(peaks.values()),
    }


def measure_factor(path: Path, times: int) -> float:
    """Peak MB that factorising the stiffness matrix adds to a process that holds it."""
    import numpy as np

    from michell_cad.elasticity import stiffness_matrix
    from michell_cad.linear_solver import factorise
    from michell_cad.warm_up import load_compiled_loops
    from tests.shapes import refined

    load_compiled_loops()
    problem = refined(_problem(path), times)
    free = np.flatnonzero(~problem.fixed.ravel())
    K = stiffness_matrix(problem.mesh, problem.material)[free][:, free]
    forget_peak()
    before = memory_mb(peak=False)
    factor = factorise(K)
    peak = memory_mb(peak=True) - before
    factor.solve(np.ones(len(free)))
    return peak


def _problem(path: Path):
    import michell_cad as mc
    from michell_cad.job import Setup

    return mc.build_problem(Setup(), mc.read_part(path))


def _in_child(*arguments: object) -> dict:
    """Run this file with `--child`; memory of one measurement is then no part of the next."""
    environment = os.environ | dict.fromkeys(THREADS, "1")
    command = [sys.executable, __file__, "--child", *map(str, arguments)]
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout)


def _line(row: dict, stages: list[str]) -> str:
    cells = [f"{row['tets']:8d} {row['members']:8d} {row['solver_unit_s']:8.2f} {row['factor_mb']:8.0f} "]
    cells += [f"{row['cpu_s'][stage] / row['solver_unit_s']:9.2f}" for stage in [*stages, "all"]]
    cells += [f"{row['peak_mb'][stage] / row['factor_mb']:9.2f}" for stage in stages]
    cells.append(f"{row['total_mb'] / row['factor_mb']:9.2f}")
    return "".join(cells)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("problem", type=Path, metavar="PROBLEM.npz")
    parser.add_argument("--resolution", type=float, default=24.0)
    parser.add_argument("--refine", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--equation-11-only", action="store_true")
    parser.add_argument("--json", type=Path, metavar="OUT")
    parser.add_argument("--child", choices=("stages", "factor"), help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.child == "stages":
        print(json.dumps(measure_stages(given.problem, given.resolution, given.refine[0], not given.equation_11_only)))
        return
    if given.child == "factor":
        print(json.dumps({"factor_mb": measure_factor(given.problem, given.refine[0])}))
        return
    rows = []
    for times in given.refine:
        common = (given.problem, "--refine", times, "--resolution", given.resolution)
        short = ["--equation-11-only"] if given.equation_11_only else []
        rows.append(_in_child("stages", *common, *short) | _in_child("factor", *common))
        stages = list(rows[-1]["peak_mb"])
        if len(rows) == 1:
            names = [stage[:8] for stage in stages]
            print(f"{'':36}{'CPU over unit':<{9 * len(names) + 9}}  peak memory over factor")
            print(
                f"{'tets':>8} {'members':>8} {'unit s':>8} {'factor MB':>9}"
                + "".join(f"{name:>9}" for name in [*names, "all", *names, "total"])
            )
        print(_line(rows[-1], stages), flush=True)
    if given.json:
        given.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    main()
