"""Table 2 of Arora et al. 2019 (SCF '19), the paper's row beside ours, for every problem of a folder.

    python examples/paper/table2.py DIR [--beta 0.1 1] [--equation-11-only] [--solid] [--json OUT]

DIR holds `problems.json` (a list with `name`, `file`, `rho` and, if known, `paper_table2`) and the `.npz` problems that
it names. Times are CPU seconds in units of `solver_unit_s`: one factorisation and one solve of the stiffness matrix.
With `--solid` every truss is also built at the default radius, with entasis 0.3 and fillets, written as STEP, and read
again by another process; its `solid` block is that of a job's `report.json`.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import michell_cad as mc
from michell_cad.cad import build_solid, export_step
from michell_cad.delivery import report_solid
from michell_cad.elasticity import ElasticityOptions
from michell_cad.job import Setup
from michell_cad.knobs import Knobs, apply_knobs
from michell_cad.parametrization import ParametrizationOptions
from michell_cad.pipeline import STAGES
from michell_cad.report import report_design

KNOBS = Knobs(entasis=0.3)
"""Of the solids."""

READ_AGAIN = """
import json, sys
from dataclasses import asdict
from michell_cad.cad import read_step_summary
print(json.dumps(asdict(read_step_summary(sys.argv[1]))))
"""


def build(design: mc.Design) -> dict[str, Any]:
    """The `solid` block of a design, with CPU seconds of building and writing, and what another process reads."""
    start = time.process_time()
    solid = build_solid(apply_knobs(design.truss, KNOBS), KNOBS)
    built = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "truss.step"
        export_step(solid, path)
        written = time.process_time()
        text = subprocess.run([sys.executable, "-c", READ_AGAIN, path], check=True, capture_output=True, text=True)
        size = path.stat().st_size
    return report_solid(solid) | {
        "step_bytes": size,
        "cpu_s": {"build": built - start, "step": written - built},
        "read_again": json.loads(text.stdout),
    }


def solid_row(solid: dict[str, Any]) -> str:
    """One line on a solid."""
    again, n = solid["read_again"], solid["members"]
    direct = 1 - sum(solid["fallback_nodes"].values()) / solid["nodes"]
    fallback = ", ".join(f"{count} {kind}" for kind, count in solid["fallback_nodes"].items()) or "none"
    return (
        f"    solid: {solid['solids']} of {solid['faces']} faces, valid {solid['valid']}, read again "
        f"{again['solids']}, valid {again['valid']}, volume {again['volume_mm3'] / solid['volume_mm3'] - 1:+.0e}; "
        f"mesh volume {solid['mesh_volume_mm3'] / solid['volume_mm3'] - 1:+.1e}; genus {solid['genus']} of "
        f"{solid['expected_genus']}; {direct:.1%} of {solid['nodes']} nodes direct, "
        f"{solid['filleted_nodes']} filleted, fallback {fallback}; {solid['crossings']} crossings; "
        f"{1e3 * solid['cpu_s']['build'] / n:.1f} ms and "
        f"STEP {1e3 * solid['cpu_s']['step'] / n:.1f} ms, {solid['step_bytes'] / 1e3 / n:.1f} kB a member"
    )


def run(folder: Path, entry: dict[str, Any], beta: float, follow_stress: bool, solid: bool) -> dict[str, Any]:
    """Design one problem at its own resolution; returns its report with `name` and `beta`."""
    problem = mc.build_problem(Setup(), mc.read_part(folder / entry["file"]))
    options = mc.DesignOptions(
        resolution=entry["rho"],
        elasticity=ElasticityOptions(),
        parametrization=ParametrizationOptions(spacing_weight=beta, follow_stress=follow_stress),
    )
    design = mc.design(problem, options)
    report = {"name": entry["name"], "beta": beta} | report_design(design, design.truss)
    return report | ({"solid": build(design)} if solid else {})


def row(report: dict[str, Any], paper: dict[str, Any] | None) -> str:
    """One line of the table."""
    a, p, t = report["alignment"], report["parametrization"], report["truss"]
    unit = report["solver_unit_s"]
    key = f"angle_beta_{report['beta']:g}_deg".replace(".", "_")
    theirs = [_spread(paper[k]) for k in ("misalignment_deg", key) if paper and k in paper]
    cpu = " ".join(f"{report['cpu_s'][stage] / unit:6.1f}" for stage in STAGES)
    return (
        f"{report['name']:<24}{report['beta']:>5g}  {' '.join(theirs):<22} "
        f"{_spread(a['misalignment_deg'])} {_spread(a['angle_deg'])}  "
        f"{a['frame_shear_residual']:.3f} {a['curve_shear_residual']:.3f} {a['uncarried_stress']:.3f} "
        f"{a['spacing_p99']:5.2f}  {p['inverted_tets']:>4} {p['double_wound_edges']:>4} "
        f"{t['interior_degree_6']:.3f} {t['duplicate_members']:>3}  {t['members']:>6}  {unit:6.3f} {cpu}"
    )


def _spread(pair: tuple[float, float] | None) -> str:
    return f"{pair[0]:5.1f}±{pair[1]:4.1f}" if pair else f"{'-':>10}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="DIR")
    parser.add_argument("--beta", type=float, nargs="+", default=[0.1, 1.0])
    parser.add_argument("--equation-11-only", action="store_true")
    parser.add_argument("--solid", action="store_true")
    parser.add_argument("--json", type=Path, metavar="OUT")
    arguments = parser.parse_args()
    print(
        f"{'problem':<24}{'beta':>5}  {'paper: frame, angle':<22} {'frame deg':>10} {'angle deg':>10}  "
        f"frame curve carry   p99  inv  wnd deg6  dup  members    unit  {' '.join(stage[:6] for stage in STAGES)}"
    )
    reports = []
    for entry in json.loads((arguments.folder / "problems.json").read_text()):
        for beta in arguments.beta:
            reports.append(run(arguments.folder, entry, beta, not arguments.equation_11_only, arguments.solid))
            print(row(reports[-1], entry.get("paper_table2")), flush=True)
            if arguments.solid:
                print(solid_row(reports[-1]["solid"]), flush=True)
    for beta in arguments.beta:
        some = [report for report in reports if report["beta"] == beta]
        means = {
            key: sum(report["alignment"][key] for report in some) / len(some)
            for key in ("frame_shear_residual", "curve_shear_residual", "uncarried_stress", "spacing_p99")
        }
        cpu = sum(sum(report["cpu_s"].values()) for report in some) / sum(report["solver_unit_s"] for report in some)
        print(f"beta {beta:g}: " + ", ".join(f"{key} {value:.3f}" for key, value in means.items()), end="")
        print(f"; CPU of all stages over solver_unit_s {cpu:.1f}")
    if arguments.json:
        arguments.json.write_text(json.dumps(reports, indent=1))


if __name__ == "__main__":
    main()
