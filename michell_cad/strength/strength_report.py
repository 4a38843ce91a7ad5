"""The short form of the strength report: what every design says about the truss that it delivers.

The beam model along the curves of the truss, loads and supports carried over from the part, linear. A part of the truss
that is loose carries nothing: it is left out and named. Members of a solid are as thick as the balls of their nodes
where these hide them, which brings compliance within a few per cent of the solid's; without balls stresses are looked
at up to the nodes. Members buckle as columns from node to node.
"""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from michell_cad.elasticity import StressField
from michell_cad.errors import InvalidInputError
from michell_cad.metrics import rms_shear
from michell_cad.parametrization import Parametrization
from michell_cad.problem import DesignProblem
from michell_cad.strength.beam_model import build_beam_model
from michell_cad.strength.beam_solver import solve_beams
from michell_cad.strength.braces import SHEAR_LIMIT
from michell_cad.strength.loads import TrussLoading, carry_over_loads
from michell_cad.strength.mechanism import leave_out_loose_parts
from michell_cad.strength.member_buckling import member_buckling_factors
from michell_cad.strength.pin_joints import pin_joint_residual
from michell_cad.truss import SizedTruss

NO_RESULTANT = 1e-6
"""Loads whose resultant is smaller than this (relative to the sum of their magnitudes) are couples."""


@dataclass(frozen=True)
class Place:
    """Where something is largest: curve, point (mm) and load case."""

    curve: str
    at_mm: tuple[float, float, float]
    case: str


@dataclass(frozen=True)
class StrengthReport:
    """Strength of one sized truss under the loads of its part.

    Parameters
    ----------
    displacement_mm : largest displacement of a node.
    displacement_at_mm : where.
    peak_stress_mpa : largest von Mises stress at the extreme fibre of a member.
    peak_stress : where.
    yield_factor : yield strength over the peak stress: the factor of the loads at first yield.
    first_yield_n : the resultant force at first yield, N; None for loads that are a couple.
    first_yield_nmm : the resultant moment at first yield of loads that are a couple, N mm; else None.
    buckling_factor : least factor of the loads at which a member buckles by itself (guided ends); None if no member is
        in compression.
    buckling : where.
    compliance_nmm : f . u of all load cases with their weights, N mm.
    compliance_over_solid : the same over that of the solid part.
    mass_g, solid_mass_g, mass_share : of the truss, of the solid part, and their ratio.
    pin_joint_residual : share of the loads that axial forces alone cannot carry, the worst case.
    rms_frame_shear : root mean square of the shear stress in the frame of the curves, relative to |dev sigma|.
    """

    displacement_mm: float
    displacement_at_mm: tuple[float, float, float]
    peak_stress_mpa: float
    peak_stress: Place
    yield_factor: float
    first_yield_n: float | None
    first_yield_nmm: float | None
    buckling_factor: float | None
    buckling: Place | None
    compliance_nmm: float
    compliance_over_solid: float
    mass_g: float
    solid_mass_g: float
    mass_share: float
    pin_joint_residual: float
    rms_frame_shear: float


