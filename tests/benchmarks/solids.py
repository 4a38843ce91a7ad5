"""What a solid costs: CPU milliseconds per member of every step, on warped grids of growing size.

python tests/benchmarks/solids.py [members ...]
"""

import resource
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from michell_cad.cad import kernel
from michell_cad.cad.mesh import mesh_truss
from michell_cad.cad.prepare import prepare_truss
from michell_cad.cad.shell import assemble_shell
from michell_cad.cad.solid import build_solid
from michell_cad.cad.step import export_step
from michell_cad.knobs import Knobs
from tests.cad.layouts import grid_truss, sized


def grid_of(members: int):
    """A warped grid with about so many curved, filleted, tapered members."""
    k = max(2, round((members / 3) ** (1 / 3)))
    return sized(grid_truss((k, k, k + 1), warp=0.08), 1.0, 0.3)


def measure(members: int) -> list[float]:
    tight, knobs = grid_of(members), Knobs()
    n = len(tight.truss.members)
    clock, marks = time.process_time, [time.process_time()]
    prepared = prepare_truss(tight, knobs)
    marks.append(clock())
    mesh_truss(prepared)
    marks.append(clock())
    plan = assemble_shell(prepared)
    marks.append(clock())
    solids, _ = kernel.make_solids(plan)
    marks.append(clock())
    assert all(kernel.is_valid(solid) for solid in solids)
    marks.append(clock())
    for solid in solids:
        kernel.volume(solid)
    marks.append(clock())
    solid = build_solid(grid_of(members), knobs)
    marks.append(clock())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "truss.step"
        export_step(solid, path)
        marks.append(clock())
        size = path.stat().st_size / 1e3 / n
    steps = [1e3 * (b - a) / n for a, b in pairwise(marks)]
    return [n, *steps, size, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6]


if __name__ == "__main__":
    columns = ("members", "prepare", "mesh", "plan", "kernel", "check", "volume", "all", "step", "kB", "peak GB")
    print("".join(f"{name:>9}" for name in columns))
    for wanted in [int(x) for x in sys.argv[1:]] or [100, 1000, 3000]:
        print("".join(f"{x:9.3g}" for x in measure(wanted)))
