"""A part in voxels: those whose centres lie inside, held and loaded where the part is.

Bricks of one size divide the box around the part, so that a part that is a box is filled exactly. A force on a vertex
of the part goes to the corners of the nearest voxel by its shape functions, which sum up to one and reproduce the
vertex' place: resultant force and moment are exact to rounding, also where the vertex is outside of the staircase of
voxels. Nodes nearest to held triangles are held in the same components.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.ndimage
from jaxtyping import Bool, Float, Int
from scipy.spatial import KDTree

from michell_cad.arrays import freeze, require
from michell_cad.compiled import compiled
from michell_cad.problem import DesignProblem
from michell_cad.rigid_motions import free_motions, rigid_motions
from michell_cad.strength.comparison.voxel_elements import CORNERS, shape_functions
from michell_cad.strength.loads import acting_cases

ON_FACE = 1e-9
"""A centre counts as inside a tet down to barycentric coordinates of minus this: on a common face it is in both."""

SIDES: Int[np.ndarray, "6 4"] = np.array(
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
)
"""Corners of the sides -x, +x, -y, +y, -z, +z of a voxel, counter-clockwise from outside."""

FAR = 2.0
"""A force whose vertex is farther from the centre of the nearest voxel than this (in edges of a voxel) acts where there
are none. Corners of a part that is turned against the voxels are up to so far from a centre inside."""

HELD_STEP = 0.5
"""Held triangles are looked at in points so far apart at most (in edges of a voxel), so that no node is missed."""


@dataclass(frozen=True, eq=False)
class VoxelModel:
    """Voxels with supports and load cases.

    Parameters
    ----------
    edges : (3,) float, mm, of every voxel.
    centres : (n_e, 3) float, mm.
    places : (n_e, 3) int, of the voxels in their lattice.
    nodes : (n_n, 3) float, mm.
    corners : (n_e, 8) int, nodes of each voxel, in the order of `voxel_elements.CORNERS`.
    held : (n_n, 3) bool.
    forces : (n_c, n_n, 3) float, N.
    names : of the load cases.
    weights : (n_c,) float, the cases' weights in a sum of compliances.
    """

    edges: Float[np.ndarray, " 3"]
    centres: Float[np.ndarray, "n_e 3"]
    places: Int[np.ndarray, "n_e 3"]
    nodes: Float[np.ndarray, "n_n 3"]
    corners: Int[np.ndarray, "n_e 8"]
    held: Bool[np.ndarray, "n_n 3"]
    forces: Float[np.ndarray, "n_c n_n 3"]
    names: tuple[str, ...]
    weights: Float[np.ndarray, " n_c"]

    def __post_init__(self) -> None:
        freeze(self, edges=np.float64, centres=np.float64, places=np.int64, nodes=np.float64, corners=np.int64)
        freeze(self, held=bool, forces=np.float64, weights=np.float64)
        n_c, n_n, n_e = len(self.names), len(self.nodes), len(self.centres)
        for name, shape in (("corners", (n_e, 8)), ("held", (n_n, 3)), ("forces", (n_c, n_n, 3)), ("weights", (n_c,))):
            found = getattr(self, name).shape
            require(found == shape, f"voxels: {name} must have shape {shape}, found {found}")
        require(self.corners.min() >= 0 and self.corners.max() < n_n, f"corners must be among the {n_n} nodes")

    @property
    def volume(self) -> float:
        """Of all voxels, mm^3."""
        return len(self.corners) * float(self.edges.prod())


def build_voxel_model(problem: DesignProblem, count: int) -> VoxelModel:
    """Fill a part with about `count` voxels.

    Pieces of voxels (joined by faces) that are not kept in place by nodes of their own are left out.

    Raises
    ------
    InvalidInputError
        If no voxel is inside or in place, or a load acts where there is none, or on held nodes only.
    """
    require(count >= 1, f"the number of voxels must be at least 1, found {count}")
    mesh = problem.mesh
    low, extent = mesh.vertices.min(0), np.ptp(mesh.vertices, axis=0)
    shape = np.maximum(np.rint(extent / (mesh.volumes.sum() / count) ** (1 / 3)), 1).astype(int)
    edges = extent / shape
    inside = np.zeros(shape, bool)
    mark_centres((mesh.vertices[mesh.tets] - low) / edges, ON_FACE, inside)
    size = " x ".join(f"{edge:.3g}" for edge in edges)
    require(inside.any(), f"no voxel of {size} mm has its centre in the part: use more voxels, found {count}")

    lattice, corners = _number_nodes(inside)
    held = _held_nodes(problem, (low, edges), lattice)
    kept = _pieces_in_place(inside, corners, lattice, held)
    require(
        kept.any(),
        f"no piece of the part in voxels of {size} mm is kept in place by the supports: use more voxels, found {count}",
    )
    used, corners = np.unique(corners[kept], return_inverse=True)
    places = np.argwhere(inside)[kept]
    names, forces, weights = acting_cases(problem)
    model = VoxelModel(
        edges,
        low + (places + 0.5) * edges,
        places,
        low + lattice[used] * edges,
        corners.reshape(-1, 8),
        held[used],
        np.zeros((len(names), len(used), 3)),
        names,
        weights,
    )
    return replace(model, forces=carry_over_forces(model, mesh.vertices, forces))


def carry_over_forces(
    model: VoxelModel, points: Float[np.ndarray, "n_v 3"], forces: Float[np.ndarray, "n_c n_v 3"]
) -> Float[np.ndarray, "n_c n_n 3"]:
    """Forces at points as forces on the nodes, see the module; case by case with the same resultants.

    Raises
    ------
    InvalidInputError
        If a force is far from all voxels, or those of a case end on held nodes.
    """
    loaded = (forces != 0).any((0, 2))
    x = points[loaded] / model.edges
    distance, voxel = KDTree(model.centres / model.edges).query(x, p=np.inf)
    distance, voxel = np.asarray(distance), np.asarray(voxel)
    far = int(np.argmax(distance))
    at = ", ".join(f"{value:.4g}" for value in points[loaded][far])
    require(
        distance[far] <= FAR,
        f"the load at ({at}) mm is {distance[far]:.1f} voxels away from the nearest one that is held: use more voxels, "
        f"found {len(model.centres)}",
    )
    shares = shape_functions(2 * (x - model.centres[voxel] / model.edges))
    on_nodes = np.zeros((len(model.nodes), len(forces), 3))
    np.add.at(on_nodes, model.corners[voxel], np.einsum("va,cvd->vacd", shares, forces[:, loaded]))
    carried = on_nodes.swapaxes(0, 1)
    for name, force in zip(model.names, carried, strict=True):
        require(
            (force[~model.held] != 0).any(),
            f"load case {name!r} acts on held nodes of voxels only: use more voxels, found {len(model.centres)}",
        )
    return carried


def voxel_surface(model: VoxelModel, chosen: Bool[np.ndarray, " n_e"]) -> Int[np.ndarray, "n 3"]:
    """Triangles (nodes, seen counter-clockwise from outside) around the chosen voxels."""
    sides = model.corners[chosen][:, SIDES].reshape(-1, 4)
    # Two voxels see the side between them from opposite ends: its nodes are the same.
    _, inverse, counts = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True, return_counts=True)
    outer = sides[counts[inverse.ravel()] == 1]
    return np.concatenate([outer[:, [0, 1, 2]], outer[:, [0, 2, 3]]])


def _number_nodes(inside: Bool[np.ndarray, "a b c"]) -> tuple[Int[np.ndarray, "n_n 3"], Int[np.ndarray, "n_e 8"]]:
    """Lattice coordinates of the corners of the voxels inside, each once, and their numbers at each voxel."""
    steps = ((CORNERS + 1) / 2).astype(int)
    corners = np.argwhere(inside)[:, None] + steps
    shape = tuple(n + 1 for n in inside.shape)
    keys, number = np.unique(np.ravel_multi_index(tuple(corners.reshape(-1, 3).T), shape), return_inverse=True)
    return np.stack(np.unravel_index(keys, shape), axis=1), number.reshape(-1, 8)


def _held_nodes(
    problem: DesignProblem, box: tuple[np.ndarray, np.ndarray], lattice: np.ndarray
) -> Bool[np.ndarray, "n_n 3"]:
    """Nodes nearest to held vertices, and to points of the triangles between them, component by component."""
    mesh, (low, edges) = problem.mesh, box
    tree, held = KDTree(lattice), np.zeros((len(lattice), 3), bool)
    for axis in range(3):
        fixed = problem.fixed[:, axis]
        triangles = mesh.boundary_triangles[fixed[mesh.boundary_triangles].all(1)]
        points = [(mesh.vertices[fixed] - low) / edges]
        corners = (mesh.vertices[triangles] - low) / edges
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(1)
        cuts = np.ceil(longest / HELD_STEP).astype(int)
        for n in np.unique(cuts):
            i, j = (grid.ravel() for grid in np.mgrid[: n + 1, : n + 1])
            weights = np.stack([i, j, n - i - j], axis=1)[i + j <= n] / n
            points.append(np.einsum("pa,tad->tpd", weights, corners[cuts == n]).reshape(-1, 3))
        held[np.asarray(tree.query(np.concatenate(points))[1]), axis] = True
    return held


def _pieces_in_place(
    inside: np.ndarray, corners: np.ndarray, lattice: np.ndarray, held: np.ndarray
) -> Bool[np.ndarray, " n_e"]:
    """Which voxels are in a piece that its held nodes leave no rigid motion."""
    labelled: Any = scipy.ndimage.label(inside)
    labels = labelled[0][inside]
    kept = np.zeros(len(corners), bool)
    for label in np.unique(labels):
        nodes = np.unique(corners[labels == label])
        x = lattice[nodes] - lattice[nodes].mean(0)
        rows = rigid_motions(x / max(np.ptp(x, axis=0).max(), 1))[held[nodes]]
        kept[labels == label] = len(rows) >= 6 and free_motions(rows).shape[1] == 0
    return kept


def _mark_centres(tets: Any, tolerance: float, inside: Any) -> None:
    """Mark the unit cells of a lattice whose centres lie in a tet; tets (n_t, 4, 3) are corners in lattice units."""
    shape = inside.shape
    low, high = np.empty(3, np.int64), np.empty(3, np.int64)
    E, inverse, x = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for t in range(len(tets)):
        for d in range(3):
            least, most = tets[t, :, d].min(), tets[t, :, d].max()
            low[d], high[d] = max(0, int(np.ceil(least - 0.5))), min(shape[d] - 1, int(np.floor(most - 0.5)))
            for k in range(3):
                E[d, k] = tets[t, k + 1, d] - tets[t, 0, d]
        inverse[:] = np.linalg.inv(E)
        for i in range(low[0], high[0] + 1):
            for j in range(low[1], high[1] + 1):
                for k in range(low[2], high[2] + 1):
                    x[0], x[1], x[2] = i + 0.5 - tets[t, 0, 0], j + 0.5 - tets[t, 0, 1], k + 0.5 - tets[t, 0, 2]
                    within, total = True, 0.0
                    for a in range(3):
                        value = inverse[a, 0] * x[0] + inverse[a, 1] * x[1] + inverse[a, 2] * x[2]
                        total += value
                        within &= value >= -tolerance
                    if within and total <= 1 + tolerance:
                        inside[i, j, k] = True


mark_centres = compiled(_mark_centres)
