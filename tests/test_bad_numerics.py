"""Meshes and loads that go wrong elsewhere: each gives a valid truss or one refusal that says what to do.

Warnings are errors in this suite, so a division by zero or a silent NaN fails these tests, too.
"""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from networks import check_network
from shapes import ABS, box_mesh, cantilever, joined_boxes

from michell_cad.elasticity import StressField
from michell_cad.errors import InvalidInputError
from michell_cad.frame_field import fit_frame_field
from michell_cad.isocurves import trace_isocurves
from michell_cad.metrics import shear_residual
from michell_cad.parametrization import ParametrizationOptions, parametrize
from michell_cad.parametrization.equation_11 import SMALLEST_WEIGHT, STIFFEST, tet_weights
from michell_cad.pipeline import Design, DesignOptions, design
from michell_cad.problem import DesignProblem, LoadCase, Material, surface_pressure
from michell_cad.report import report_design
from michell_cad.tet_mesh import TetMesh

CELLS, SIZE = (6, 3, 3), (80.0, 40.0, 40.0)


def bar_of(mesh: TetMesh, held: np.ndarray | None = None, loaded: np.ndarray | None = None) -> DesignProblem:
    """A part clamped at x = 0, or where `held`, and pulled down at its highest x, or where `loaded`."""
    x = mesh.vertices[:, 0]
    held = np.isclose(x, 0, atol=1e-6) if held is None else held
    loaded = np.isclose(x, x.max()) if loaded is None else loaded
    force = np.where(loaded[:, None], [[0.0, 0.0, -10.0]], 0.0)
    return DesignProblem(mesh, ABS, np.repeat(held[:, None], 3, axis=1), (LoadCase("pull", force),))


def require_valid(result: Design) -> dict:
    """What holds for every design that is not refused; returns its report."""
    check_network(result.network)
    report = report_design(result, result.truss)
    assert report["parametrization"]["inverted_tets"] == 0
    assert report["parametrization"]["double_wound_edges"] == 0
    assert report["truss"]["interior_degree_6"] == 1.0
    assert report["truss"]["duplicate_members"] == 0
    assert np.isfinite([v for v in report["alignment"].values() if isinstance(v, float)]).all()
    assert np.isfinite(result.truss.nodes).all()
    return report


def options_of(resolution: float = 6.0, follow_stress: bool = True) -> DesignOptions:
    return DesignOptions(
        resolution=resolution, parametrization=ParametrizationOptions(0.1, follow_stress=follow_stress)
    )


# --- slivers ---------------------------------------------------------------------------------------------------------


def with_inner_slivers(ratio: float, every: int) -> TetMesh:
    """A box some of whose tets are cut in four by a point that lies `ratio` of their height above a face."""
    box = box_mesh(CELLS, SIZE)
    points, tets = [box.vertices], box.tets.copy()
    extra = []
    for number, t in enumerate(range(0, len(tets), every)):
        a, b, c, d = tets[t]
        v = len(box.vertices) + number
        points.append([(1 - ratio) * box.vertices[[a, b, c]].mean(0) + ratio * box.vertices[d]])
        tets[t] = a, b, c, v
        extra += [[a, b, v, d], [b, c, v, d], [c, a, v, d]]
    return TetMesh(np.concatenate(points), np.concatenate([tets, extra]))


def with_flat_caps(height: float) -> TetMesh:
    """A box with a flat tet (mm high) on every seventh triangle of its boundary."""
    box = box_mesh(CELLS, SIZE)
    triangles = box.boundary_triangles[::7]
    area_vectors = box.boundary_area_vectors[::7]
    normals = area_vectors / np.linalg.norm(area_vectors, axis=1, keepdims=True)
    points = box.vertices[triangles].mean(1) + height * normals
    caps = np.column_stack([triangles, len(box.vertices) + np.arange(len(points))])
    return TetMesh(np.concatenate([box.vertices, points]), np.concatenate([box.tets, caps]))


def with_a_flattened_tet(ratio: float) -> TetMesh:
    """A box one of whose vertices was pushed to `ratio` of its height above the opposite face of a tet."""
    box = box_mesh(CELLS, SIZE)
    top, a, b, c = box.tets[100]
    normal = np.cross(box.vertices[b] - box.vertices[a], box.vertices[c] - box.vertices[a])
    normal /= np.linalg.norm(normal)
    vertices = box.vertices.copy()
    vertices[top] -= (1 - ratio) * (normal @ (vertices[top] - vertices[a])) * normal
    return TetMesh(vertices, box.tets)


