"""A truss whose cells conform to the faces of the part and know nothing of its stress: the edges of a mesh of
hexahedra, as a mesher would put them.

The same house as a design, with frames from the boundary's normals (`boundary_frames`) instead of the stress: Eq. 11 of
Arora et al. 2019 (doi:10.1145/3328939.3328999) without folds, integer isocurves, cleaning. Meshers ask one thing more,
that layers lie along the faces, and so does the term that is added here to Eq. 11:

    lambda l sum_b a_b sum_i s_bi |P_b grad phi_i|^2,   l = |V|^(1/3),

P_b the projection on boundary triangle b, s_bi = max(0, 2 (r_i . n_b)^2 - 1)^2: one for a coordinate whose axis is the
normal, zero for all of them where the normal lies half way between two axes.
"""

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float

from michell_cad.arrays import require
from michell_cad.isocurves import trace_isocurves
from michell_cad.linear_solver import factorise
from michell_cad.parametrization import Parametrization
from michell_cad.parametrization.equation_11 import LeastSquaresMap, centre_parts, free_vertices, integrate_frames
from michell_cad.parametrization.fold_barrier import (
    BarrierEnergy,
    lower_barrier,
    remove_folds,
    require_injective,
)
from michell_cad.strength.braces import add_braces, alternating_diagonals
from michell_cad.strength.comparison.boundary_frames import boundary_normals, fit_boundary_frames
from michell_cad.tet_mesh import TetMesh
from michell_cad.truss import Truss, clean_network
from michell_cad.truss.inside import keep_inside

SPACING_WEIGHT = 0.3
"""The paper's beta. At 0.1 layers lie closer along the faces still, but some cells of a bracket are four times as long
as most of them; at 1 they are twice as far off."""

LAYER_WEIGHT = 1.0
"""lambda; ten times as much costs the rest of the cells their shape and gains nothing."""


def hex_truss(
    mesh: TetMesh, spacing: float, braced: bool = False, coordinates: Float[np.ndarray, "n_v 3"] | None = None
) -> Truss:
    """A truss along the edges of hexahedral cells that conform to the boundary.

    Parameters
    ----------
    mesh : TetMesh
    spacing : median edge of a cell, mm; changed by up to 5 per cent so that whole cells fit between the faces.
    braced : whether every face of a cell gets one diagonal, those of neighbouring faces in turns.
    coordinates : the `conforming_map`, if there is one already.

    Raises
    ------
    InvalidInputError
        For a spacing that is not positive.
    ConvergenceError
        If no map without folds is found.
    """
    require(np.isfinite(spacing) and spacing > 0, f"spacing must be positive, in mm, found {spacing}")
    parametrization = Parametrization(mesh, conforming_map(mesh) if coordinates is None else coordinates)
    levels, edge = parametrization.levels(None, spacing, layers="hug")
    truss = keep_inside(clean_network(trace_isocurves(mesh, levels), edge)[0], mesh)
    return add_braces(truss, alternating_diagonals(truss, mesh, levels)) if braced else truss


def conforming_map(mesh: TetMesh) -> Float[np.ndarray, "n_v 3"]:
    """Coordinates in units of length whose isosurfaces lie along the faces of the part, without folds."""
    in_tets, on_triangles = fit_boundary_frames(mesh)
    linear = integrate_frames(mesh, in_tets, SPACING_WEIGHT)
    phi = remove_folds(mesh, in_tets, SPACING_WEIGHT, linear)
    phi = _lay_along_faces(mesh, in_tets, layer_stiffness(mesh, on_triangles), linear, phi)
    require_injective(mesh, phi)
    return centre_parts(mesh, phi)


def layer_stiffness(mesh: TetMesh, frames: Float[np.ndarray, "n_b 3 3"]) -> list[sp.csr_matrix]:
    """For each coordinate the matrix K with f' K f = sum_b a_b s_b |P_b grad f|^2, (n_v, n_v), see the module.

    Gradients in a triangle: n x e_k / 2a for the corner opposite to the edge e_k, counter-clockwise.
    """
    corners = mesh.boundary_triangles
    areas = np.linalg.norm(mesh.boundary_area_vectors, axis=1)
    _, normals = boundary_normals(mesh)
    s = np.maximum(0, 2 * np.einsum("bdi,bd->bi", frames, normals) ** 2 - 1) ** 2
    X = mesh.vertices[corners]
    opposite = np.roll(X, 1, axis=1) - np.roll(X, -1, axis=1)
    gradients = np.cross(normals[:, None], opposite) / (2 * areas[:, None, None])
    local = np.einsum("b,bkd,bld->bkl", areas, gradients, gradients)
    rows, columns = np.repeat(corners, 3, axis=1).ravel(), np.tile(corners, 3).ravel()
    shape = (len(mesh.vertices),) * 2
    return [sp.csr_matrix(((weight[:, None, None] * local).ravel(), (rows, columns)), shape=shape) for weight in s.T]


def _lay_along_faces(
    mesh: TetMesh,
    frames: np.ndarray,
    layers: list[sp.csr_matrix],
    linear: LeastSquaresMap,
    phi: np.ndarray,
) -> np.ndarray:
    """Minimise Eq. 11, its barrier against folds and the layer term from a map without folds."""
    equation_11 = BarrierEnergy(mesh, frames, SPACING_WEIGHT, linear)
    # Weights of Eq. 11 are volumes over their mean.
    scale = LAYER_WEIGHT * mesh.size / mesh.volumes.mean()
    free, laplacian = free_vertices(mesh), mesh.laplacian(2 * linear.weights / mesh.volumes)
    factors = [factorise((laplacian + 2 * scale * K)[free][:, free]) for K in layers]

    def energy(phi: np.ndarray) -> tuple[float, np.ndarray]:
        value, gradient = equation_11(phi)
        for i, K in enumerate(layers):
            force = 2 * scale * (K @ phi[:, i])
            value += 0.5 * float(phi[:, i] @ force)
            gradient[:, i] += force
        return value, gradient

    def precondition(gradient: np.ndarray) -> np.ndarray:
        step = np.zeros_like(gradient)  # zero at the pins: a translation changes nothing
        for i, factor in enumerate(factors):
            step[free, i] = factor.solve(np.ascontiguousarray(gradient[free, i]))
        return step

    return lower_barrier(equation_11, energy, phi, precondition)
