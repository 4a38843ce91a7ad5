import numpy as np
import pytest
from frames import box_grid, frame
from shapes import cantilever

from michell_cad.cad import build_solid
from michell_cad.errors import InvalidInputError
from michell_cad.knobs import Knobs
from michell_cad.metrics import project_on_bars, uncarried_stress
from michell_cad.strength.braces import add_braces, cell_faces, choose_braces

PROBLEM = cantilever((6, 3, 3))
MESH = PROBLEM.mesh
AXES = np.broadcast_to(np.eye(3), (len(MESH.tets), 3, 3))


def lattice():
    """2 x 1 x 1 cells of 20 mm inside the 80 x 40 x 40 bar."""
    truss = box_grid((2, 1, 1)).truss
    straight = np.isin(np.abs(np.diff(truss.nodes[truss.members], axis=1)).sum((1, 2)), 1)
    return frame(truss.nodes * 20 + [20, 10, 10], truss.members[straight], 1.5)


def shear(i, j, size=1.0):
    stress = np.zeros((len(MESH.tets), 3, 3))
    stress[:, i, j] = stress[:, j, i] = size
    return stress


def test_faces_of_a_grid_are_counted_once():
    a, b, c = 3, 2, 2
    faces = cell_faces(lattice().truss)
    assert len(faces) == 11  # 2 cells: 12 faces, one shared
    sides = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    members = {tuple(m) for m in lattice().truss.members.tolist()}
    assert {tuple(sorted(s)) for s in sides.tolist()} <= members
    with_diagonals = box_grid((a, b, c)).truss  # whose y = 0 faces have a diagonal
    plain = a * b * (c + 1) + a * (b + 1) * c + (a + 1) * b * c
    assert len(cell_faces(with_diagonals)) == plain - a * c


def test_pure_shear_braces_the_faces_that_see_it():
    truss = lattice().truss
    pairs = choose_braces(truss, MESH, shear(0, 2), AXES)
    ends = truss.nodes[pairs]
    assert len(pairs) == 4
    np.testing.assert_allclose(np.abs(np.diff(ends, axis=1)[:, 0]), np.tile([20, 0, 20], (4, 1)))
    assert len(choose_braces(truss, MESH, shear(0, 2), AXES, limit=1.01)) == 0
    axial = np.zeros((len(MESH.tets), 3, 3))
    axial[:, 0, 0] = 1.0
    assert len(choose_braces(truss, MESH, axial, AXES)) == 0


def test_braces_have_labels_of_their_own_and_are_built():
    sized = lattice()
    pairs = choose_braces(sized.truss, MESH, shear(0, 2), AXES)
    braced = add_braces(sized.truss, pairs)
    braces = [curve for curve in braced.curves if curve.family == "brace"]
    assert [curve.name for curve in braces] == [f"brace (*, *, *) #{k}" for k in range(4)]
    np.testing.assert_array_equal(braced.members[[curve.members[0] for curve in braces]], pairs)
    np.testing.assert_array_equal(braced.members[:20], sized.truss.members)
    radii = np.concatenate([sized.radii, np.full((4, 3), 1.0)])
    solid = build_solid(type(sized)(braced, radii), Knobs())
    assert solid.report.valid
    assert solid.report.solids == 1
    assert solid.report.genus == solid.report.expected_genus == 24 - 12 + 1
    assert {"brace"} < {curve.family for curve in solid.prepared.sized.truss.curves}
    assert len(choose_braces(braced, MESH, shear(0, 2), AXES)) == 0  # no face twice


def test_flat_faces_have_no_room():
    """A rhombus of 15 degrees: its long diagonal would run 7.5 degrees from the sides."""
    t = np.deg2rad(15)
    u, v = 20 * np.array([1, 0, 0]), 20 * np.array([np.cos(t), 0, np.sin(t)])
    base = np.array([20.0, 20, 10])
    truss = frame([base, base + u, base + u + v, base + v], [(0, 1), (1, 2), (2, 3), (0, 3)]).truss
    pairs = choose_braces(truss, MESH, np.broadcast_to(np.diag([1.0, 1, -2]), AXES.shape) + shear(0, 2), AXES)
    np.testing.assert_array_equal(pairs, np.zeros((0, 2)) if not len(pairs) else [[1, 3]])


def test_projection_on_bars():
    """The diagonal of a stress along the axes; everything that bars along skew directions carry."""
    rng = np.random.default_rng(0)
    stress = rng.normal(size=(5, 3, 3))
    stress = stress + stress.swapaxes(1, 2)
    np.testing.assert_allclose(
        project_on_bars(stress, np.broadcast_to(np.eye(3), (5, 3, 3))), stress * np.eye(3), atol=1e-14
    )
    B = rng.normal(size=(5, 3, 3))
    B /= np.linalg.norm(B, axis=1, keepdims=True)
    carried = np.einsum("ti,tji,tki->tjk", rng.normal(size=(5, 3)), B, B)
    np.testing.assert_allclose(project_on_bars(carried, B), carried, atol=1e-12)
    assert uncarried_stress(MESH, shear(0, 1), AXES) == pytest.approx(1)


def test_a_negative_limit_is_refused():
    with pytest.raises(InvalidInputError, match="limit must not be negative, found -1"):
        choose_braces(lattice().truss, MESH, shear(0, 1), AXES, -1.0)
