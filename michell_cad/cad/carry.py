"""Keep the layout of what a change of the truss did not touch."""

import numpy as np

from michell_cad.cad.layout import Layout, shake, start_layout
from michell_cad.truss import SizedTruss


def carry_over(old: Layout, sized: SizedTruss, number: np.ndarray) -> Layout:
    """A layout of a changed truss that keeps what is done wherever nothing changed.

    Parameters
    ----------
    old : layout of the truss before.
    sized : the truss after.
    number : (n_n,) new number of every old node, -1 for none.
    """
    there = number >= 0
    growth = np.ones(len(sized.truss.nodes))
    np.maximum.at(growth, number[there], old.growth[there])
    new = start_layout(sized, old.knobs, growth, known=old)
    shakes = np.zeros(len(growth), int)
    np.maximum.at(shakes, number[there], old.shakes[there])
    shake(new, shakes)
    was, now = _match_members(old, new, number)
    ends_was, ends_now = (np.stack([2 * m, 2 * m + 1], axis=1).ravel() for m in (was, now))
    new.aim[ends_now], new.lift[ends_now] = old.aim[ends_was], old.lift[ends_was]
    new.smoothed[now] = old.smoothed[was]
    new.points[now], new.directions[now] = old.points[was], old.directions[was]
    # A node keeps everything if all its members do.
    kept = np.bincount(new.node[ends_now], minlength=len(growth)) == np.bincount(new.node, minlength=len(growth))
    node_was = np.full(len(growth), -1)
    node_was[new.node[ends_now]] = old.node[ends_was]
    kept &= (node_was >= 0) & (np.bincount(old.node, minlength=len(number))[node_was] > 0)
    kept &= np.bincount(old.node, minlength=len(number))[node_was] == np.bincount(new.node, minlength=len(growth))
    kept[kept] = ~(old.stale | old.unplaced)[node_was[kept]]
    kept[_reordered(old.node[ends_was], ends_was, ends_now, new.node)] = False
    chosen = np.flatnonzero(kept)
    new.level[chosen], new.nudges[chosen] = old.level[node_was[chosen]], old.nudges[node_was[chosen]]
    new.sizes["radius"][chosen] = old.sizes["radius"][node_was[chosen]]
    place_of = np.full(len(old.node), -1)
    place_of[ends_was] = ends_now
    at = kept[new.node[ends_now]]
    for name in ("end_radius", "fillet", "reach", "creased"):
        new.sizes[name][ends_now[at]] = old.sizes[name][ends_was[at]]
    rival = old.sizes["rival"][ends_was[at]]
    new.sizes["rival"][ends_now[at]] = np.where(rival >= 0, place_of[rival], -1)
    for name, column in new.seams.items():
        column[chosen] = old.seams[name][node_was[chosen]]
    new.mitres = {
        int(i): old.mitres[j] for i, j in zip(chosen, node_was[chosen].tolist(), strict=True) if j in old.mitres
    }
    new.stale[chosen] = new.unplaced[chosen] = False
    fit = ~old.unfit[was] & kept[sized.truss.members[now]].all(1)
    for name, column in new.tubes.items():
        if isinstance(column, list):
            for m, i in zip(now[fit].tolist(), was[fit].tolist(), strict=True):
                column[m] = old.tubes[name][i]
        else:
            column[now[fit]] = old.tubes[name][was[fit]]
    new.unfit[now[fit]] = False
    new.unturned[now[fit]] = old.unturned[was[fit]]
    return new


def _reordered(node: np.ndarray, was: np.ndarray, now: np.ndarray, node_now: np.ndarray) -> np.ndarray:
    """Nodes (by new numbers) at which ends have another order than before: seams and mitres count ends in order."""
    order = np.lexsort((was, node))
    node, now = node[order], now[order]
    backward = np.flatnonzero((node[1:] == node[:-1]) & (now[1:] < now[:-1]))
    return node_now[now[backward]]


def _match_members(old: Layout, new: Layout, number: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Members, before and after, that have the same curve, radii and sense."""
    n = len(new.level)
    ends = number[old.sized.truss.members]
    before = np.flatnonzero((ends >= 0).all(1))
    key = ends[before, 0] * n + ends[before, 1]
    members = new.sized.truss.members
    _, at, after = np.intersect1d(key, members[:, 0] * n + members[:, 1], return_indices=True)
    was = before[at]
    same = (old.design.points[was] == new.design.points[after]).all((1, 2))
    same &= (old.design.directions[was] == new.design.directions[after]).all((1, 2))
    same &= (old.sized.radii[was] == new.sized.radii[after]).all(1)
    return was[same], after[same]
