"""A rim with few nodes stays a rim."""

import numpy as np
import pytest
from shapes import box_mesh

from michell_cad.curves import Curve, CurveKind, NodeKind
from michell_cad.isocurves import trace_isocurves
from michell_cad.splines import fit_splines
from michell_cad.tet_mesh import TetMesh
from michell_cad.truss import Truss, TrussOptions, build_truss
from michell_cad.truss.inside import keep_inside


@pytest.fixture(scope="module")
def ring() -> TetMesh:
    """A ring of radii 4 and 10 mm, 5 mm high, made by bending a box once around; its ends are 10 degrees apart."""
    box = box_mesh((36, 3, 2), (np.deg2rad(350), 6.0, 5.0))
    angle, r, z = box.vertices.T + np.array([[0.0], [4.0], [0.0]])
    return TetMesh(np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1), box.tets)


def test_splines_of_the_inner_rim_keep_to_it(ring):
    spacing = 5.0
    network = trace_isocurves(ring, ring.vertices / spacing + 0.3)
    truss = build_truss(network, spacing, TrussOptions(shortest_member=0.4))
    assert len(truss.waypoints)
    points = fit_splines(truss).positions(np.linspace(0, 1, 9))
    worst = []
    for curve in truss.curves:
        if curve.kind is CurveKind.FEATURE:
            radius = np.linalg.norm(truss.nodes[curve.nodes][:, :2], axis=1)
            if np.ptp(radius) < 0.1 and radius.max() < 4.1 and len(curve.nodes) > 2:
                worst.append(np.abs(np.linalg.norm(points[curve.members][..., :2], axis=-1) - 4).max())
    assert len(worst) >= 2
    assert max(worst) < 0.05 * spacing


def test_a_chord_over_a_hollow_is_led_along_it(ring):
    """Two nodes on the inner face, 60 degrees apart: their chord is 0.54 mm inside the hole, its member must not be."""
    angle = np.deg2rad([100.0, 160.0])
    nodes = np.stack([4 * np.cos(angle), 4 * np.sin(angle), [2.5, 2.5]], axis=1)
    curve = Curve(CurveKind.BOUNDARY, "third", 0, (None, 3, None), 0, np.array([0, 1]), np.array([0]), False)
    truss = Truss(nodes, np.full(2, NodeKind.BOUNDARY), np.array([[0, 1]]), (curve,), 5.0)
    s = np.linspace(0, 1, 9)
    before = np.linalg.norm(fit_splines(truss).positions(s)[0, :, :2], axis=1)
    after = np.linalg.norm(fit_splines(keep_inside(truss, ring)).positions(s)[0, :, :2], axis=1)
    assert before.min() < 3.5
    assert after.min() > 3.9
    again = keep_inside(keep_inside(truss, ring), ring)
    np.testing.assert_array_equal(again.waypoints, keep_inside(truss, ring).waypoints)
