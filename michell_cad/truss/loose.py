"""Loose pieces: feature edges and curves that end up on their own, too few members to be a structure.

A sharp edge which no other curve meets, between two that were merged away, becomes a piece of one or two members. It
carries nothing and would be a splinter of the finished part.
"""

import numpy as np
from jaxtyping import Float
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from michell_cad.truss.draft import Draft

LOOSE_MEMBERS = 12
"""A piece of at most so many members is loose: the edges of one cell."""


def drop_loose(draft: Draft, anchors: Float[np.ndarray, "n 3"], spacing: float) -> tuple[Draft, int, int]:
    """Leave out small pieces that neither the rest of the truss nor a support or load touches.

    Parameters
    ----------
    draft : Draft
    anchors : points where the part is held or loaded, mm. A piece with a node within one spacing of one of them stays.
    spacing : mm, edge of a typical truss cell.

    Returns
    -------
    The draft without them, the number of pieces, and of their members. The largest piece stays always.
    """
    pairs, _, _ = draft.pairs()
    n = len(draft.nodes)
    piece = connected_components(coo_matrix((np.ones(len(pairs)), pairs.T), shape=(n, n)), directed=False)[1]
    members = np.bincount(piece[pairs[:, 0]], minlength=int(piece.max(initial=-1)) + 1)
    loose = (members > 0) & (members <= LOOSE_MEMBERS) & (members < members.max(initial=0))
    if len(anchors):
        near = KDTree(anchors).query(draft.nodes, distance_upper_bound=spacing)[0] < np.inf
        loose[piece[near & (np.bincount(draft.sequence, minlength=n) > 0)]] = False
    if not loose.any():
        return draft, 0, 0
    return draft.kept(~loose[piece[draft.sequence]]), int(loose.sum()), int(members[loose].sum())
