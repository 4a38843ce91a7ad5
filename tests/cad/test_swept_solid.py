"""Trusses of swept profiles: their united mesh, their solids, and their files."""

import json
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import cadquery as cq
import lib3mf
import numpy as np
import pytest
import trimesh

from michell_cad.building import build_united, size_finished
from michell_cad.cad import (
    SweptSolid,
    TrussSolid,
    build_solid,
    export_beam_lattice,
    export_brep,
    export_glb,
    export_step,
    export_stl,
    forecast_step,
    kept_shape,
    kernel,
    mesh_truss,
    prepare_truss,
    swept_volume,
)
from michell_cad.cad.shell_plan import FaceRole
from michell_cad.cad.sweep_hulls import hull_of
from michell_cad.cad.sweep_mesh import Body, mesh_ball, mesh_hull, unite_bodies
from michell_cad.cad.threemf import export_3mf
from michell_cad.curves import Curve, CurveKind
from michell_cad.edits import Structure
from michell_cad.errors import GeometryKernelError, InvalidInputError
from michell_cad.knobs import Knobs
from michell_cad.truss import SizedTruss, Truss
from tests.cad.layouts import grid_truss, sized, sparse_reference_truss, star
from tests.edits.designs import small_bar

READER = Path(__file__).with_name("read_step.py")
SQUARES = Knobs(profile="square")
HULLS = Knobs(profile="hexagon", node_form="hull", profile_aspect=1.5)


@pytest.fixture(scope="module")
def squares() -> SweptSolid:
    solid = build_solid(sized(grid_truss((4, 3, 3)), 1.0, 0.2), SQUARES)
    assert isinstance(solid, SweptSolid)
    return solid


def test_round_members_are_still_the_direct_shell() -> None:
    assert isinstance(build_solid(star(np.eye(3)), Knobs()), TrussSolid)


@pytest.mark.parametrize("knobs", [SQUARES, HULLS, Knobs(node_form="hull"), Knobs(profile_aspect=2.0)])
def test_the_union_is_one_watertight_body_of_the_genus_of_the_truss(knobs) -> None:
    truss = sized(grid_truss((3, 3, 2)), 1.0)
    solid = build_solid(truss, knobs)
    report = solid.report
    assert solid.mesh.is_watertight
    assert report.solids == 1
    assert report.genus == report.expected_genus == len(truss.truss.members) - 18 + 1
    assert report.parts == len(truss.truss.curves) + 18 == len(solid.solids)
    assert report.part_volume_difference < 1e-3
    # A member's volume is that of the round one; the union is no more than its parts and no less than their largest.
    assert report.volume_mm3 == pytest.approx(solid.mesh.volume)
    assert report.volume_mm3 < sum(kernel.volume(one, 1e-4) for one in solid.solids)


def test_crossing_bars_have_the_volume_of_their_union() -> None:
    """Bars of side a along x and y, aligned with each other, overlap in a cube; balls at the ends add what sticks out.

    A node that is smaller than the bars adds nothing in the middle: 4 L a^2 - a^3, and four ends of a ball each.
    """
    small = Knobs(profile="square", node_ratio=1.2)
    L, a, R = 10.0, np.sqrt(np.pi), 1.2
    volume = build_solid(star([(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0)], L), small).report.volume_mm3
    bars = 4 * L * a**2 - a**3
    # Of the ball at an end: what is behind the end, and the caps outside of the bar's four sides.
    cap = np.pi * (R - a / 2) ** 2 * (3 * R - (R - a / 2)) / 3
    ends = 4 * (2 / 3 * np.pi * R**3 + 4 * cap / 2)
    middle = 2 * cap
    assert volume == pytest.approx(bars + ends + middle, rel=1e-3)


def two_curves(height: float) -> SizedTruss:
    """A member along x, and one along y above it, without a common node."""
    nodes = np.array([[-9, 0, 0], [9, 0, 0], [0, -9, height], [0, 9, height]], float)
    curves = tuple(
        Curve(CurveKind.INTERIOR, family, k, (k, 1, 1), 0, np.array([2 * k, 2 * k + 1]), np.array([k]), False)
        for k, family in enumerate(("tension", "compression"))
    )
    return sized(Truss(nodes, np.zeros(4, int), np.array([[0, 1], [2, 3]]), curves, 10.0), 1.0)


