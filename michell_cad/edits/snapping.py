"""Snapping: nodes of the truss at given points, by a change of the coordinates that keeps their gradients.

Source: the supplement of Arora et al. 2019 (vertex snapping: a least-squares change of phi that preserves its gradients
subject to phi being integer at chosen vertices). The change u of each coordinate minimises

    integral of |grad u|^2 + h^2 (div grad u)^2,    u(p) = round(phi(p)) - phi(p) at every point p

with the cell edge h. Departures: points need not be vertices of the mesh; and the second term is new, since |grad u|^2
alone has no point values in three dimensions: the finer the mesh, the more the whole change gathers in the tets around
the point and folds them. A single point is met by a shift, which keeps all gradients.

The isocurves are then traced again, so that labels, and what is selected by them, stay.
"""

from dataclasses import replace
from typing import Literal

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int
from pydantic import Field
from scipy.spatial import KDTree

from michell_cad.arrays import require
from michell_cad.curves import NodeKind
from michell_cad.edits.selections import Point
from michell_cad.edits.structure import DesignFields, Edit, Structure
from michell_cad.isocurves import trace_isocurves
from michell_cad.knobs import choose_curves
from michell_cad.linear_solver import factorise
from michell_cad.parametrization.equation_11 import free_vertices
from michell_cad.tet_mesh import TetMesh
from michell_cad.truss import Truss, TrussOptions, clean_network
from michell_cad.truss.inside import keep_inside

CANDIDATES = 64
"""Tets, by the distance of their centroids, among which the one around a point is looked for."""

OUTSIDE = 0.05
"""A point may lie outside of the part by this fraction of a tet edge: surface points do by rounding and by facets."""

FARTHEST = 0.5
"""A node nearer to the point than this (relative to the cell edge) is moved to it; none so near means that it failed.
Cleaning may have merged the node that was traced at the point with a neighbour."""


class Snap(Edit):
    """Nodes at given points, or at the corners of the part."""

    do: Literal["snap"] = "snap"
    points: tuple[Point, ...] = Field(default=(), description="Points in the part or on its surface, mm.")
    corners: bool = Field(default=False, description="The corners of the part as well.")

    def apply(self, structure: Structure) -> Structure:
        require(
            structure.as_traced,
            "edit 'snap': it traces the truss anew, so it comes before edits of the truss; an EditList sees to that",
        )
        truss = structure.design.truss
        corners = truss.nodes[truss.node_kinds == NodeKind.CORNER] if self.corners else np.zeros((0, 3))
        require(len(self.points) or len(corners), "edit 'snap': no point is given, or the part has no corner")
        points = (*structure.snapped, *self.points, *(tuple(corner) for corner in corners.tolist()))
        before = DesignFields.of(structure.design)
        fields = replace(before, levels=snap_levels(before, np.array(points)))
        traced = trace_truss(fields, structure.design.options.truss)
        truss = choose_curves(move_nodes(traced, np.array(points)), structure.knobs)
        return replace(structure, fields=fields, truss=truss, snapped=points)


def snap_levels(fields: DesignFields, points: Float[np.ndarray, "k 3"]) -> Float[np.ndarray, "n_v 3"]:
    """The coordinates, changed so that all three are integer at the points; see the module.

    Raises
    ------
    InvalidInputError
        If a point is outside of the part, two points mean one node, or the change would fold tets.
    """
    mesh, levels = fields.mesh, fields.levels
    corners, weights = locate_points(mesh, points)
    here = np.einsum("kc,kci->ki", weights, levels[corners])
    goal = np.round(here)
    distinct, first, counts = np.unique(goal, axis=0, return_inverse=True, return_counts=True)
    if len(distinct) < len(points):
        a, b = np.flatnonzero(first.ravel() == int(np.argmax(counts)))[:2]
        require(
            False,
            f"edit 'snap': the points {points[a].tolist()} and {points[b].tolist()} would snap to one node: they are "
            f"{np.linalg.norm(points[a] - points[b]):.4g} mm apart, a cell is {fields.spacing:.4g} mm",
        )
    n_v, k = len(mesh.vertices), len(points)
    B = sp.csr_matrix((weights.ravel(), (np.repeat(np.arange(k), 4), corners.ravel())), (k, n_v))
    snapped = levels + smoothest_change(mesh, B, goal - here, fields.spacing)
    was, now = (np.linalg.det(mesh.gradients(values)) for values in (levels, snapped))
    folded = (now <= 0) & (was > 0)
    require(
        not folded.any(),
        f"edit 'snap': these {k} points would fold {folded.sum()} of {len(now)} tets; snap fewer points, or points "
        "farther apart",
    )
    return snapped


