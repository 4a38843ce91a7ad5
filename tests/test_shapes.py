import numpy as np
from shapes import cantilever, refined

from michell_cad.elasticity import solve_elasticity
from michell_cad.problem import surface_force


def test_refined_tets_fill_the_same_part_with_an_eighth_each():
    problem = cantilever((4, 2, 2))
    fine = refined(problem, 2)
    assert len(fine.mesh.tets) == 64 * len(problem.mesh.tets)
    np.testing.assert_allclose(fine.mesh.volumes, problem.mesh.volumes[0] / 64)
    assert len(fine.mesh.boundary_triangles) == 16 * len(problem.mesh.boundary_triangles)
    held = fine.mesh.vertices[:, 0] == 0
    np.testing.assert_array_equal(fine.fixed, np.repeat(held[:, None], 3, axis=1))


def test_refined_forces_are_those_of_the_same_traction():
    """In the middle of a regular surface exactly; the net force always."""
    problem = cantilever((2, 8, 8))
    fine = refined(problem)
    end = np.flatnonzero((fine.mesh.vertices[fine.mesh.boundary_triangles][:, :, 0] == 80).all(1))
    exact = surface_force(fine.mesh, end, np.array([0.0, 0.0, -100.0]))
    force = fine.load_cases[0].force
    np.testing.assert_allclose(force.sum(0), [0, 0, -100], atol=1e-12)
    inner = np.abs(fine.mesh.vertices[:, 1:] - 20).max(1) < 14
    np.testing.assert_allclose(force[inner], exact[inner], atol=1e-12)


def test_a_refined_cantilever_bends_more_and_ever_less_so():
    sag = [
        float(np.vdot(p.load_cases[0].force, solve_elasticity(p).displacements[0]))
        for p in (refined(cantilever((4, 2, 2)), times) for times in range(3))
    ]
    assert sag[0] < sag[1] < sag[2]
    assert sag[2] - sag[1] < 0.6 * (sag[1] - sag[0])
