"""Mapped blocks of quadratic tets, pressures on their faces, and closed surfaces."""

from collections.abc import Callable

import numpy as np
import trimesh
from shapes import box_mesh

from michell_cad.strength.solid.quadratic_mesh import QuadraticMesh, quadratic_mesh
from michell_cad.tet_mesh import TetMesh

_RULE = np.array([[2 / 3, 1 / 6, 1 / 6], [1 / 6, 2 / 3, 1 / 6], [1 / 6, 1 / 6, 2 / 3]])
"""Barycentric coordinates of the three-point rule on triangles."""


def block(cells: tuple[int, int, int], shape: Callable[[np.ndarray], np.ndarray] | None = None) -> QuadraticMesh:
    """The unit cube in tets, its nodes (also those on edges) moved by a map of points (k, 3)."""
    mesh = quadratic_mesh(box_mesh(cells, (1.0, 1.0, 1.0)))
    return mesh if shape is None else QuadraticMesh(shape(mesh.nodes), mesh.tets)


def faces_where(mesh: QuadraticMesh, condition: np.ndarray) -> np.ndarray:
    """Faces of the boundary all of whose nodes fulfil a condition (n_p,)."""
    return mesh.boundary[condition[mesh.boundary].all(1)]


def pressure_forces(mesh: QuadraticMesh, faces: np.ndarray, pressure: float) -> np.ndarray:
    """Consistent forces (n_p, 3) of a pressure, positive pushes, on curved triangles of six nodes."""
    X, forces = mesh.nodes[faces], np.zeros(mesh.nodes.shape)
    for L in _RULE:
        l0, l1, l2 = L
        N = np.array([*(L * (2 * L - 1)), 4 * l0 * l1, 4 * l1 * l2, 4 * l2 * l0])
        by_1 = np.array([1 - 4 * l0, 4 * l1 - 1, 0, 4 * (l0 - l1), 4 * l2, -4 * l2])
        by_2 = np.array([1 - 4 * l0, 0, 4 * l2 - 1, -4 * l1, 4 * l1, 4 * (l0 - l2)])
        outward = np.cross(np.einsum("a,fad->fd", by_1, X), np.einsum("a,fad->fd", by_2, X))
        np.add.at(forces, faces, -pressure / 6 * N[:, None] * outward[:, None])
    return forces


def capsule(radius: float, length: float) -> tuple[np.ndarray, np.ndarray]:
    """A closed surface: a round bar along x from 0 to its length, with half a ball beyond either end."""
    shape = trimesh.creation.capsule(height=length, radius=radius, count=(32, 32))
    shape.vertices *= [*[np.sqrt(2 * np.pi / 32 / np.sin(2 * np.pi / 32))] * 2, 1]  # polygons of the circle's area
    along = shape.vertices[:, 2] - shape.vertices[:, 2].min() - radius
    return np.column_stack([along, shape.vertices[:, :2]]), np.asarray(shape.faces)


def dihedral_angles(mesh: TetMesh) -> np.ndarray:
    """The six angles of every tet, degrees."""
    g = mesh.hat_gradients / np.linalg.norm(mesh.hat_gradients, axis=2, keepdims=True)
    pairs = [(a, b) for a in range(4) for b in range(a)]
    cosines = np.stack([np.einsum("td,td->t", g[:, a], g[:, b]) for a, b in pairs], axis=1)
    return 180 - np.degrees(np.arccos(np.clip(cosines, -1, 1)))
