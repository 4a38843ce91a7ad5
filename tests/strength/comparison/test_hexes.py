"""Trusses whose cells conform to the boundary."""

import numpy as np
import pytest
from scipy.spatial import KDTree
from shapes import box_mesh, tube_mesh

from michell_cad import build_problem, read_part
from michell_cad.errors import InvalidInputError
from michell_cad.job import Setup
from michell_cad.rotations import rotation_matrix
from michell_cad.strength.comparison import hex_truss, regular_grid
from michell_cad.strength.comparison.boundary_frames import boundary_normals
from michell_cad.strength.comparison.hexes import conforming_map, layer_stiffness
from michell_cad.tet_mesh import TetMesh

BOX = box_mesh((8, 4, 4), (80.0, 40.0, 40.0))
TURN = rotation_matrix(np.array([0.3, -0.8, 0.5]))


def matched(nodes, truss, other):
    """The largest distance of a truss, moved to `nodes`, from the nearest nodes of another one, and whether it has the
    same members there."""
    distance, node = KDTree(other.nodes).query(nodes)
    assert len(np.unique(node)) == len(nodes) == len(other.nodes)
    members = {tuple(pair) for pair in np.sort(node[truss.members], axis=1).tolist()}
    return float(distance.max()), members == {tuple(pair) for pair in np.sort(other.members, axis=1).tolist()}


def test_on_a_box_it_is_the_regular_grid():
    truss = hex_truss(BOX, 10.0)
    distance, same = matched(truss.nodes, truss, regular_grid(BOX, (8, 4, 4)))
    assert same
    assert distance < 0.11 * 10  # its outermost layers lie a tenth of a cell inside, see `phase.CLEARANCE`
    braced = hex_truss(BOX, 10.0, braced=True)
    faces = 8 * 4 * 5 * 2 + 9 * 4 * 4
    assert len(braced.members) == 9 * 5 * 4 * 2 + 8 * 5 * 5 + faces
    # Diagonals join every second node.
    ends = [curve.nodes for curve in braced.curves if curve.family == "brace"]
    assert len(ends) == faces
    assert len(np.unique(ends)) <= (9 * 5 * 5 + 1) // 2


@pytest.mark.parametrize("braced", [False, True])
def test_a_turned_part_gives_the_turned_truss(braced):
    turned = hex_truss(TetMesh(BOX.vertices @ TURN.T, BOX.tets), 10.0, braced)
    distance, same = matched(turned.nodes @ TURN, turned, hex_truss(BOX, 10.0, braced))
    assert same
    assert distance < 0.2  # stretches that fit whole cells are tried in steps of an eighth of a per cent


def test_layer_stiffness_by_hand():
    """On the faces x = 0 and x = 2 of a box only the coordinate whose axis is x counts: f = y has |grad f| = 1 there,
    so that f' K f is their area; f = x is constant on them."""
    mesh = box_mesh((2, 2, 1), (2.0, 3.0, 5.0))
    K = layer_stiffness(mesh, np.broadcast_to(np.eye(3), (len(mesh.boundary_triangles), 3, 3)))
    x, y, _ = mesh.vertices.T
    assert y @ K[0] @ y == pytest.approx(2 * 3 * 5)
    assert x @ K[0] @ x == pytest.approx(0, abs=1e-12)
    assert x @ K[1] @ x == pytest.approx(2 * 2 * 5)
    # With axes half way between x and y only the faces across z count, whose area is 2 x 3 each.
    half = np.broadcast_to(rotation_matrix(np.array([0, 0, np.pi / 4])), (len(mesh.boundary_triangles), 3, 3))
    K = layer_stiffness(mesh, half)
    assert np.abs(K[0]).max() == pytest.approx(0, abs=1e-12)
    assert x @ K[2] @ x == pytest.approx(2 * 2 * 3)


def area_within(mesh, phi, degrees):
    """Share of the boundary whose normal is within an angle of that of a layer."""
    areas, normals = boundary_normals(mesh)
    g = mesh.gradients(phi)[mesh.face_tets[mesh.boundary_faces, 0]]
    cosine = np.abs(np.einsum("bid,bd->bi", g / np.linalg.norm(g, axis=2, keepdims=True), normals)).max(1)
    return float(areas[cosine > np.cos(np.deg2rad(degrees))].sum())


def test_layers_lie_along_the_faces_of_a_tube():
    mesh = tube_mesh((3, 32, 5), inner=5.0, outer=10.0, length=20.0)
    phi = conforming_map(mesh)
    assert np.linalg.det(mesh.gradients(phi)).min() > 0
    assert area_within(mesh, phi, 5) > 0.9  # Eq. 11 alone brings half of them there


@pytest.mark.parametrize(("name", "degrees"), [("quadcopter_frame", 1.5), ("jet_engine_bracket", 3)])
def test_on_given_problems(data_folder, name, degrees):
    mesh = build_problem(Setup(), read_part(data_folder / "problems" / f"{name}.npz")).mesh
    phi = conforming_map(mesh)
    assert area_within(mesh, phi, degrees) > 0.75
    truss = hex_truss(mesh, mesh.size / 8, coordinates=phi)
    assert len(truss.members) > 500
    assert truss.lengths.min() > 0.35 * truss.spacing


def test_refusals():
    with pytest.raises(InvalidInputError, match="spacing must be positive, in mm, found 0"):
        hex_truss(BOX, 0.0)
