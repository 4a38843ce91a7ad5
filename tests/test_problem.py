"""Loads and supports against hand calculation: resultants, couples, weights, rigid motions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from shapes import ABS, box_mesh, cantilever

from michell_cad.errors import InvalidInputError
from michell_cad.problem import (
    GRAVITY,
    DesignProblem,
    LoadCase,
    Material,
    self_weight,
    surface_force,
    surface_pressure,
    surface_torque,
)
from michell_cad.tet_mesh import TetMesh

SIZE = (8.0, 4.0, 2.0)
MESH = box_mesh((8, 4, 2), SIZE)


def side(mesh: TetMesh, axis: int, value: float) -> np.ndarray:
    return np.flatnonzero(np.isclose(mesh.vertices[mesh.boundary_triangles][:, :, axis], value).all(1))


def moment(mesh: TetMesh, force: np.ndarray, about=(0.0, 0.0, 0.0)) -> np.ndarray:
    return np.cross(mesh.vertices - np.array(about), force).sum(0)


def test_force_is_total_and_acts_at_the_centre_of_the_area():
    F = np.array([3.0, -2.0, 5.0])
    nodal = surface_force(MESH, side(MESH, 0, 8), F)
    assert nodal.sum(0) == pytest.approx(F)
    assert moment(MESH, nodal) == pytest.approx(np.cross([8, 2, 1], F))
    assert not nodal[MESH.vertices[:, 0] < 8].any()


def test_pressure_pushes_in():
    nodal = surface_pressure(MESH, side(MESH, 2, 2), 0.5)
    assert nodal.sum(0) == pytest.approx([0, 0, -0.5 * 32])
    assert moment(MESH, nodal) == pytest.approx(np.cross([4, 2, 2], [0, 0, -16]))


def test_pressure_all_around_is_in_balance():
    nodal = surface_pressure(MESH, np.arange(len(MESH.boundary_triangles)), 1.0)
    assert nodal.sum(0) == pytest.approx([0, 0, 0], abs=1e-12)
    assert moment(MESH, nodal) == pytest.approx([0, 0, 0], abs=1e-12)


@pytest.mark.parametrize("point", [(0.0, 2.0, 1.0), (5.0, -7.0, 30.0)])
def test_torque_is_a_couple(point):
    nodal = surface_torque(MESH, side(MESH, 0, 8), 700.0, np.array(point), np.array([3.0, 0.0, 0.0]))
    assert nodal.sum(0) == pytest.approx([0, 0, 0], abs=1e-10)
    assert moment(MESH, nodal) == pytest.approx([700, 0, 0], abs=1e-9)
    assert moment(MESH, nodal, (3.0, 3.0, 3.0)) == pytest.approx([700, 0, 0], abs=1e-9)


def test_torque_of_a_thin_ring_by_hand():
    """Four edges of a square bar at equal lever arms: each corner of the end carries T / (4 r)."""
    mesh = box_mesh((1, 1, 1), (2.0, 2.0, 2.0))
    nodal = surface_torque(mesh, side(mesh, 0, 2), 8.0, np.array([0.0, 1.0, 1.0]), np.array([1.0, 0.0, 0.0]))
    # The two triangles weigh the corners 1:2:1:2; by symmetry the forces are along d x r and their moment is 8.
    arms = mesh.vertices - [2, 1, 1]
    for force, arm in zip(nodal, arms, strict=True):
        if force.any():
            assert np.dot(force, arm) == pytest.approx(0, abs=1e-12)
            assert np.cross([1, 0, 0], arm) @ force > 0


def test_self_weight():
    nodal = self_weight(MESH, 1.04e-3, np.array([0.0, 0.0, -2.0]))
    weight = 64 * 1.04e-3 * 1e-3 * GRAVITY
    assert nodal.sum(0) == pytest.approx([0, 0, -weight])
    assert moment(MESH, nodal) == pytest.approx(np.cross([4, 2, 1], [0, 0, -weight]))


@given(st.integers(0, 2**32 - 1))
def test_loads_turn_with_the_part(seed):
    Q = Rotation.random(random_state=seed).as_matrix()
    turned = TetMesh(MESH.vertices @ Q.T, MESH.tets)
    end = side(MESH, 0, 8)
    F, axis, point = np.array([1.0, 2.0, 3.0]), np.array([0.0, 1.0, 1.0]), np.array([4.0, 4.0, 4.0])
    for straight, other in (
        (surface_force(MESH, end, F), surface_force(turned, end, Q @ F)),
        (surface_pressure(MESH, end, 2.0), surface_pressure(turned, end, 2.0)),
        (surface_torque(MESH, end, 5.0, point, axis), surface_torque(turned, end, 5.0, Q @ point, Q @ axis)),
        (self_weight(MESH, 1.0, F), self_weight(turned, 1.0, Q @ F)),
    ):
        assert other == pytest.approx(straight @ Q.T, abs=1e-9)


# --- problems --------------------------------------------------------------------------------------------------------


def held(mask: np.ndarray, axes: str) -> np.ndarray:
    fixed = np.zeros((len(MESH.vertices), 3), bool)
    for axis in axes:
        fixed[mask, "xyz".index(axis)] = True
    return fixed


def test_a_couple_without_net_force_is_a_good_load():
    fixed = held(MESH.vertices[:, 0] == 0, "xyz")
    nodal = surface_torque(MESH, side(MESH, 0, 8), 5.0, np.zeros(3), np.array([1.0, 0.0, 0.0]))
    problem = DesignProblem(MESH, ABS, fixed, (LoadCase("twist", nodal),))
    np.testing.assert_allclose(problem.load_cases[0].force.sum(0), 0, atol=1e-12)


def test_problems_that_are_none():
    good = cantilever((4, 2, 2))
    force = good.load_cases[0].force

    def refused(match: str, **changes) -> None:
        values = {"mesh": good.mesh, "material": ABS, "fixed": good.fixed, "load_cases": good.load_cases} | changes
        with pytest.raises(InvalidInputError, match=match):
            DesignProblem(**values)

    refused("no load", load_cases=())
    refused("zero at every free", load_cases=(LoadCase("zero", np.zeros_like(force)),))
    on_the_held = np.where(good.fixed, 1.0, 0.0)
    refused("zero at every free", load_cases=(LoadCase("held", on_the_held),))
    refused("free to move", fixed=np.zeros_like(good.fixed))
    refused("can turn about", fixed=good.fixed & (good.mesh.vertices[:, 2:] == 0))
    refused("shape", load_cases=(LoadCase("short", force[:-1]),))
    with pytest.raises(InvalidInputError, match="finite"):
        LoadCase("nan", np.full_like(force, np.nan))
    for size in (1e-200, 1e200):
        with pytest.raises(InvalidInputError, match="check the unit"):
            LoadCase("wild", size * force)
    with pytest.raises(InvalidInputError, match="weight"):
        LoadCase("weightless", force, 0.0)


def test_materials_that_are_none():
    for change in (
        {"youngs_modulus": 1e-200},
        {"youngs_modulus": 1e200},
        {"youngs_modulus": 0.0},
        {"poisson_ratio": 0.5},
        {"density": -1.0},
        {"yield_strength": np.nan},
    ):
        with pytest.raises(InvalidInputError, match=next(iter(change))):
            Material(**{**vars(ABS), **change})


def test_loads_need_a_region_and_an_axis():
    with pytest.raises(InvalidInputError, match="region is empty"):
        surface_force(MESH, np.zeros(0, int), np.ones(3))
    with pytest.raises(InvalidInputError, match="zero vector"):
        surface_torque(MESH, side(MESH, 0, 8), 1.0, np.zeros(3), np.zeros(3))
    with pytest.raises(InvalidInputError, match="zero vector"):
        self_weight(MESH, 1.0, np.zeros(3))


def test_anchored_are_the_held_and_the_loaded_vertices_but_not_those_with_weight() -> None:
    problem = cantilever((4, 2, 2))
    ends = np.isin(problem.mesh.vertices[:, 0], (0.0, 80.0))
    assert (problem.anchored == ends).all()
    weight = LoadCase("weight", np.ones_like(problem.load_cases[0].force))
    both = DesignProblem(problem.mesh, ABS, problem.fixed, (*problem.load_cases, weight))
    assert (both.anchored == ends).all()
