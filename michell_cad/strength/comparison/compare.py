"""Trusses side by side: the same part, loads, clamped region and amount of material, and never one winner.

Every candidate has its radii scaled to the same union volume (see `union_volume`). The figures answer different
questions - which yields first, which buckles, which minds a load that is a little off, which is stiff - and are all
given. A ground structure wins what it was computed for, by construction: its areas come from a program.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from michell_cad.arrays import require
from michell_cad.problem import DesignProblem
from michell_cad.strength.beam_model import build_beam_model
from michell_cad.strength.beam_solver import solve_beams
from michell_cad.strength.comparison.grids import regular_grid, turned_axes
from michell_cad.strength.comparison.ground_structure import optimal_ground_structure
from michell_cad.strength.comparison.union_volume import scale_to_union
from michell_cad.strength.frame_buckling import frame_buckling
from michell_cad.strength.loads import OFF_AXIS_DEGREES, add_off_axis_cases, carry_over_loads
from michell_cad.strength.mechanism import leave_out_loose_parts
from michell_cad.strength.member_buckling import member_buckling_factors
from michell_cad.strength.pin_joints import pin_joint_residual
from michell_cad.strength.strengthen import size_for_loads
from michell_cad.strength.strengthen_options import StrengthenOptions
from michell_cad.truss import SizedTruss, Truss

GRID_CELLS = (4, 6, 8)
"""Cells of the grids along the longest side of the part."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A truss with radii whose proportions count; the comparison scales them."""

    name: str
    sized: SizedTruss


@dataclass(frozen=True)
class Row:
    """Figures of one candidate; factors are of the given loads.

    Parameters
    ----------
    name, members : of the candidate.
    yield_factor : at first yield.
    member_buckling, frame_buckling : at which a member, or the frame of all, buckles; None if nothing does.
    off_axis_yield : at first yield, the worst of the loads tilted to four sides.
    compliance : f . u, N mm.
    force_path : sum |N| L over the strength, mm^3: the least volume of a pin-jointed truss of these forces.
    mass_g, volume_fraction : of the union.
    pin_joint_residual : share of the loads that axial forces alone cannot carry.
    """

    name: str
    members: int
    yield_factor: float
    member_buckling: float | None
    frame_buckling: float | None
    off_axis_yield: float
    compliance: float
    force_path: float
    mass_g: float
    volume_fraction: float
    pin_joint_residual: float


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


def standard_rivals(
    problem: DesignProblem, options: StrengthenOptions, sizes: Sequence[int] = GRID_CELLS
) -> list[Candidate]:
    """Grids of several sizes, plain and braced, one braced at 45 degrees, and a ground structure between their nodes.

    With `options.size_by` the grids are sized as the design is, at an equal sum of member volumes.
    """
    extent = np.ptp(problem.mesh.vertices, axis=0)
    found = []
    for size in sizes:
        a, b, c = np.maximum(np.rint(extent / extent.max() * size), 1).astype(int).tolist()
        for braced in (False, True):
            name = f"grid {a}x{b}x{c}" + (" braced" if braced else "")
            found.append(Candidate(name, _equal(problem, regular_grid(problem.mesh, (a, b, c), braced=braced))))
    a, b, c = np.maximum(np.rint(extent / extent.max() * sizes[-1]), 1).astype(int).tolist()
    axes = turned_axes(45.0, int(np.argsort(extent)[1]))
    turned = regular_grid(problem.mesh, (a, b, c), axes, braced=True)
    found.append(Candidate(f"grid {a}x{b}x{c} braced, 45 deg", _equal(problem, turned)))
    if options.size_by is not None:
        found = [Candidate(f"{item.name} sized", size_for_loads(problem, item.sized, options)) for item in found]
    return [*found, ground_structure_candidate(problem, sizes[0])]


def ground_structure_candidate(problem: DesignProblem, size: int) -> Candidate:
    """The least-volume truss for the loads as given, between the nodes of a grid of `size` cells."""
    extent = np.ptp(problem.mesh.vertices, axis=0)
    a, b, c = np.maximum(np.rint(extent / extent.max() * size), 1).astype(int).tolist()
    grid = regular_grid(problem.mesh, (a, b, c))
    found = optimal_ground_structure(
        grid.nodes, carry_over_loads(problem, grid), problem.material.yield_strength, problem.mesh
    )
    radii: Float[np.ndarray, " n_m"] = np.sqrt(found.areas / np.pi)
    return Candidate(f"ground s. {a}x{b}x{c}", SizedTruss(found.truss, np.repeat(radii[:, None], 3, axis=1)))


def _equal(problem: DesignProblem, truss: Truss) -> SizedTruss:
    """Equal members, a tenth of the part in all."""
    r = np.sqrt(0.1 * problem.mesh.volumes.sum() / (np.pi * truss.lengths.sum()))
    return SizedTruss(truss, np.full((len(truss.members), 3), r))