SLIVERS: dict[str, Callable[[], TetMesh]] = {
    "few": lambda: with_inner_slivers(1e-8, 81),
    "many": lambda: with_inner_slivers(1e-8, 3),
    "extreme": lambda: with_inner_slivers(1e-11, 81),
    "caps": lambda: with_flat_caps(1e-7),
    "vertex": lambda: with_a_flattened_tet(1e-8),
}


@pytest.mark.parametrize("follow", [False, True])
@pytest.mark.parametrize("kind", SLIVERS)
def test_slivers_do_no_harm(kind, follow):
    mesh = SLIVERS[kind]()
    assert mesh.volumes.min() < 2e-8 * mesh.volumes.mean()
    report = require_valid(design(bar_of(mesh), options_of(follow_stress=follow)))
    clean = design(bar_of(box_mesh(CELLS, SIZE)), options_of(follow_stress=follow))
    # Slivers may cost some quality, above all in Eq. 11 where a third of all tets was cut.
    extra = 0.03 if follow else 0.3
    assert report["alignment"]["curve_shear_residual"] < clean.alignment.curve_shear_residual + extra


def test_weights_of_slivers():
    """Weights are at least a tenth, up to slivers so steep that their stiffness alone would break the systems."""
    mesh = with_inner_slivers(1e-4, 81)
    assert tet_weights(mesh).min() == SMALLEST_WEIGHT
    extreme = with_inner_slivers(1e-8, 81)
    weights = tet_weights(extreme)
    assert weights.min() < SMALLEST_WEIGHT
    assert (weights >= extreme.volumes / extreme.volumes.mean()).all()
    steep = (extreme.hat_gradients**2).sum(2).max(1)
    assert (weights * steep).max() <= 1.001 * STIFFEST * np.median(steep)


def test_flat_tets_are_refused():
    box = box_mesh(CELLS, SIZE)
    with pytest.raises(InvalidInputError, match=r"must have volume; 1 are flat, first tet 324"):
        TetMesh(box.vertices, np.concatenate([box.tets, [[0, 1, 2, 3]]]))


# --- several parts ---------------------------------------------------------------------------------------------------


def test_a_floating_part_is_refused():
    mesh = joined_boxes((0.0, 100.0, 0.0), CELLS, SIZE)
    held = (mesh.vertices[:, 0] == 0) & (mesh.vertices[:, 1] < 50)
    with pytest.raises(InvalidInputError, match=r"nothing holds it \(part 2 of 2, around \(40, 120, 20\) mm\)"):
        bar_of(mesh, held)


@pytest.mark.parametrize("follow", [False, True])
@pytest.mark.parametrize("gap", [0.0, 1e4])
def test_two_held_parts_are_two_trusses_whatever_lies_between_them(gap, follow):
    """Each part gets the truss that it would have alone; only one of them loaded, the other gets an even grid."""
    alone = design(bar_of(box_mesh(CELLS, SIZE)), options_of(follow_stress=follow))
    mesh = joined_boxes((0.0, 41.0 + gap, 0.0), CELLS, SIZE)
    report = require_valid(design(bar_of(mesh), options_of(follow_stress=follow)))
    assert report["truss"]["components"] == 2
    assert report["truss"]["spacing_mm"] == pytest.approx(alone.truss.spacing, rel=0.05)
    assert report["alignment"]["curve_shear_residual"] == pytest.approx(alone.alignment.curve_shear_residual, rel=0.05)
    first = (mesh.vertices[:, 1] <= 40) & (mesh.vertices[:, 0] == 80)
    report = require_valid(design(bar_of(mesh, loaded=first), options_of(follow_stress=follow)))
    assert report["truss"]["components"] == 2


def test_parts_of_very_different_size():
    box = box_mesh(CELLS, SIZE)
    vertices = np.concatenate([box.vertices, 1e-3 * box.vertices + [0.0, 100.0, 0.0]])
    mesh = TetMesh(vertices, np.concatenate([box.tets, box.tets + len(box.vertices)]))
    require_valid(design(bar_of(mesh), options_of()))


