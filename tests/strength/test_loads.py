import numpy as np
import pytest
from frames import frame
from hypothesis import given, settings
from hypothesis import strategies as st
from shapes import ABS, box_mesh, cantilever

from michell_cad.errors import InvalidInputError
from michell_cad.problem import DesignProblem, LoadCase, self_weight
from michell_cad.strength.loads import (
    TrussLoading,
    add_off_axis_cases,
    carry_over_loads,
    held_nodes,
    locate,
    spread_forces,
)


def resultant(points, forces, moments=0.0) -> np.ndarray:
    return np.concatenate([forces.sum(0), (np.cross(points, forces) + moments).sum(0)])


def line(nodes):
    """A truss that runs through the nodes one after the other."""
    return frame(nodes, [(i, i + 1) for i in range(len(nodes) - 1)]).truss


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n_nodes=st.integers(1, 30), flat=st.integers(0, 2))
def test_resultants_are_exact(seed, n_nodes, flat):
    """For nodes anywhere, in a plane, and in a line."""
    rng = np.random.default_rng(seed)
    points, forces = rng.normal(size=(12, 3)), rng.normal(size=(2, 12, 3))
    nodes = rng.normal(size=(n_nodes, 3)) * (np.arange(3) < 3 - flat) + 0.3
    spread = spread_forces(points, forces, nodes)
    for force, got in zip(forces, spread, strict=True):
        np.testing.assert_allclose(
            resultant(nodes, got[:, :3], got[:, 3:]), resultant(points, force), atol=1e-11 * np.abs(forces).sum()
        )


