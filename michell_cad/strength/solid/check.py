"""Beams and solid of one truss under the same loads, side by side: how far to trust the beams."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from michell_cad.closed_mesh import ClosedMesh
from michell_cad.strength.beam_solution import BeamSolution
from michell_cad.strength.loads import TrussLoading
from michell_cad.strength.solid.solid_loading import carry_to_solid
from michell_cad.strength.solid.solid_mesh import mesh_solid
from michell_cad.strength.solid.solid_solution import SolidSolution, solve_solid
from michell_cad.truss import SizedTruss


@dataclass(frozen=True)
class SolidCheck:
    """Figures of a solid, and of the beams that stand for it.

    Parameters
    ----------
    tets, nodes : of the quadratic mesh.
    volume_mm3 : of the mesh.
    compliance_nmm, beam_compliance_nmm : f . u of all load cases with their weights.
    beam_over_solid_compliance : their ratio.
    peak_stress_mpa : largest von Mises stress of the solid, away from supports and loads.
    peak_at_mm, peak_case : where.
    beam_peak_stress_mpa : largest at the extreme fibres of the beams.
    solid_over_beam_peak : their ratio.
    displacement_mm : largest displacement.
    yield_factor : yield strength over the peak stress.
    """

    tets: int
    nodes: int
    volume_mm3: float
    compliance_nmm: float
    beam_compliance_nmm: float
    beam_over_solid_compliance: float
    peak_stress_mpa: float
    peak_at_mm: tuple[float, float, float]
    peak_case: str
    beam_peak_stress_mpa: float
    solid_over_beam_peak: float
    displacement_mm: float
    yield_factor: float


def check_solid(
    surface: ClosedMesh,
    beams: BeamSolution,
    sized: SizedTruss,
    loading: TrussLoading,
    size: float | None = None,
    progress: Callable[[float], None] = lambda fraction: None,
) -> tuple[SolidCheck, SolidSolution]:
    """Solve the solid of a truss under the loads of its beams, and compare.

    Parameters
    ----------
    surface : of the solid.
    beams : solved for the same truss and loading.
    sized, loading : the truss as built, and its supports and loads.
    size : of the tets, mm; default: from the members, see `solid_mesh`.
    progress : called with the finished fraction.

    Raises
    ------
    InvalidInputError, ConvergenceError
        As `mesh_solid` and `solve_solid`.
    """
    mesh = mesh_solid(surface, float(sized.radii.min()), size, lambda f: progress(0.3 * f))
    solid = solve_solid(mesh, beams.model.material, carry_to_solid(mesh, sized, loading))
    progress(0.9)
    stress = np.where(solid.loading.counted, solid.von_mises, 0)
    case, node = (int(k) for k in np.unravel_index(int(stress.argmax()), stress.shape))
    compliance = float(loading.weights @ solid.compliances)
    by_beams = float(loading.weights @ beams.compliances)
    peak, beam_peak = float(stress[case, node]), float(beams.peak_stress.max())
    x, y, z = mesh.nodes[node].tolist()
    check = SolidCheck(
        tets=len(mesh.tets),
        nodes=len(mesh.nodes),
        volume_mm3=float(mesh.volumes.sum()),
        compliance_nmm=compliance,
        beam_compliance_nmm=by_beams,
        beam_over_solid_compliance=by_beams / compliance,
        peak_stress_mpa=peak,
        peak_at_mm=(x, y, z),
        peak_case=loading.names[case],
        beam_peak_stress_mpa=beam_peak,
        solid_over_beam_peak=peak / beam_peak,
        displacement_mm=float(np.linalg.norm(solid.displacements, axis=2).max()),
        yield_factor=beams.model.material.yield_strength / peak,
    )
    progress(1.0)
    return check, solid
