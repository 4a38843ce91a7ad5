"""Figure 15 of Arora et al. 2019 (SCF '19): von Mises stress on solids of three layouts, and beams beside the solids.

    python examples/paper/figure15.py DIR [--only NAME ...] [--pictures OUT] [--volume-fraction 0.09]

DIR holds the `.npz` problems. Each layout has equal members, and about the same share of its part. The solid, with its
balls and fillets, is meshed by quadratic tets and carries the loads and supports of its beams. Printed are the
compliance of the beams over that of the solid, with members as thick as the balls of their nodes within these and
without, and the solid's peak stress over that of the beams. About 90 CPU seconds and 10 GB for each layout.
"""

import argparse
import time
from pathlib import Path

import numpy as np

import michell_cad as mc
from michell_cad.cad import build_solid
from michell_cad.job import Setup
from michell_cad.picture import render_solid_stress
from michell_cad.strength import build_beam_model, carry_over_loads, solve_beams
from michell_cad.strength.comparison import regular_grid
from michell_cad.strength.solid import check_solid

SCALE_QUANTILE = 0.999
"""The colours end at the stress that all but this share stay below."""


def cantilever_aligned(problem: mc.DesignProblem) -> mc.Truss:
    """Every second curve at resolution 16, as the paper's beam."""
    return mc.apply_knobs(mc.design(problem, mc.DesignOptions(resolution=16)).truss, mc.Knobs(every=2)).truss


def cantilever_grid(problem: mc.DesignProblem) -> mc.Truss:
    """A regular grid with a diagonal in every face."""
    return regular_grid(problem.mesh, (6, 3, 3), diagonals="parallel")


def torsion_aligned(problem: mc.DesignProblem) -> mc.Truss:
    """Curves around and along a bar in torsion."""
    return mc.apply_knobs(mc.design(problem, mc.DesignOptions(resolution=12)).truss, mc.Knobs(every=2)).truss


LAYOUTS = {
    "cantilever_aligned": ("cantilever_beam", cantilever_aligned),
    "cantilever_grid": ("cantilever_beam", cantilever_grid),
    "torsion_aligned": ("bar_torsion", torsion_aligned),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="DIR")
    parser.add_argument("--only", nargs="+", choices=LAYOUTS, default=list(LAYOUTS))
    parser.add_argument("--pictures", type=Path, metavar="OUT")
    parser.add_argument("--volume-fraction", type=float, default=0.09)
    arguments = parser.parse_args()
    for name in arguments.only:
        file, make = LAYOUTS[name]
        problem = mc.build_problem(Setup(), mc.read_part(arguments.folder / f"{file}.npz"))
        truss = make(problem)
        volume = arguments.volume_fraction * float(problem.mesh.volumes.sum())
        r = float(np.sqrt(volume / (np.pi * truss.lengths.sum())))
        solid = build_solid(mc.SizedTruss(truss, np.full((len(truss.members), 3), r)), mc.Knobs(radius=r))
        sized, joints = solid.sized, solid.node_balls
        loading = carry_over_loads(problem, sized.truss)
        thin, beams = (
            solve_beams(build_beam_model(sized, problem.material, straight=False, joints=balls), loading)
            for balls in (None, joints)
        )
        start = time.process_time()
        check, solution = check_solid(solid.mesh, beams, sized, loading)
        print(
            f"{name}: {len(sized.truss.members)} members of {r:.3g} mm, {check.tets:,} tets, "
            f"{time.process_time() - start:.0f} CPU s; compliance of beams over solid "
            f"{check.beam_over_solid_compliance:.3f} (without the balls of the nodes "
            f"{thin.compliances.sum() / check.compliance_nmm:.3f}); peak {check.peak_stress_mpa:.4g} MPa, over the "
            f"beams' {check.solid_over_beam_peak:.3f} (without balls "
            f"{check.peak_stress_mpa / thin.peak_stress.max():.3f})",
            flush=True,
        )
        if arguments.pictures:
            stress = solution.von_mises.max(0)
            top = float(np.quantile(stress[solution.loading.counted], SCALE_QUANTILE))
            arguments.pictures.mkdir(parents=True, exist_ok=True)
            picture = arguments.pictures / f"{name}.png"
            render_solid_stress(picture, solution.mesh.nodes, solution.mesh.boundary, stress, top, up=1)


if __name__ == "__main__":
    main()