def test_a_force_on_a_node_stays_near_and_needs_no_moments():
    nodes = np.stack(np.meshgrid(*[np.arange(5.0)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    spread = spread_forces(np.array([[2.0, 2.0, 2.0]]), np.array([[[0.0, 0.0, 1.0]]]), nodes)[0]
    touched = np.flatnonzero((spread != 0).any(1))
    assert np.linalg.norm(nodes[touched] - 2, axis=1).max() <= np.sqrt(2)
    assert spread[62, 2] == spread[:, 2].max()
    assert np.array_equal(spread[:, 3:], np.zeros((125, 3)))


def test_moments_that_forces_in_a_line_cannot_make():
    nodes = np.stack([np.arange(3.0), np.zeros(3), np.zeros(3)], axis=1)
    spread = spread_forces(np.array([[1.0, 0.5, 0.0]]), np.array([[[0.0, 0.0, 2.0]]]), nodes)[0]
    np.testing.assert_allclose(spread[:, 3:].sum(0), [1.0, 0, 0], atol=1e-15)
    np.testing.assert_allclose(spread[:, 2].sum(), 2.0)


def test_points_are_located():
    mesh = box_mesh((3, 2, 2))
    rng = np.random.default_rng(1)
    tets, barycentric = locate(mesh, rng.random((200, 3)))
    assert barycentric.min() > -1e-12
    x = np.einsum("na,nad->nd", barycentric, mesh.vertices[mesh.tets[tets]])
    np.testing.assert_allclose(x, np.random.default_rng(1).random((200, 3)), atol=1e-14)
    # Far from the nearest centroids, and outside.
    slab = box_mesh((40, 1, 1), (1.0, 30.0, 30.0))
    tets, barycentric = locate(slab, np.array([[0.51, 0.1, 0.1], [0.5, -2.0, 3.0]]))
    assert barycentric[0].min() > -1e-12
    assert barycentric[1].min() < 0


def test_nodes_on_a_clamped_face_are_clamped():
    problem = cantilever((4, 2, 2))
    truss = line(np.array([[0, 0, 0], [0, 17, 23], [0, 40, 20], [9, 17, 23], [80, 20, 20]], float))
    held = held_nodes(problem, truss)
    assert held[:3].all()
    assert not held[3:].any()


def test_a_sliding_face_holds_its_normal_and_the_turns_that_tilt_it():
    problem = cantilever((4, 2, 2))
    fixed = problem.fixed.copy()
    fixed[problem.mesh.vertices[:, 0] == 0, 1:] = False  # slides in y and z
    fixed[np.argmin(problem.mesh.vertices.sum(1))] = True  # but for one corner, at the origin,
    fixed[problem.mesh.vertices[:, 0] == 80, 1] = True  # and the far end does not move in y
    problem = DesignProblem(
        problem.mesh, ABS, fixed, (LoadCase("x", np.where(problem.mesh.vertices[:, :1] == 80, [1.0, 0, 0], 0)),)
    )
    held = held_nodes(problem, line(np.array([[0, 0, 0], [0, 31, 23], [80, 5, 5]], float)))
    np.testing.assert_array_equal(held[0], [True, True, True, False, True, True])
    np.testing.assert_array_equal(held[1], [True, False, False, False, True, True])
    np.testing.assert_array_equal(held[2], [False, True, False, True, False, False])


def test_a_held_edge_is_a_hinge():
    problem = cantilever((4, 2, 2))
    V = problem.mesh.vertices
    fixed = np.repeat(((V[:, 0] == 0) & (V[:, 2] == 0))[:, None], 3, axis=1)
    fixed[V[:, 0] == 80, 2] = True
    problem = DesignProblem(problem.mesh, ABS, fixed, (LoadCase("x", np.where(V[:, :1] == 80, [1.0, 0, 0], 0)),))
    held = held_nodes(problem, line(np.array([[0, 13, 0], [40, 20, 20], [80, 5, 5]], float)))
    np.testing.assert_array_equal(held[0], [True, True, True, True, False, True])


def test_a_held_region_without_a_node_holds_the_nearest():
    problem = cantilever((4, 2, 2))
    V = problem.mesh.vertices
    far = V[:, 0] == 80
    fixed = np.repeat((far | (V == [0, 20, 20]).all(1))[:, None], 3, axis=1)
    problem = DesignProblem(problem.mesh, ABS, fixed, (LoadCase("x", np.where(far[:, None], 0, [1.0, 0, 0])),))
    nodes = np.array([[1, 20, 21], [2, 30, 20], [3, 15, 20], [20, 20, 20], [80, 20, 20]], float)
    held = held_nodes(problem, line(nodes))
    np.testing.assert_array_equal(held[:3], [[True, True, True, False, False, False]] * 3)  # one vertex is a pin
    assert not held[3].any()
    assert held[4].all()


def test_loads_of_a_problem():
    mesh = cantilever((4, 2, 2)).mesh
    clamped = np.repeat((mesh.vertices[:, 0] == 0)[:, None], 3, axis=1)
    cases = (
        LoadCase("pull", np.where(mesh.vertices[:, :1] == 80, [3.0, 0, 1.0], 0), 2.0),
        LoadCase("weight", self_weight(mesh, 1e-3, np.array([0, 0, -1.0])), 0.5),
    )
    truss = line(np.array([[0, 20, 20], [30, 5, 10], [50, 30, 35], [80, 20, 20], [80, 5, 30]], float))
    both = carry_over_loads(DesignProblem(mesh, ABS, clamped, cases, "sum"), truss)
    assert both.names == ("pull + weight",)
    total = 2.0 * cases[0].force + 0.5 * cases[1].force
    np.testing.assert_allclose(
        resultant(truss.nodes, both.forces[0, :, :3], both.forces[0, :, 3:]),
        resultant(mesh.vertices, total),
        atol=1e-11 * np.abs(total).sum() * 80,
    )
    either = carry_over_loads(DesignProblem(mesh, ABS, clamped, cases, "envelope"), truss)
    assert either.names == ("pull", "weight")
    np.testing.assert_array_equal(either.weights, [2.0, 0.5])
    np.testing.assert_allclose(either.forces[0, :, :3].sum(0), cases[0].force.sum(0), atol=1e-12)


def test_a_load_on_held_nodes_only_is_refused():
    problem = cantilever((4, 2, 2))
    truss = line(np.array([[0, 5, 5], [0, 30, 5], [0, 20, 30]], float))
    with pytest.raises(InvalidInputError, match="load case 'end' acts on no node that is free to move"):
        carry_over_loads(problem, truss)


def test_off_axis_cases_are_the_load_tilted_to_four_sides():
    forces = np.zeros((2, 3, 6))
    forces[0, 1:, 1] = -5.0, -3.0
    forces[1, 2, 3:] = 0, 0, 4.0
    held = np.zeros((3, 6), bool)
    held[0] = True
    one = TrussLoading(held, forces, ("push", "turn"), np.array([1.0, 3.0]))
    all_cases = add_off_axis_cases(one, 5.0)
    assert len(all_cases.names) == 10
    np.testing.assert_array_equal(all_cases.forces[[0, 5]], forces)
    np.testing.assert_allclose(all_cases.weights, [0.2] * 5 + [0.6] * 5)
    for first, axis in ((0, [0, -1, 0]), (5, [0, 0, 1])):
        part = slice(None, 3) if first == 0 else slice(3, None)
        tilted = all_cases.forces[first + 1 : first + 5, 2, part]
        directions = tilted / np.linalg.norm(tilted, axis=1, keepdims=True)
        np.testing.assert_allclose(np.linalg.norm(tilted, axis=1), np.linalg.norm(forces[first // 5, 2]))
        np.testing.assert_allclose(directions @ axis, np.cos(np.deg2rad(5)))
        np.testing.assert_allclose(directions.sum(0) / 4, np.cos(np.deg2rad(5)) * np.array(axis), atol=1e-15)
        assert np.linalg.matrix_rank(directions) == 3
    assert "+5 degrees" in all_cases.names[1]
    assert add_off_axis_cases(one, 0.0) is one
    with pytest.raises(InvalidInputError, match=r"degrees must lie in \[0, 90\), found 90"):
        add_off_axis_cases(one, 90.0)
