"""Parts in voxels: which are inside, what holds them, and that loads arrive whole."""

from dataclasses import replace

import numpy as np
import pytest
from shapes import ABS, cantilever, joined_boxes, tube_mesh, turned

from michell_cad import build_problem, read_part
from michell_cad.errors import InvalidInputError
from michell_cad.job import Setup
from michell_cad.problem import DesignProblem, LoadCase
from michell_cad.rotations import rotation_matrix
from michell_cad.strength.comparison import voxel_surface
from michell_cad.strength.comparison.voxel_model import build_voxel_model, carry_over_forces

TURN = rotation_matrix(np.array([0.3, -0.8, 0.5]))


def resultants(points, forces):
    return np.concatenate([forces.sum(1), np.cross(points, forces).sum(1)], axis=1)


def tube_problem(load=(3.0, -2.0, 5.0)):
    """A tube, held at z = 0, loaded on its other end."""
    mesh = tube_mesh((3, 32, 6), inner=6.0, outer=10.0, length=30.0)
    z = mesh.vertices[:, 2]
    fixed = np.repeat((z == 0)[:, None], 3, axis=1)
    return DesignProblem(mesh, ABS, fixed, (LoadCase("end", np.where((z == 30)[:, None], np.array(load), 0.0)),))


def test_a_box_is_filled_and_held_on_its_face():
    problem = cantilever((8, 4, 4))
    model = build_voxel_model(problem, 128)
    assert model.volume == pytest.approx(80 * 40 * 40)
    np.testing.assert_allclose(model.edges, 10)
    np.testing.assert_array_equal(model.held.all(1), model.nodes[:, 0] == 0)
    assert not (model.held.any(1) & ~model.held.all(1)).any()
    # Vertices are nodes here: they keep their forces.
    order = np.lexsort(problem.mesh.vertices.T[::-1])
    np.testing.assert_allclose(model.nodes, problem.mesh.vertices[order], atol=1e-9)
    np.testing.assert_allclose(model.forces[0], problem.load_cases[0].force[order], atol=1e-9)


@pytest.mark.parametrize("problem", [tube_problem(), turned(cantilever((8, 4, 4)), TURN)], ids=["tube", "turned"])
def test_volumes_converge_and_resultants_are_exact(problem):
    exact = problem.mesh.volumes.sum()
    for count, off in ((400, 0.15), (20000, 0.01)):
        model = build_voxel_model(problem, count)
        assert model.volume == pytest.approx(exact, rel=off)
        assert len(model.corners) == pytest.approx(count, rel=0.1)
        wanted = resultants(problem.mesh.vertices, problem.load_cases[0].force[None])
        np.testing.assert_allclose(resultants(model.nodes, model.forces), wanted, atol=1e-9 * np.abs(wanted).max())
    held = problem.mesh.vertices[problem.fixed.all(1)]
    normal = np.linalg.svd(held - held.mean(0))[2][2]
    assert np.abs((model.nodes[model.held.all(1)] - held.mean(0)) @ normal).max() < model.edges.max()


def test_held_components_by_axis():
    problem = cantilever((8, 4, 4))
    fixed = problem.fixed.copy()
    fixed[problem.mesh.vertices[:, 2] == 0, 1] = True
    model = build_voxel_model(replace(problem, fixed=fixed), 128)
    np.testing.assert_array_equal(model.held[:, 1], (model.nodes[:, 0] == 0) | (model.nodes[:, 2] == 0))
    np.testing.assert_array_equal(model.held[:, 0], model.nodes[:, 0] == 0)


def test_loads_that_act_at_once_are_one():
    problem = cantilever((8, 4, 4))
    (case,) = problem.load_cases
    cases = (case, LoadCase("half", -0.5 * case.force, 2.0))
    one = replace(problem, load_cases=(case, LoadCase("half", -0.25 * case.force, 2.0)))
    model = build_voxel_model(one, 128)
    np.testing.assert_allclose(model.forces[0].sum(0), [0, 0, -50.0], atol=1e-9)
    several = build_voxel_model(replace(problem, load_cases=cases, combination="envelope"), 128)
    assert several.names == ("end", "half")
    np.testing.assert_allclose(several.forces.sum(1), [[0, 0, -100], [0, 0, 50]], atol=1e-9)
    np.testing.assert_allclose(several.weights, [1, 2])