def test_overlapping_tets_are_named():
    """A vertex moved across its neighbours: the tets are turned to positive volume, but fill the place twice."""
    box = box_mesh(CELLS, SIZE)
    vertices = box.vertices.copy()
    inner = np.setdiff1d(np.arange(len(vertices)), box.boundary_vertices)[0]
    vertices[inner] += [30.0, 0, 0]
    with pytest.raises(InvalidInputError, match=r"the tets of the mesh overlap"):
        design(bar_of(TetMesh(vertices, box.tets)), options_of())


@pytest.mark.parametrize("shift", [(80.0, 0.0, 40.0), (80.0, 40.0, 40.0)])
def test_parts_that_share_an_edge_or_a_point(shift):
    """Held at one end they are a mechanism, refused with its motion; held at both ends they are a design."""
    mesh = joined_boxes(shift, CELLS, SIZE)
    with pytest.raises(InvalidInputError, match=r"it can turn about .*part 2 of 2.*join them by faces"):
        bar_of(mesh)
    problem = bar_of(mesh, np.isin(mesh.vertices[:, 0], [0, 160]), mesh.vertices[:, 0] == 80)
    for follow in (False, True):
        require_valid(design(problem, options_of(follow_stress=follow)))


# --- stress without direction ----------------------------------------------------------------------------------------


def test_a_dangling_arm():
    """The half of the bar beyond the load is free of stress, up to what the smoothing leaves."""
    mesh = joined_boxes((80.0, 0.0, 0.0), CELLS, SIZE)
    result = design(bar_of(mesh, loaded=mesh.vertices[:, 0] == 40), options_of())
    require_valid(result)
    beyond = mesh.centroids[:, 0] > 120
    assert np.abs(result.stress_field.stress[beyond]).max() < 0.03 * np.abs(result.stress_field.stress).max()
    assert result.truss.nodes[:, 0].max() > 150


@pytest.mark.parametrize("follow", [False, True])
def test_pressure_from_all_sides_gives_an_even_grid(follow):
    """Held as a rigid body only, the stress is -p I up to rounding, and rounding is nothing to follow."""
    mesh = box_mesh((5, 5, 5), (40.0, 40.0, 40.0))
    fixed = np.zeros(mesh.vertices.shape, bool)
    for corner, axes in (((0, 0, 0), [0, 1, 2]), ((40, 0, 0), [1, 2]), ((0, 40, 0), [2])):
        fixed[np.argmin(np.linalg.norm(mesh.vertices - corner, axis=1)), axes] = True
    force = surface_pressure(mesh, np.arange(len(mesh.boundary_triangles)), 3.0)
    result = design(DesignProblem(mesh, ABS, fixed, (LoadCase("water", force),)), options_of(follow_stress=follow))
    np.testing.assert_allclose(result.stress_field.stress, np.broadcast_to(-3 * np.eye(3), (750, 3, 3)), atol=1e-9)
    report = require_valid(result)
    np.testing.assert_allclose(result.parametrization.cell_edges, 1, rtol=1e-3)
    assert report["alignment"]["curve_shear_residual"] == 0
    assert report["alignment"]["uncarried_stress"] < 1e-9


@pytest.mark.parametrize("scale", [1e-30, 1.0, 1e30])
def test_noise_on_an_isotropic_stress_is_not_followed(scale):
    mesh = box_mesh((3, 3, 3), (3.0, 3.0, 3.0))
    noise = np.random.default_rng(0).normal(size=(len(mesh.tets), 3, 3))
    stress = scale * (np.eye(3) + 1e-11 * (noise + noise.swapaxes(1, 2)))
    field = StressField(stress, np.zeros((1, len(mesh.vertices), 3)), (0,), (0.0,), 0.0)
    result = parametrize(mesh, field, fit_frame_field(mesh, field))
    np.testing.assert_allclose(result.cell_edges, 1, atol=1e-3)
    assert shear_residual(mesh, stress, result.tangents) == 0