def test_a_disconnected_truss_is_several_bodies() -> None:
    report = build_solid(two_curves(5.0), SQUARES).report
    assert (report.solids, report.genus, report.expected_genus, report.messages) == (2, 0, 0, ())


def test_members_that_overlap_between_their_nodes_are_told() -> None:
    report = build_solid(two_curves(0.5), SQUARES).report
    assert report.solids == 1
    assert "1 bodies of genus 0 in all instead of 2 of 0: members touch or overlap" in report.messages[0]


def test_every_triangle_knows_its_curve(squares) -> None:
    mesh, truss = squares.mesh, squares.sized.truss
    assert set(np.unique(mesh.role).tolist()) == {FaceRole.MEMBER, FaceRole.NODE}
    middle = mesh.vertices[mesh.triangles].mean(1)
    tube = mesh.role == FaceRole.MEMBER
    a, b = truss.nodes[truss.members[mesh.owner[tube]]].transpose(1, 0, 2)
    share = np.clip(((middle[tube] - a) * (b - a)).sum(1) / ((b - a) ** 2).sum(1), 0, 1)
    assert np.linalg.norm(middle[tube] - a - share[:, None] * (b - a), axis=1).max() < 3.0
    ball = ~tube
    assert np.linalg.norm(middle[ball] - truss.nodes[mesh.owner[ball]], axis=1).max() < 2.0


def test_step_is_one_valid_solid_for_each_curve_and_node(squares, tmp_path) -> None:
    path = tmp_path / "truss.step"
    export_step(squares, path)
    done = subprocess.run([sys.executable, READER, path], capture_output=True, text=True, check=True)
    parts = json.loads(done.stdout.splitlines()[-1])["parts"]
    expected = {part.name: kernel.volume(part.solid, 1e-5) for part in squares.assembly}
    assert len(parts) == len(squares.assembly) == len(expected)
    assert all(part["valid"] and part["solids"] == 1 for part in parts)
    assert {part["name"]: part["volume"] for part in parts} == pytest.approx(expected, rel=1e-4)
    groups = Counter(part["path"][-1] for part in parts)
    families = Counter(curve.family for curve in squares.sized.truss.curves)
    assert groups == families | Counter(nodes=36)
    assert forecast_step(squares) == pytest.approx(path.stat().st_size, rel=0.15)


def test_one_solid_is_refused_with_what_there_is(squares, tmp_path) -> None:
    with pytest.raises(InvalidInputError, match="for other profiles take the form 'assembly'"):
        export_step(squares, tmp_path / "truss.step", form="solid")
    with pytest.raises(InvalidInputError, match="beams of a 3MF beam lattice are round"):
        export_beam_lattice(squares, tmp_path / "truss.3mf")
    assert not list(tmp_path.iterdir())


def test_meshes_read_back_watertight(squares, tmp_path) -> None:
    for solid in (squares, build_solid(sized(grid_truss((3, 3, 2)), 1.0), HULLS)):
        export_stl(solid, tmp_path / "truss.stl")
        mesh = trimesh.load(tmp_path / "truss.stl")
        assert mesh.is_watertight
        assert mesh.volume == pytest.approx(solid.report.volume_mm3, rel=1e-5)
    export_3mf(squares, tmp_path / "truss.3mf")
    model = lib3mf.get_wrapper().CreateModel()
    model.QueryReader("3mf").ReadFromFile(str(tmp_path / "truss.3mf"))
    objects = model.GetMeshObjects()
    assert objects.Count() == 1
    objects.MoveNext()
    one = objects.GetCurrentMeshObject()
    assert one.IsManifoldAndOriented()
    assert one.GetTriangleCount() == len(squares.mesh.triangles)
    export_glb(squares, tmp_path / "truss.glb")
    assert set(trimesh.load(tmp_path / "truss.glb").geometry) == {"tension", "compression", "third", "nodes"}