def test_pieces_that_nothing_holds_are_left_out():
    mesh = joined_boxes((20.0, 0.0, 0.0))
    x = mesh.vertices[:, 0]
    force = np.where((x == 8)[:, None], [[0.0, 0.0, -1.0]], 0.0)
    fixed = np.repeat(((x == 0) | (x == 20) | (x == 28))[:, None], 3, axis=1)
    both = build_voxel_model(DesignProblem(mesh, ABS, fixed, (LoadCase("end", force),)), 200)
    assert both.volume == pytest.approx(2 * 8 * 4 * 2, rel=0.1)
    assert len(np.unique(both.places[:, 0] > both.places[:, 0].mean())) == 2


def test_the_surface_is_closed_and_encloses_the_voxels():
    model = build_voxel_model(tube_problem(), 2000)
    triangles = voxel_surface(model, np.ones(len(model.corners), bool))
    a, b, c = model.nodes[triangles].transpose(1, 0, 2)
    assert np.einsum("td,td->", np.cross(a, b), c) / 6 == pytest.approx(model.volume)
    np.testing.assert_allclose(np.cross(b - a, c - a).sum(0), 0, atol=1e-9)
    some = np.zeros(len(model.corners), bool)
    some[[0, 7]] = True
    assert len(voxel_surface(model, some)) in (20, 24)


def test_refusals():
    problem = cantilever((8, 4, 4))
    with pytest.raises(InvalidInputError, match="number of voxels must be at least 1, found 0"):
        build_voxel_model(problem, 0)
    with pytest.raises(InvalidInputError, match=r"no voxel of .* mm has its centre in the part: use more voxels"):
        build_voxel_model(tube_problem(), 1)
    model = build_voxel_model(problem, 128)
    with pytest.raises(InvalidInputError, match=r"voxels: forces must have shape \(1, 225, 3\), found \(2, 225, 3\)"):
        replace(model, forces=np.zeros((2, 225, 3)), weights=np.ones(2))  # of one load case
    with pytest.raises(InvalidInputError, match="corners must be among the 225 nodes"):
        replace(model, corners=model.corners + 1)
    far = np.array([[80.0, 20.0, 60.0]])
    with pytest.raises(InvalidInputError, match=r"the load at \(80, 20, 60\) mm is 2.5 voxels away"):
        carry_over_forces(model, far, np.ones((1, 1, 3)))
    with pytest.raises(InvalidInputError, match="'end' acts on held nodes of voxels only"):
        carry_over_forces(model, np.zeros((1, 3)), np.ones((1, 1, 3)))
    # Three held vertices beside each other are one node of two large voxels.
    near = np.repeat((problem.mesh.vertices.sum(1) <= 10)[:, None], 3, axis=1)
    corner = replace(problem, fixed=near)
    assert build_voxel_model(corner, 128).held.all(1).sum() == 4
    with pytest.raises(InvalidInputError, match=r"no piece of the part in voxels of .* is kept in place"):
        build_voxel_model(corner, 2)


@pytest.mark.parametrize("name", ["quadcopter_frame", "jet_engine_bracket"])
def test_given_problems(data_folder, name):
    problem = build_problem(Setup(), read_part(data_folder / "problems" / f"{name}.npz"))
    model = build_voxel_model(problem, 6000)
    assert model.volume == pytest.approx(problem.mesh.volumes.sum(), rel=0.04)
    force = sum(case.weight * case.force for case in problem.load_cases)
    wanted = resultants(problem.mesh.vertices, force[None])
    scale = np.abs(force).sum() * np.array([1.0] * 3 + [np.abs(problem.mesh.vertices).max()] * 3)
    np.testing.assert_allclose(resultants(model.nodes, model.forces) / scale, wanted / scale, atol=1e-12)
