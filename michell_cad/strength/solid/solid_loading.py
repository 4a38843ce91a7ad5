"""Supports and loads of a truss at the nodes of its solid.

The truss has them from the part already (see `strength.loads`); each of its nodes hands them to the nodes of the solid
in its core, a ball of the radius of its thickest member. A force F and a moment M at X become

    f_i = w_i (F + omega x (x_i - c)),   J omega = M + (X - c) x F,

with the volumes w (sum 1) around the solid's nodes, their centre c and their inertia J: the resultants are exact. What
holds a node of the truss holds the nodes in its core along the same axes. So beams and solid carry the same loads. A
core that is empty, as in a hole of a solid that was kept, has the nodes nearest to it instead.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import KDTree

from michell_cad.arrays import freeze, require
from michell_cad.strength.loads import TrussLoading
from michell_cad.strength.solid.quadratic_mesh import QuadraticMesh
from michell_cad.truss import SizedTruss

FEWEST = 8
"""A core has at least so many nodes of the solid, the nearest ones if need be."""

NEAR = 2.0
"""Stresses within this many core radii of held and loaded nodes are not counted: they depend on how the load enters."""


@dataclass(frozen=True, eq=False)
class SolidLoading:
    """Supports and load cases at the nodes of a solid.

    Parameters
    ----------
    fixed : (n_p, 3) bool, which displacements are zero.
    forces : (n_c, n_p, 3) float, N.
    names : of the load cases.
    counted : (n_p,) bool, nodes far enough from supports and loads for their stress to count.
    """

    fixed: Bool[np.ndarray, "n_p 3"]
    forces: Float[np.ndarray, "n_c n_p 3"]
    names: tuple[str, ...]
    counted: Bool[np.ndarray, " n_p"]

    def __post_init__(self) -> None:
        freeze(self, fixed=bool, forces=np.float64, counted=bool)
        require(self.fixed.any(), "nothing holds the solid")
        require(self.forces.shape == (len(self.names), *self.fixed.shape), "forces must be one array per load case")


def carry_to_solid(mesh: QuadraticMesh, sized: SizedTruss, loading: TrussLoading) -> SolidLoading:
    """Hand the supports and loads of a truss to the nodes of its solid."""
    truss = sized.truss
    core = np.zeros(len(truss.nodes))
    np.maximum.at(core, truss.members, sized.radii[:, [0, 2]])
    held, loaded = np.any(loading.held[:, :3], axis=1), np.any(loading.forces, axis=(0, 2))
    anchored = np.flatnonzero((held | loaded) & (core > 0))
    tree, n_p = KDTree(mesh.nodes), len(mesh.nodes)
    volume = np.bincount(mesh.tets.ravel(), np.repeat(mesh.volumes / 10, 10), n_p)
    fixed, counted = np.zeros((n_p, 3), bool), np.ones(n_p, bool)
    forces = np.zeros((len(loading.names), n_p, 3))
    for node in anchored.tolist():
        X = truss.nodes[node]
        inside = np.array(tree.query_ball_point(X, core[node]), dtype=np.int64)
        if len(inside) < FEWEST:
            inside = np.asarray(tree.query(X, FEWEST)[1])
        counted[np.array(tree.query_ball_point(X, NEAR * core[node]), dtype=np.int64)] = False
        if held[node]:
            fixed[inside] |= loading.held[node, :3]
        if loaded[node]:
            w, load = volume[inside], loading.forces[:, node]
            forces[:, inside] += spread(mesh.nodes[inside], w / w.sum(), X, load[:, :3], load[:, 3:])
    return SolidLoading(fixed, forces, loading.names, counted)


def spread(
    points: Float[np.ndarray, "k 3"],
    weights: Float[np.ndarray, " k"],
    at: Float[np.ndarray, " 3"],
    force: Float[np.ndarray, "n_c 3"],
    moment: Float[np.ndarray, "n_c 3"],
) -> Float[np.ndarray, "n_c k 3"]:
    """Forces on points with the resultants of a force and a moment at a place, case by case; weights sum to 1."""
    centre = weights @ points
    r = points - centre
    squares = np.einsum("k,kd,ke->de", weights, r, r)
    J = np.trace(squares) * np.eye(3) - squares
    omega = np.linalg.solve(J, (moment + np.cross(at - centre, force)).T).T
    return weights[:, None] * (force[:, None] + np.cross(omega[:, None], r))
