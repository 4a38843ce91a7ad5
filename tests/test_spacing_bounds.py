import numpy as np
import pytest
from shapes import box_mesh, cantilever

from michell_cad.elasticity import solve_elasticity
from michell_cad.frame_field import fit_frame_field
from michell_cad.metrics import shear_residual
from michell_cad.parametrization import ParametrizationOptions, count_double_wound_edges, parametrize
from michell_cad.parametrization.jacobians import MapDerivative
from michell_cad.parametrization.spacing_bounds import SpacingPenalty, bound_spacing, cell_edges, outside_bounds


def test_the_penalty_of_a_stretched_grid_by_hand():
    mesh = box_mesh((2, 1, 1))
    phi = mesh.vertices / [2.0, 1.0, 0.25]
    derivative = MapDerivative(mesh)
    np.testing.assert_allclose(cell_edges(derivative, phi).T, [[2.0, 1.0, 0.25]] * len(mesh.tets))
    value, _ = SpacingPenalty(derivative, np.log(0.5), np.log(1.5), np.full(len(mesh.tets), 3.0))(phi)
    assert value == pytest.approx(3 * len(mesh.tets) * (np.log(2 / 1.5) ** 2 + np.log(2.0) ** 2))
    within, slope = SpacingPenalty(derivative, np.log(0.2), np.log(2.1), np.ones(len(mesh.tets)))(phi)
    assert within == 0
    assert not slope.any()


def test_the_penalty_has_the_gradient_it_claims():
    rng = np.random.default_rng(3)
    mesh = box_mesh((3, 3, 3), (3.0, 3.0, 3.0))
    derivative = MapDerivative(mesh)
    phi = mesh.vertices + 0.1 * rng.normal(size=mesh.vertices.shape)
    penalty = SpacingPenalty.of_map(derivative, phi, (0.95, 1.05), rng.uniform(0.5, 2, len(mesh.tets)))
    assert (penalty.stiffness(phi) > 0).mean() > 0.5
    direction, step = rng.normal(size=phi.shape), 1e-6
    numeric = (penalty(phi + step * direction)[0] - penalty(phi - step * direction)[0]) / (2 * step)
    assert np.vdot(penalty(phi)[1], direction) == pytest.approx(numeric, rel=1e-6)


def test_the_volume_outside_by_hand():
    edges = np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 2.1], [0.4, 1.0, 1.0], [0.4, 3.0, 1.0]])
    assert outside_bounds(edges, (0.5, 2.0), np.array([1.0, 2.0, 3.0, 4.0])) == pytest.approx(0.9)
    assert outside_bounds(edges, (0.3, 2.5), np.array([1.0, 2.0, 3.0, 4.0])) == pytest.approx(0.4)


@pytest.mark.parametrize("follow", [False, True])
def test_bounds_that_the_map_would_break_are_held(follow):
    problem = cantilever((10, 5, 5))
    mesh, field = problem.mesh, solve_elasticity(problem)
    frames = fit_frame_field(mesh, field)
    free, bound = (
        parametrize(mesh, field, frames, ParametrizationOptions(follow_stress=follow, spacing_bounds=bounds))
        for bounds in (None, (0.7, 1.4))
    )
    assert outside_bounds(free.cell_edges, (0.7, 1.4), mesh.volumes) > 0.1
    assert outside_bounds(bound.cell_edges, (0.7, 1.4), mesh.volumes) < 1e-3
    assert bound.determinants.min() > 0
    assert count_double_wound_edges(mesh, bound.phi) == 0
    residuals = [shear_residual(mesh, field.stress, p.tangents) for p in (free, bound)]
    assert residuals[1] < residuals[0] + 0.25  # even cells cost alignment, but not all of it


def test_impossible_bounds_leave_the_map_no_worse():
    """An energy that is infinite but for the map to start from."""
    mesh = box_mesh((3, 2, 2), (3.0, 2.0, 2.0))
    start = mesh.vertices * (1 + 0.3 * mesh.vertices)

    def fixed(phi: np.ndarray) -> tuple[float, np.ndarray]:
        return (0.0 if np.array_equal(phi, start) else np.inf), np.zeros_like(phi)

    one = np.ones(len(mesh.tets))
    np.testing.assert_array_equal(bound_spacing(mesh, start, (0.9, 1.1), fixed, one, one), start)


@pytest.mark.parametrize("bounds", [(0.5, 0.9), (1.1, 2.0), (0.0, 2.0), (0.5, np.inf)])
def test_bounds_must_enclose_one(bounds):
    with pytest.raises(ValueError, match="spacing_bounds"):
        ParametrizationOptions(spacing_bounds=bounds)