def test_objects_and_brep_hold_the_parts(squares, tmp_path) -> None:
    export_brep(squares, tmp_path / "truss.brep")
    assert (tmp_path / "truss.brep").stat().st_size > 1000
    assert len(squares.cadquery.solids().vals()) == squares.report.parts
    assert len(squares.build123d.solids()) == squares.report.parts
    assert len(squares.face_curve) == len(squares.faces) == squares.report.part_faces
    assert (np.bincount(squares.face_component) >= 1).all()


def test_a_part_that_is_not_valid_is_named(monkeypatch) -> None:
    monkeypatch.setattr(kernel, "is_valid", lambda shape: False)
    with pytest.raises(GeometryKernelError, match=r"tension \(\*, 0, 0\) #0 does not come out .* at most 0\.8 mm"):
        build_solid(star(np.eye(3)), SQUARES)


def test_nothing_is_kept_with_other_profiles_than_round_ones() -> None:
    structure = replace(Structure.of(small_bar(), SQUARES), kept=(kept_shape("plate", cq.Workplane().box(9, 9, 9)),))
    with pytest.raises(InvalidInputError, match=r"\[\[keep\]\] unites round members .* set profile = round"):
        build_united(structure, size_finished(structure), lambda stage, fraction: None)


def test_the_volume_of_the_knobs_radius_is_about_that_of_round_members() -> None:
    truss = sized(grid_truss((4, 3, 3)), 0.8)
    round_one = mesh_truss(prepare_truss(truss, Knobs(fillet_ratio=0))).volume
    assert swept_volume(truss, SQUARES) == pytest.approx(round_one, rel=0.03)


def test_a_ball_has_the_volume_of_its_sphere() -> None:
    assert mesh_ball(np.array([5.0, 0, 0]), 2.0, 0).volume == pytest.approx(4 / 3 * np.pi * 8, rel=1e-12)


def test_a_hull_unites_coplanar_triangles() -> None:
    box = np.stack(np.meshgrid([0, 1], [0, 2], [0, 3], indexing="ij"), axis=-1).reshape(-1, 3)
    inside = np.array([[0.5, 1, 1], [0.5, 0, 1.5]])
    hull = hull_of(np.concatenate([box, inside]).astype(float))
    assert sorted(len(face) for face in hull.faces) == [4] * 6
    assert len(hull.vertices) == 8


def test_a_mesh_that_is_not_closed_is_refused() -> None:
    open_one = Body(np.eye(3), np.array([[0, 1, 2]]), FaceRole.NODE, np.array([7]))
    with pytest.raises(GeometryKernelError, match="node 7 is not closed"):
        unite_bodies([open_one])


def test_a_traced_truss_of_every_kind_of_node() -> None:
    """Acute angles, surface curves, sharp edges, members of two curves."""
    truss = sized(sparse_reference_truss("cantilever_beam_beta0.1_rho16", 8), 0.8, 0.2)
    for knobs in (SQUARES, Knobs(profile="triangle", node_form="hull")):
        solid = build_solid(truss, knobs)
        assert solid.mesh.is_watertight
        assert solid.report.part_volume_difference < 1e-3
        assert {name for name, _ in Counter(part.name for part in solid.assembly).items()}.__len__() == len(
            solid.assembly
        )


def box(low: np.ndarray, high: np.ndarray, node: int) -> Body:
    corners = np.stack(np.meshgrid(*np.stack([low, high], axis=1), indexing="ij"), axis=-1).reshape(-1, 3)
    return mesh_hull(hull_of(corners), node)


def test_what_single_precision_cannot_tell_apart_is_one() -> None:
    """A box that sticks out of another by a nanometre's thousandth leaves no walls of that height."""
    outer = box(np.zeros(3), np.full(3, 10.0), 0)
    mesh = unite_bodies([outer, box(np.array([2.0, 3, 4]), np.array([6.0, 7, 10 + 1e-9]), 1)])
    assert len(np.unique(mesh.vertices.astype(np.float32), axis=0)) == len(mesh.vertices)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(1000, rel=1e-9)
