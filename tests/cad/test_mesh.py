"""The direct mesh: closed, of the right genus and volume; and checks that can fail."""

import dataclasses

import numpy as np
import pytest
import trimesh

from michell_cad.cad.mesh import TrussMesh, mesh_truss
from michell_cad.cad.prepare import prepare_truss
from michell_cad.cad.shell_plan import FaceRole
from michell_cad.cad.solid import build_solid
from michell_cad.cad.sphere_mesh import lattice_points, match_volume, triangulate_sphere
from michell_cad.cad.stl import export_stl
from michell_cad.cad.threemf import export_3mf
from michell_cad.errors import InvalidInputError
from michell_cad.knobs import Knobs
from tests.cad.layouts import grid_truss, sized, star


@pytest.fixture(scope="module")
def grid_mesh() -> TrussMesh:
    return mesh_truss(prepare_truss(sized(grid_truss((4, 3, 3)), 1.0, 0.3), Knobs()))


def test_grid_mesh_is_closed_and_has_the_genus_of_its_graph(grid_mesh) -> None:
    truss = grid_truss((4, 3, 3))
    assert grid_mesh.is_watertight
    assert grid_mesh.bodies == 1
    assert 1 - grid_mesh.euler_number / 2 == len(truss.members) - len(truss.nodes) + 1
    independent = trimesh.Trimesh(grid_mesh.vertices, grid_mesh.triangles, process=False)
    assert independent.is_watertight
    assert independent.is_winding_consistent
    assert independent.volume == pytest.approx(grid_mesh.volume)


def test_every_triangle_has_its_place(grid_mesh) -> None:
    """Triangles of a member lie near it, those of a node near the node."""
    prepared = prepare_truss(sized(grid_truss((4, 3, 3)), 1.0, 0.3), Knobs())
    X, R = prepared.sized.truss.nodes, prepared.sizes.radius
    middle = grid_mesh.vertices[grid_mesh.triangles].mean(1)
    at = grid_mesh.role == FaceRole.NODE
    away = np.linalg.norm(middle[at] - X[grid_mesh.owner[at]], axis=1)
    assert (away <= 1.05 * R[grid_mesh.owner[at]]).all()
    on = grid_mesh.role == FaceRole.MEMBER
    ends = X[prepared.sized.truss.members[grid_mesh.owner[on]]]
    assert (np.linalg.norm(middle[on][:, None] - ends, axis=2).min(1) < 8.0).all()


@pytest.mark.parametrize("segments", [8, 16, 48])
def test_volume_depends_little_on_the_segments(segments) -> None:
    prepared = prepare_truss(star(np.concatenate([np.eye(3), -np.eye(3)])), Knobs())
    assert mesh_truss(prepared, segments).volume == pytest.approx(mesh_truss(prepared, 96).volume, rel=2e-3)


def test_too_few_segments_are_refused() -> None:
    with pytest.raises(InvalidInputError, match="at least 8"):
        mesh_truss(prepare_truss(star(np.eye(3)), Knobs()), 4)


@pytest.mark.parametrize("fault", ["missing", "flipped", "twice"])
def test_check_sees_faults(grid_mesh, fault) -> None:
    triangles = np.array(grid_mesh.triangles)
    keep = np.arange(len(triangles))
    if fault == "missing":
        keep = keep[1:]
    elif fault == "twice":
        keep = np.append(keep, 7)
    else:
        triangles[7] = triangles[7, ::-1]
    broken = dataclasses.replace(
        grid_mesh, triangles=triangles[keep], role=grid_mesh.role[keep], owner=grid_mesh.owner[keep]
    )
    assert not broken.is_watertight
    assert len(broken.open_triangles)


def test_sphere_without_caps_has_the_volume_of_a_sphere() -> None:
    cap = np.array([[0, 0, 1.0]])
    a = np.array([0.2])
    t = np.arange(24) * np.pi / 12
    ring = np.stack([np.sin(0.2) * np.cos(t), np.sin(0.2) * np.sin(t), np.full(24, np.cos(0.2))], axis=1)
    inner, triangles = triangulate_sphere(ring, cap, a)
    points = np.concatenate([ring, inner])
    is_inner = np.arange(len(points)) >= 24
    sector = 2 * np.pi * (1 + np.cos(0.2)) / 3
    factor = match_volume(points, triangles, is_inner, sector)
    points[24:] *= factor
    six = np.einsum("td,td->", points[triangles[:, 0]], np.cross(points[triangles[:, 1]], points[triangles[:, 2]]))
    assert six / 6 == pytest.approx(sector, rel=1e-9)
    assert 1 < factor < 1.03


def test_lattice_is_even() -> None:
    points = lattice_points()
    nearest = np.sort(np.arccos(np.clip(points @ points.T, -1, 1)), axis=1)[:, 1]
    assert nearest.min() > 0.6 * nearest.max()


def test_open_meshes_are_refused(tmp_path) -> None:
    solid = build_solid(star(np.eye(3)), Knobs())
    mesh = solid.mesh
    n = len(mesh.triangles) - 1
    broken = dataclasses.replace(mesh, triangles=mesh.triangles[:n], role=mesh.role[:n], owner=mesh.owner[:n])
    faulty = dataclasses.replace(solid, mesh=broken)
    for export, name in ((export_stl, "truss.stl"), (export_3mf, "truss.3mf")):
        with pytest.raises(InvalidInputError, match="watertight"):
            export(faulty, tmp_path / name)
    assert not list(tmp_path.iterdir())
