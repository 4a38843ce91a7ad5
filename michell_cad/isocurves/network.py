"""The traced curve network, as it comes out of the tracer: exact topology, short members and all."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from michell_cad.arrays import freeze
from michell_cad.curves import Curves


@dataclass(frozen=True, eq=False)
class CurveNetwork:
    """Integer isocurves of a parametrization: interior, boundary and sharp-feature curves over shared nodes.

    Parameters
    ----------
    nodes : (n_n, 3) float, mm.
    node_kinds : (n_n,) int, values of `NodeKind`.
    node_levels : (n_n, 3) float, the parametrization (in cells) at the nodes; integer to rounding where a curve says
        so.
    members : (n_m, 2) int. Unlike in a `Truss`, two members may join the same two nodes (lens-shaped re-entries, or a
        boundary and an interior curve), and a closed curve through one node only has a member from it to itself.
    path_points : (n_p, 3) float, mm, where the member crosses the faces of the tets between its two nodes, in order
        from its first node to its second; those of member m are ``path_offsets[m] : path_offsets[m + 1]``.
    path_offsets : (n_m + 1,) int.
    curves : labelled curves; every member belongs to exactly one.
    """

    nodes: Float[np.ndarray, "n_n 3"]
    node_kinds: Int[np.ndarray, " n_n"]
    node_levels: Float[np.ndarray, "n_n 3"]
    members: Int[np.ndarray, "n_m 2"]
    path_points: Float[np.ndarray, "n_p 3"]
    path_offsets: Int[np.ndarray, " n_m1"]
    curves: Curves

    def __post_init__(self) -> None:
        freeze(self, nodes=np.float64, node_kinds=np.int64, node_levels=np.float64, members=np.int64)
        freeze(self, path_points=np.float64, path_offsets=np.int64)
