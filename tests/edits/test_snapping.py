import numpy as np
import pytest
import scipy.sparse as sp
from designs import small_bar, turned_design
from scipy.spatial.transform import Rotation

from michell_cad.edits import DesignFields, EditList, Remove, Snap, Structure, Where
from michell_cad.edits.snapping import locate_points, smoothest_change, snap_levels
from michell_cad.errors import InvalidInputError
from michell_cad.knobs import Knobs

BAR = small_bar()
FIELDS = DesignFields.of(BAR)


def test_one_point_is_met_by_a_shift_that_keeps_every_gradient():
    snapped = snap_levels(FIELDS, np.array([[41.3, 17.2, 22.9]]))
    change = snapped - FIELDS.levels
    np.testing.assert_allclose(change, np.broadcast_to(change[0], change.shape), atol=1e-9)
    assert (np.abs(change[0]) <= 0.5).all()


def test_all_coordinates_are_whole_at_every_point():
    points = np.array([[41.3, 17.2, 22.9], [20.0, 8.0, 31.0], [66.0, 30.0, 12.0]])
    corners, weights = locate_points(FIELDS.mesh, points)
    np.testing.assert_allclose(np.einsum("kc,kcd->kd", weights, FIELDS.mesh.vertices[corners]), points, atol=1e-9)
    values = np.einsum("kc,kcd->kd", weights, snap_levels(FIELDS, points)[corners])
    np.testing.assert_allclose(values, np.round(values), atol=1e-8)


def test_the_change_is_the_least_of_all_that_meet_the_points():
    """Any other change with the same values at the points costs more."""
    mesh, rng = FIELDS.mesh, np.random.default_rng(3)
    at = [10, 200, 77]
    B = sp.csr_matrix((np.ones(3), (range(3), at)), (3, len(mesh.vertices)))
    L = mesh.laplacian(mesh.volumes)
    K = L + 4.0**2 * L @ sp.diags(1 / mesh.vertex_volumes) @ L
    u = smoothest_change(mesh, B, np.array([[0.3], [-0.2], [0.1]]), 4.0)[:, 0]
    np.testing.assert_allclose(u[at], [0.3, -0.2, 0.1], atol=1e-9)
    for _ in range(5):
        other = u + 1e-3 * rng.normal(size=len(u))
        other[at] = u[at]
        assert other @ K @ other > u @ K @ u


def test_the_coordinates_of_a_turned_design_snap_alike():
    Q = Rotation.random(random_state=4).as_matrix()
    points = np.array([[41.3, 17.2, 22.9], [20.0, 8.0, 31.0]])
    turned = snap_levels(DesignFields.of(turned_design(BAR, Q)), points @ Q.T)
    np.testing.assert_allclose(turned, snap_levels(FIELDS, points), atol=1e-8)


def test_nodes_lie_at_the_points_and_labels_stay():
    points = ((41.3, 17.2, 22.9), (20.0, 8.0, 31.0))
    structure = EditList((Snap(points=points),)).replay(BAR, Knobs())
    for point in points:
        assert np.linalg.norm(structure.truss.nodes - point, axis=1).min() < 1e-9
    before = {(c.family, c.isovalues) for c in BAR.truss.curves if c.family != "feature"}
    after = {(c.family, c.isovalues) for c in structure.truss.curves if c.family != "feature"}
    assert len(before & after) > 0.8 * len(before)


def test_a_list_snaps_first_and_edits_of_the_truss_follow():
    edits = EditList((Remove(where=Where("boundary")), Snap(points=((41.3, 17.2, 22.9),))))
    one, other = edits.replay(BAR, Knobs()), edits.moved(1, 0).replay(BAR, Knobs())
    np.testing.assert_array_equal(one.truss.nodes, other.truss.nodes)
    late = Remove(where=Where("boundary")).apply(Structure.of(BAR, Knobs()))
    with pytest.raises(InvalidInputError, match="comes before edits of the truss"):
        Snap(points=((41.3, 17.2, 22.9),)).apply(late)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (((41.0, 17.0, 22.0), (42.0, 17.0, 22.0)), "would snap to one node: they are 1 mm apart"),
        (((41.0, 17.0, 99.0),), "lies outside of the part"),
        ((), "no point is given"),
    ],
)
def test_what_cannot_be_snapped_is_said(points, message):
    with pytest.raises(InvalidInputError, match=message):
        EditList((Snap(points=points),)).replay(BAR, Knobs())