def measure_strength(
    problem: DesignProblem,
    stress_field: StressField,
    parametrization: Parametrization,
    sized: SizedTruss,
    volume: float | None = None,
    joints: Float[np.ndarray, " n_n"] | None = None,
) -> tuple[StrengthReport, list[str]]:
    """Measure the strength of a truss; returns the report and notes on what a user should know about it.

    Parameters
    ----------
    problem, stress_field, parametrization : of the part.
    sized : the truss as it is built.
    volume : of its solid, mm^3; default: the sum over the members, which counts nodes several times.
    joints : radii of the balls at its nodes, mm; default: none.

    Raises
    ------
    InvalidInputError
        If no part of the truss is supported, or no load acts on it.
    """
    sized, loose = leave_out_loose_parts(problem, sized)
    truss, material = sized.truss, problem.material
    loading = carry_over_loads(problem, truss)
    columns = build_beam_model(sized, material, straight=False)
    model = build_beam_model(sized, material, straight=False, joints=joints)
    solution = solve_beams(model, loading)
    peak_case, peak_element, peak_section = _place_of_largest(solution.von_mises)
    peak = float(solution.von_mises[peak_case, peak_element, peak_section])
    factors = member_buckling_factors(solution, columns)
    bent_case, bent = (int(i) for i in np.unravel_index(int(np.argmin(factors)), factors.shape))
    buckles = bool(np.isfinite(factors).any())
    moved = np.linalg.norm(solution.displacements[:, :, :3], axis=2)
    furthest = model.nodes[np.argmax(moved.max(0))]
    factor = material.yield_strength / peak
    force, moment = load_size(truss.nodes, loading, peak_case)
    compliance = float(loading.weights @ solution.compliances)
    volume = columns.volume if volume is None else volume
    solid_volume = float(problem.mesh.volumes.sum())

    def place(member: int, x: np.ndarray, case: int) -> Place:
        return Place(truss.curves[truss.curve_of_member[member]].name, _point(x), loading.names[case])

    report = StrengthReport(
        displacement_mm=float(moved.max()),
        displacement_at_mm=_point(furthest),
        peak_stress_mpa=peak,
        peak_stress=place(
            int(model.member_of_element[peak_element]), model.points[peak_element, peak_section], peak_case
        ),
        yield_factor=factor,
        first_yield_n=None if force is None else factor * force,
        first_yield_nmm=None if force is not None else factor * moment,
        buckling_factor=float(factors.min()) if buckles else None,
        buckling=place(bent, truss.nodes[truss.members[bent]].mean(0), bent_case) if buckles else None,
        compliance_nmm=compliance,
        compliance_over_solid=compliance / solid_compliance(problem, stress_field),
        mass_g=volume * material.density,
        solid_mass_g=solid_volume * material.density,
        mass_share=volume / solid_volume,
        pin_joint_residual=float(pin_joint_residual(truss, loading).max()),
        rms_frame_shear=rms_shear(problem.mesh, stress_field.stress, parametrization.tangents),
    )
    return report, [*loose, *_warnings(report)]


def strength_block(
    problem: DesignProblem,
    stress_field: StressField,
    parametrization: Parametrization,
    sized: SizedTruss,
    volume: float | None = None,
    joints: Float[np.ndarray, " n_n"] | None = None,
) -> tuple[dict[str, Any] | None, list[str]]:
    """`measure_strength` as plain values; None, with the reason among the notes, for a truss that carries nothing."""
    try:
        report, notes = measure_strength(problem, stress_field, parametrization, sized, volume, joints)
    except InvalidInputError as error:
        return None, [f"no strength report: {error}"]
    return asdict(report), notes


def load_size(nodes: Float[np.ndarray, "n_n 3"], loading: TrussLoading, case: int) -> tuple[float | None, float]:
    """Magnitudes of the resultant force, N (None for a couple), and of the moment about the loads' centre, N mm."""
    forces, moments = loading.forces[case, :, :3], loading.forces[case, :, 3:]
    sizes = np.linalg.norm(forces, axis=1)
    total = float(np.linalg.norm(forces.sum(0)))
    centre = sizes @ nodes / max(sizes.sum(), np.finfo(float).tiny)
    moment = float(np.linalg.norm((np.cross(nodes - centre, forces) + moments).sum(0)))
    return (total if total > NO_RESULTANT * sizes.sum() else None), moment


def solid_compliance(problem: DesignProblem, stress_field: StressField) -> float:
    """f . u of the solid part, N mm, combined like the load cases of the truss."""
    weights = np.array([case.weight for case in problem.load_cases])
    forces = np.array([case.force for case in problem.load_cases])
    u = stress_field.displacements
    if problem.combination == "sum":
        return float(np.einsum("c,cvd,k,kvd->", weights, forces, weights, u, optimize=True))
    return float(np.einsum("c,cvd,cvd->", weights, forces, u))


def _warnings(report: StrengthReport) -> list[str]:
    notes = []
    if report.rms_frame_shear > SHEAR_LIMIT:
        notes.append(
            f"the curves carry a shear of {report.rms_frame_shear:.2f} (rms, relative) by bending; above "
            f"{SHEAR_LIMIT:g} a grid with diagonals of the same volume is likely to be stiffer: add braces, or compare"
        )
    if report.yield_factor < 1:
        notes.append(
            f"the truss yields at {report.yield_factor:.3g} of the loads ({report.peak_stress.curve}): use thicker "
            "members or a stronger material"
        )
    if report.buckling_factor is not None and report.buckling_factor < 1:
        assert report.buckling is not None
        notes.append(
            f"a member buckles at {report.buckling_factor:.3g} of the loads ({report.buckling.curve}): use thicker or "
            "shorter members"
        )
    return notes


def _place_of_largest(values: Float[np.ndarray, "n_c n_e k"]) -> tuple[int, int, int]:
    case, element, section = np.unravel_index(int(np.argmax(values)), values.shape)
    return int(case), int(element), int(section)


def _point(x: np.ndarray) -> tuple[float, float, float]:
    a, b, c = x.tolist()
    return a, b, c
