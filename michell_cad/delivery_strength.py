"""From a design file to what a structural engineer asks for: stresses in a picture, figures, and decks for solvers."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from michell_cad.arrays import require
from michell_cad.building import Progress, build_united, size_finished
from michell_cad.cad import BuiltSolid
from michell_cad.delivery import require_place
from michell_cad.design_file import load_saved
from michell_cad.files import writing_folder
from michell_cad.picture import StressedBalls, render_member_stress, render_solid_stress
from michell_cad.strength import (
    BeamSolution,
    TrussLoading,
    build_beam_model,
    carry_over_loads,
    measure_strength,
    solve_beams,
)
from michell_cad.strength.beam_deck import write_beam_deck
from michell_cad.strength.mechanism import leave_out_loose_parts
from michell_cad.strength.solid import SolidCheck, SolidSolution, check_solid, write_solid_deck
from michell_cad.truss import SizedTruss, member_radius

REPORT_FILE, PICTURE_FILE = "strength.json", "stress.png"
BEAM_DECK, ABAQUS_DECK, SOLID_DECK = "beams.inp", "beams_abaqus.inp", "solid.inp"

DECK_PIECES = 4
"""Elements of a member in the decks, whose beams are prismatic, and straight or nearly so."""

SCALE_QUANTILE = 0.999
"""The colours end at the stress that all but this share stay below; the peak itself is a spot, and stated."""


def deliver_strength(
    design_file: str | Path,
    folder: str | Path,
    solid: bool = False,
    size: float | None = None,
    force: bool = False,
    progress: Progress = lambda stage, fraction: None,
) -> dict[str, Any]:
    """Measure the strength of a finished design and write picture, report and decks to `folder`; returns the report.

    Parameters
    ----------
    design_file : the file, or the folder that `design` or `edit` wrote.
    folder : for the results.
    solid : whether the solid is checked by quadratic tets as well; minutes, where beams take seconds.
    size : of the tets, mm; default: from the members.
    force : whether to write into a folder that exists.
    progress : called with the name of a stage and the finished fraction of it.

    Raises
    ------
    InvalidInputError
        For a bad design file or folder, joined trusses, a size that does not fit, or, with `solid`, loose parts.
    ConvergenceError, GeometryKernelError
        If no solid comes out, or its equations cannot be solved.
    """
    path, folder = Path(design_file), Path(folder)
    require(solid or size is None, "--size is that of the tets of the solid: give --solid as well")
    require_place(folder, force)
    saved = load_saved(path)
    structure = saved.replay()
    require(not structure.joined, "the strength of joined trusses is not known: the loads are those of one part only")
    design = structure.design
    with writing_folder(folder) as partial:
        built = build_united(structure, size_finished(structure), progress)
        progress("beams", 0.0)
        sized, loose = leave_out_loose_parts(design.problem, built.sized)
        joints = built.node_balls
        loading = carry_over_loads(design.problem, sized.truss)
        material = design.problem.material
        beams = solve_beams(build_beam_model(sized, material, straight=False, joints=joints), loading)
        short, notes = measure_strength(
            design.problem, design.stress_field, design.parametrization, sized, built.report.volume_mm3, joints
        )
        report: dict[str, Any] = {"strength": asdict(short), "solid_check": None, "notes": [*loose, *notes]}
        _write_beam_decks(partial, sized, beams, loading)
        progress("beams", 1.0)
        if solid:
            require(not loose, f"the solid cannot be checked: {'; '.join(loose)}")
            check, solution = _check(built, beams, sized, loading, size, progress)
            report["solid_check"] = asdict(check)
            write_solid_deck(partial / SOLID_DECK, solution.mesh, material, solution.loading)
            _draw_solid(partial / PICTURE_FILE, check, solution, saved.up)
        else:
            _draw_members(partial / PICTURE_FILE, beams, sized, joints, saved.up)
        text = json.dumps(report, indent=1, allow_nan=False) + "\n"
        (partial / REPORT_FILE).write_text(text, encoding="utf-8")
    return report


def _check(
    built: BuiltSolid,
    beams: BeamSolution,
    sized: SizedTruss,
    loading: TrussLoading,
    size: float | None,
    progress: Progress,
) -> tuple[SolidCheck, SolidSolution]:
    return check_solid(built.mesh, beams, sized, loading, size, lambda f: progress("solid check", f))


def _write_beam_decks(folder: Path, sized: SizedTruss, beams: BeamSolution, loading: TrussLoading) -> None:
    model = build_beam_model(sized, beams.model.material, straight=False, pieces=DECK_PIECES)
    write_beam_deck(folder / BEAM_DECK, model, loading, "U1")
    write_beam_deck(folder / ABAQUS_DECK, model, loading, "B32")


def _draw_solid(path: Path, check: SolidCheck, solution: SolidSolution, up: int) -> None:
    stress = solution.von_mises.max(0)
    top = float(np.quantile(stress[solution.loading.counted], SCALE_QUANTILE))
    x, y, z = check.peak_at_mm
    notes = (
        f"{check.tets:,} quadratic tets; peak {check.peak_stress_mpa:.3g} MPa at ({x:.4g}, {y:.4g}, {z:.4g}) mm",
        f"{solution.material.name} yields at {solution.material.yield_strength:g} MPa: "
        f"at {check.yield_factor:.3g} of the loads",
    )
    render_solid_stress(path, solution.mesh.nodes, solution.mesh.boundary, stress, top, notes=notes, up=up)


def _draw_members(path: Path, beams: BeamSolution, sized: SizedTruss, joints: np.ndarray, up: int) -> None:
    model, stress = beams.model, beams.von_mises.max(0)
    top = float(np.quantile(stress, SCALE_QUANTILE))
    notes = (
        f"{len(model.elements):,} beams, extreme fibre; peak {stress.max():.3g} MPa",
        f"{model.material.name} yields at {model.material.yield_strength:g} MPa: "
        f"at {model.material.yield_strength / stress.max():.3g} of the loads",
    )
    members = sized.truss.members
    at_nodes = np.zeros(len(joints))
    np.maximum.at(at_nodes, members, stress[:, [0, -1]])
    used = np.flatnonzero(joints > 0)
    balls = StressedBalls(sized.truss.nodes[used], joints[used], at_nodes[used])
    radii = member_radius(sized.radii[:, None], model.stations)
    render_member_stress(path, model.points, radii, stress, balls, top, notes=notes, up=up)