# --- hardly anything -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [1, 2])
def test_one_tet_and_two(n):
    vertices = np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10], [10, 10, 10]], float)[: 3 + n]
    mesh = TetMesh(vertices, np.array([[0, 1, 2, 3], [1, 2, 3, 4]])[:n])
    problem = bar_of(mesh, np.arange(3 + n) < 3, np.arange(3 + n) >= 3)
    for follow in (False, True):
        require_valid(design(problem, options_of(2.5, follow)))
    with pytest.raises(InvalidInputError, match=r"too fine for the mesh.*lower options\.resolution by a factor of"):
        design(problem, options_of(24.0))


def test_one_free_vertex():
    mesh = box_mesh((4, 2, 2), SIZE)
    free = np.arange(len(mesh.vertices)) == len(mesh.vertices) - 1
    require_valid(design(bar_of(mesh, ~free, free), options_of()))
    with pytest.raises(InvalidInputError, match="zero at every free vertex"):
        bar_of(mesh, ~free, ~free)


@pytest.mark.parametrize("poisson_ratio", [0.4999999999, -0.9999999999])
def test_extreme_materials(poisson_ratio):
    problem = cantilever(CELLS)
    material = Material("extreme", 1.0, poisson_ratio, 1e-3, 1.0)
    require_valid(design(DesignProblem(problem.mesh, material, problem.fixed, problem.load_cases), options_of()))


def test_meshes_of_no_sensible_size_are_refused():
    box = box_mesh((1, 1, 1))
    for size in (1e-200, 1e200, 1e308):
        with pytest.raises(InvalidInputError, match="check the unit"):
            TetMesh(size * (2 * box.vertices - 1), box.tets)


def test_far_from_the_origin():
    box = box_mesh(CELLS, SIZE)
    near, far = (
        design(bar_of(TetMesh(box.vertices + shift, box.tets), box.vertices[:, 0] == 0), options_of())
        for shift in (0.0, 1e6)
    )
    require_valid(far)
    assert far.alignment.curve_shear_residual == pytest.approx(near.alignment.curve_shear_residual, rel=0.02)


def test_a_grid_that_misses_the_part():
    """No integer of any coordinate in the part: only its sharp edges are left."""
    mesh = box_mesh((1, 1, 1))
    network = trace_isocurves(mesh, 0.25 + 0.5 * mesh.vertices)
    assert {curve.family for curve in network.curves} == {"feature"}


# --- through the command line ----------------------------------------------------------------------------------------


def run_job(folder: Path, problem: DesignProblem | None, mesh: TetMesh, resolution: float = 5.0) -> tuple[int, str]:
    """Write a problem (or a mesh alone) as .npz in metres and design it; the exit code and all that was printed."""
    arrays = {"vertices": mesh.vertices / 1000, "tets": mesh.tets}
    if problem is not None:
        arrays |= {"fixed": problem.fixed[:, 0], "force": problem.load_cases[0].force}
    else:
        low = mesh.vertices[:, 0] == 0
        arrays |= {"fixed": low, "force": np.where(low[:, None], 0, [[0.0, 0, -1.0]])}
    np.savez(folder / "part.npz", **arrays)
    (folder / "job.toml").write_text(
        f'[part]\nfile = "part.npz"\n[options]\nresolution = {resolution}\n'
        '[output]\nformats = ["stl"]\npreview = false\n'
    )
    command = [sys.executable, "-m", "michell_cad.cli", "design", "job.toml", "--out", "results"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert "Traceback" not in done.stderr
    assert "Warning" not in done.stderr
    assert (folder / "results").is_dir() == (done.returncode == 0)
    return done.returncode, done.stderr


@pytest.mark.parametrize(
    "mesh", [with_inner_slivers(1e-8, 3), joined_boxes((0.0, 100.0, 0.0), CELLS, SIZE)], ids=["slivers", "two parts"]
)
def test_the_command_line_designs_slivers_and_several_parts(mesh, tmp_path):
    assert run_job(tmp_path, bar_of(mesh), mesh) == (0, "")


def test_the_command_line_refuses_a_hinge_in_one_line(tmp_path):
    code, text = run_job(tmp_path, None, joined_boxes((80.0, 0.0, 40.0), CELLS, SIZE))
    assert code == 2
    assert text.startswith("michell-cad: the supports leave the part free to move: it can turn about y (part 2 of 2")
    assert text.count("\n") == 1
