"""Table 2 of Arora et al. 2019 (SCF '19), the paper's row beside ours, for every problem of a folder.

    python examples/paper/table2.py DIR [--beta 0.1 1] [--equation-11-only] [--json OUT]

DIR holds `problems.json` (a list with `name`, `file`, `rho` and, if known, `paper_table2`) and the `.npz` problems that
it names. Times are CPU seconds in units of `solver_unit_s`: one factorisation and one solve of the stiffness matrix.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import michell_cad as mc
from michell_cad.elasticity import ElasticityOptions
from michell_cad.job import Setup
from michell_cad.parametrization import ParametrizationOptions
from michell_cad.pipeline import STAGES
from michell_cad.report import report_design


def run(folder: Path, entry: dict[str, Any], beta: float, follow_stress: bool) -> dict[str, Any]:
    """Design one problem at its own resolution; returns its report with `name` and `beta`."""
    problem = mc.build_problem(Setup(), mc.read_part(folder / entry["file"]))
    options = mc.DesignOptions(
        resolution=entry["rho"],
        elasticity=ElasticityOptions(),
        parametrization=ParametrizationOptions(spacing_weight=beta, follow_stress=follow_stress),
    )
    design = mc.design(problem, options)
    return {"name": entry["name"], "beta": beta} | report_design(design, design.truss)


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
    parser.add_argument("--json", type=Path, metavar="OUT")
    arguments = parser.parse_args()
    print(
        f"{'problem':<24}{'beta':>5}  {'paper: frame, angle':<22} {'frame deg':>10} {'angle deg':>10}  "
        f"frame curve carry   p99  inv  wnd deg6  dup  members    unit  {' '.join(stage[:6] for stage in STAGES)}"
    )
    reports = []
    for entry in json.loads((arguments.folder / "problems.json").read_text()):
        for beta in arguments.beta:
            reports.append(run(arguments.folder, entry, beta, not arguments.equation_11_only))
            print(row(reports[-1], entry.get("paper_table2")), flush=True)
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
