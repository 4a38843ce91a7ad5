"""Trusses side by side: the same part, loads, clamped region and amount of material, and never one winner.

Every candidate has its radii scaled to the same union volume (see `union_volume`). The figures answer different
questions - which yields first, which buckles, which minds a load that is a little off, which is stiff - and are all
given. A ground structure wins what it was computed for, by construction: its areas come from a program.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from michell_cad.arrays import require
from michell_cad.problem import DesignProblem
from michell_cad.strength.beam_model import build_beam_model
from michell_cad.strength.beam_solver import solve_beams
from michell_cad.strength.comparison.union_volume import scale_to_union
from michell_cad.strength.comparison.voxel_optimisation import VoxelDesign
from michell_cad.strength.frame_buckling import frame_buckling
from michell_cad.strength.loads import OFF_AXIS_DEGREES, add_off_axis_cases, carry_over_loads
from michell_cad.strength.mechanism import leave_out_loose_parts
from michell_cad.strength.member_buckling import member_buckling_factors
from michell_cad.strength.pin_joints import pin_joint_residual
from michell_cad.truss import SizedTruss


@dataclass(frozen=True, eq=False)
class Candidate:
    """A truss with radii whose proportions count; the comparison scales them."""

    name: str
    sized: SizedTruss


@dataclass(frozen=True)
class Row:
    """Figures of one candidate; factors are of the given loads. None: not defined, or nothing buckles.

    Parameters
    ----------
    name : of the candidate.
    compliance : f . u, N mm.
    mass_g, volume_fraction : of the union.
    members : their number.
    yield_factor : at first yield.
    member_buckling, frame_buckling : at which a member, or the frame of all, buckles.
    off_axis_yield : at first yield, the worst of the loads tilted to four sides.
    force_path : sum |N| L over the strength, mm^3: the least volume of a pin-jointed truss of these forces.
    pin_joint_residual : share of the loads that axial forces alone cannot carry.
    """

    name: str
    compliance: float
    mass_g: float
    volume_fraction: float
    members: int | None = None
    yield_factor: float | None = None
    member_buckling: float | None = None
    frame_buckling: float | None = None
    off_axis_yield: float | None = None
    force_path: float | None = None
    pin_joint_residual: float | None = None


def compare_trusses(
    problem: DesignProblem,
    candidates: Sequence[Candidate],
    volume: float,
    off_axis_degrees: float = OFF_AXIS_DEGREES,
) -> list[Row]:
    """A row for each candidate, all scaled to one union volume, mm^3."""
    require(np.isfinite(volume) and volume > 0, f"volume must be positive, in mm^3, found {volume}")
    return [measure_row(problem, candidate, volume, off_axis_degrees) for candidate in candidates]


def measure_row(problem: DesignProblem, candidate: Candidate, volume: float, off_axis_degrees: float) -> Row:
    """Scale a candidate to the volume and measure it."""
    sized, _ = leave_out_loose_parts(problem, candidate.sized)
    sized = scale_to_union(sized, volume)
    material = problem.material
    plain = carry_over_loads(problem, sized.truss)
    loading = add_off_axis_cases(plain, off_axis_degrees)
    model = build_beam_model(sized, material, straight=False)
    solution = solve_beams(model, loading)
    n_c, every = len(plain.names), len(loading.names) // len(plain.names)
    own = np.arange(n_c) * every
    factors = material.yield_strength / solution.peak_stress.max(1)
    members = float(member_buckling_factors(solution)[own].min())
    frames = [frame_buckling(solution, loading, int(case))[0] for case in own]
    frames = [float(found[0]) for found in frames if len(found)]
    N = np.abs(solution.axial_force[own])
    return Row(
        name=candidate.name,
        members=len(sized.truss.members),
        yield_factor=float(factors[own].min()),
        member_buckling=members if np.isfinite(members) else None,
        frame_buckling=min(frames) if frames else None,
        off_axis_yield=float(factors.min()),
        compliance=float(plain.weights @ solution.compliances[own]),
        force_path=float(np.einsum("cek,ek->c", N, model.weights).max()) / material.yield_strength,
        mass_g=volume * material.density,
        volume_fraction=volume / float(problem.mesh.volumes.sum()),
        pin_joint_residual=float(pin_joint_residual(sized.truss, plain).max()),
    )


def voxel_rows(problem: DesignProblem, design: VoxelDesign, volume: float) -> list[Row]:
    """What no structure of a volume, mm^3, goes below, and densities of voxels from empty to full (p = 1) and of nearly
    empty and nearly full ones (p = 3).

    Voxels have neither members nor a stress that means anything at their corners: they are a mark for stiffness only.
    """
    mass, fraction = volume * problem.material.density, volume / float(problem.mesh.volumes.sum())
    return [
        Row("voxels, bound", design.least_compliance, mass, fraction),
        Row("voxels, p = 1", design.sheet_compliance, mass, fraction),
        Row("voxels, p = 3", design.compliance, mass, fraction),
    ]