def smoothest_change(
    mesh: TetMesh, B: sp.csr_matrix, values: Float[np.ndarray, "k i"], length: float
) -> Float[np.ndarray, "n_v i"]:
    """The u with B u = values that minimises u' (L + length^2 L M^-1 L) u, L the Laplacian and M the lumped mass.

    A constant costs nothing, so with C the indicators of the connected parts, u = v + C c, v zero at one vertex of
    each: v = K^-1 B' m, B v + B C c = values, (B C)' m = 0.
    """
    L = mesh.laplacian(mesh.volumes)
    K = (L + length**2 * L @ sp.diags(1 / mesh.vertex_volumes) @ L).tocsr()
    free = free_vertices(mesh)
    factor = factorise(K[free][:, free])
    rows = B.toarray()
    v = np.zeros(rows.T.shape)
    right = rows.T[free]
    v[free] = np.stack([factor.solve(np.ascontiguousarray(column)) for column in right.T], axis=1)
    BC = rows @ np.eye(mesh.component_of_vertex.max() + 1)[mesh.component_of_vertex]
    k, parts = BC.shape
    system = np.block([[rows @ v, BC], [BC.T, np.zeros((parts, parts))]])
    solution = np.linalg.lstsq(system, np.vstack([values, np.zeros((parts, values.shape[1]))]), rcond=None)[0]
    return v @ solution[:k] + solution[k:][mesh.component_of_vertex]


def locate_points(
    mesh: TetMesh, points: Float[np.ndarray, "k 3"]
) -> tuple[Int[np.ndarray, "k 4"], Float[np.ndarray, "k 4"]]:
    """The vertices of the tet around each point, and the point's barycentric coordinates there.

    Raises
    ------
    InvalidInputError
        If a point is outside of the part.
    """
    centroids = KDTree(mesh.centroids)
    _, near = centroids.query(points, k=min(CANDIDATES, len(mesh.tets)))
    near = near.reshape(len(points), -1)
    corners = mesh.vertices[mesh.tets[near]]
    edges = (corners[:, :, 1:] - corners[:, :, :1]).swapaxes(-1, -2)
    inner = np.linalg.solve(edges, (points[:, None] - corners[:, :, 0])[..., None])[..., 0]
    weights = np.concatenate([1 - inner.sum(-1, keepdims=True), inner], axis=-1)
    best = weights.min(-1).argmax(1)
    rows = np.arange(len(points))
    lowest = weights[rows, best].min(1)
    require(
        lowest.min() >= -OUTSIDE,
        f"edit 'snap': the point {points[int(lowest.argmin())].tolist()} lies outside of the part; "
        "coordinates are in mm",
    )
    return mesh.tets[near[rows, best]], weights[rows, best]


def trace_truss(fields: DesignFields, options: TrussOptions) -> Truss:
    """The truss of the coordinates: the stages `isocurves` and `truss` of the method."""
    network = trace_isocurves(fields.mesh, fields.levels, fields.families)
    return keep_inside(clean_network(network, fields.spacing, options)[0], fields.mesh)


def move_nodes(truss: Truss, points: Float[np.ndarray, "k 3"]) -> Truss:
    """The truss with the node nearest to each point moved there."""
    away, node = (np.asarray(found) for found in KDTree(truss.nodes).query(points))
    far = int(away.argmax())
    require(
        away[far] <= FARTHEST * truss.spacing,
        f"edit 'snap': no node came to lie at {points[far].tolist()}, the nearest is {away[far]:.4g} mm away; "
        "the curves that would meet there end on the surface before; move the point into the part",
    )
    require(
        len(np.unique(node)) == len(node),
        "edit 'snap': two points lie nearest to the same node; snap points at least a cell apart",
    )
    nodes = truss.nodes.copy()
    nodes[node] = points
    return replace(truss, nodes=nodes)
