"""Filleted creases against what they claim: tangent everywhere, and the set that a rolling ball cannot enter."""

import igl
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.GeomLProp import GeomLProp_SLProps
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_REVERSED
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS
from OCP.TopTools import TopTools_IndexedDataMapOfShapeListOfShape

from michell_cad.cad import kernel
from michell_cad.cad.mesh import mesh_truss
from michell_cad.cad.prepare import prepare_truss
from michell_cad.cad.shell import assemble_shell
from michell_cad.cad.shell_creases import spline_basis
from michell_cad.cad.solid import build_solid
from michell_cad.knobs import Knobs
from tests.cad.layouts import star


def pair(degrees: float) -> np.ndarray:
    half = np.radians(degrees) / 2
    return np.array([[np.cos(half), np.sin(half), 0], [np.cos(half), -np.sin(half), 0]])


BUNDLE = np.array([[1, 0.25, 0], [1, -0.3, 0.1], [1, 0.05, 0.5], [-1, 0.1, 0.1], [0.9, 0, -0.6]])


def largest_kink(directions: np.ndarray, **knobs) -> float:
    """Largest angle between the normals of the two faces at any edge, radians."""
    plan = assemble_shell(prepare_truss(star(directions, length=14.0, radius=0.7), Knobs(**knobs)))
    solids, _ = kernel.make_solids(plan)
    faces_of = TopTools_IndexedDataMapOfShapeListOfShape()
    TopExp.MapShapesAndAncestors_s(solids[0], TopAbs_EDGE, TopAbs_FACE, faces_of)
    kinks = []
    for i in range(1, faces_of.Extent() + 1):
        edge = TopoDS.Edge_s(faces_of.FindKey(i))
        if not BRep_Tool.Degenerated_s(edge):
            first, *others = [normals_along(edge, TopoDS.Face_s(face)) for face in faces_of.FindFromIndex(i)]
            kinks += [np.arccos(np.clip((first * other).sum(1), -1, 1)).max() for other in others]
    return float(max(kinks))


def normals_along(edge, face) -> np.ndarray:
    """Outward normals of a face at three places of one of its edges."""
    surface, (first, last) = BRep_Tool.Surface_s(face), BRep_Tool.Range_s(edge)
    curve = BRep_Tool.CurveOnSurface_s(edge, face, first, last)
    sign = -1 if face.Orientation() == TopAbs_REVERSED else 1
    normals = []
    for x in (0.2, 0.5, 0.8):
        uv = curve.Value(first + x * (last - first))
        normal = GeomLProp_SLProps(surface, uv.X(), uv.Y(), 1, 1e-9).Normal()
        normals.append([sign * normal.X(), sign * normal.Y(), sign * normal.Z()])
    return np.array(normals)


@pytest.mark.parametrize("directions", [pair(15), pair(30), pair(50), BUNDLE], ids=["15", "30", "50", "bundle"])
def test_tangent_across_every_edge(directions) -> None:
    assert largest_kink(directions) < 0.01
    assert largest_kink(directions, fillet_ratio=0.0) > 0.5


@pytest.mark.parametrize("degrees", [25.0, 45.0])
def test_what_a_ball_cannot_reach_is_filled(degrees) -> None:
    """A point is outside if some ball of radius f holds it and touches neither tubes nor sphere: tried one by one."""
    d, rng = pair(degrees), np.random.default_rng(1)
    prepared = prepare_truss(star(d, length=14.0), Knobs())
    R, f = float(prepared.sizes.radius[0]), float(prepared.sizes.fillet[0])

    def distance(x: np.ndarray) -> np.ndarray:
        along = [np.maximum(x @ one, 0)[..., None] * one for one in d]
        return np.min(
            [np.linalg.norm(x, axis=-1) - R, *(np.linalg.norm(x - foot, axis=-1) - 1 for foot in along)], axis=0
        )

    points = rng.uniform([0.5, -0.4, -1.2], [7.0, 0.4, 1.2], (60000, 3))
    away = distance(points)
    points = points[(away > 0) & (away < f)][:2500]
    u = rng.normal(size=(1500, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    freest = np.array([distance(x + f * u).max() for x in points])
    clear = np.abs(freest - f) > 0.02 * f
    mesh = mesh_truss(prepared, 64)
    inside = igl.fast_winding_number(mesh.vertices, mesh.triangles, points[clear]) > 0.5
    filled = freest[clear] < f
    assert (inside == filled).mean() > 0.99
    assert 0.03 < filled.mean() < 0.95


def test_creases_of_many_members_are_valid() -> None:
    rng = np.random.default_rng(5)
    for _ in range(6):
        d = rng.normal(size=(int(rng.integers(3, 8)), 3)) + [0, 0, 1.5]
        solid = build_solid(star(d, length=16.0, radius=0.6), Knobs())
        assert solid.report.filleted_nodes == solid.report.nodes
        assert solid.report.mesh_volume_mm3 == pytest.approx(solid.report.volume_mm3, rel=2e-3)


def test_spline_basis_is_a_partition_that_reproduces_lines() -> None:
    knots = np.sort(
        np.concatenate([np.zeros((2, 6)), np.random.default_rng(0).uniform(0, 1, (2, 4)), np.ones((2, 6))], 1)
    )
    x = np.linspace(0, 1, 21)[None].repeat(2, 0)
    basis = spline_basis(knots, x)
    greville = np.mean([knots[:, i + 1 : i + 1 + basis.shape[2]] for i in range(5)], axis=0)
    assert basis.sum(2) == pytest.approx(1)
    assert np.einsum("njc,nc->nj", basis, greville) == pytest.approx(x)
