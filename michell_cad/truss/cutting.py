"""Cutting curves: keep some members of a truss, and take off what hangs loose.

A member that goes takes nothing else along, so a curve falls into pieces. The first piece keeps the label; the others
get the next free component numbers of the same kind and isovalues.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Int

from michell_cad.arrays import expand, require
from michell_cad.curves import Curve
from michell_cad.truss.subset import keep_curves
from michell_cad.truss.values import Truss


def keep_members(
    truss: Truss, members: Bool[np.ndarray, " n_m"], curves: Bool[np.ndarray, " n_c"] | None = None
) -> Truss:
    """Keep the members in a mask, on the curves in another (default: all); nodes no longer needed dissolve.

    Raises
    ------
    InvalidInputError
        If nothing would be left.
    """
    curves = np.ones(len(truss.curves), bool) if curves is None else curves
    if members.all() and curves.all():
        return truss
    pieces = cut_curves([c for c, keep in zip(truss.curves, curves, strict=True) if keep], members)
    require(pieces, "nothing would be left of the truss")
    used = np.unique(np.concatenate([piece.members for piece in pieces]))
    number = np.full(len(members), -1)
    number[used] = np.arange(len(used))
    offsets = np.asarray(truss.waypoint_offsets)
    owner, local = expand(np.diff(offsets)[used])
    left = replace(
        truss,
        members=truss.members[used],
        curves=tuple(replace(piece, members=number[piece.members]) for piece in pieces),
        waypoints=np.asarray(truss.waypoints)[offsets[used][owner] + local],
        waypoint_offsets=np.concatenate([[0], np.cumsum(np.diff(offsets)[used])]),
    )
    return keep_curves(left, np.ones(len(pieces), bool))


def take_curves(truss: Truss, curves: Bool[np.ndarray, " n_c"]) -> tuple[Truss, Int[np.ndarray, " n_left"]]:
    """Some curves with all of their members and nodes, none of which dissolves; and the numbers of these members."""
    chosen = [c for c, keep in zip(truss.curves, curves, strict=True) if keep]
    require(chosen, "no curve is chosen")
    used = np.unique(np.concatenate([c.members for c in chosen]))
    nodes, ends = np.unique(truss.members[used], return_inverse=True)
    node, member = np.full(len(truss.nodes), -1), np.full(len(truss.members), -1)
    node[nodes], member[used] = np.arange(len(nodes)), np.arange(len(used))
    offsets = np.asarray(truss.waypoint_offsets)
    owner, local = expand(np.diff(offsets)[used])
    taken = replace(
        truss,
        nodes=truss.nodes[nodes],
        node_kinds=truss.node_kinds[nodes],
        members=ends.reshape(-1, 2),
        curves=tuple(replace(c, nodes=node[c.nodes], members=member[c.members]) for c in chosen),
        waypoints=np.asarray(truss.waypoints)[offsets[used][owner] + local],
        waypoint_offsets=np.concatenate([[0], np.cumsum(np.diff(offsets)[used])]),
    )
    return taken, used


def open_ends(truss: Truss) -> Int[np.ndarray, " k"]:
    """Nodes with one member only."""
    return np.flatnonzero(truss.degrees == 1)


def without_loose(
    truss: Truss, members: Bool[np.ndarray, " n_m"], stays: Bool[np.ndarray, " n_n"]
) -> Bool[np.ndarray, " n_m"]:
    """Of the members in a mask those that do not hang loose: chains that end at a node with no other member go.

    Ends at the nodes in `stays` count as held.
    """
    left = members.copy()
    while True:
        degree = np.bincount(truss.members[left].ravel(), minlength=len(truss.nodes))
        loose = left & ((degree == 1) & ~stays)[truss.members].any(1)
        if not loose.any():
            return left
        left &= ~loose


def cut_curves(curves: list[Curve], members: Bool[np.ndarray, " n_m"]) -> list[Curve]:
    """The pieces of curves along the members in a mask, each with a label of its own."""
    taken = Counter[tuple]()
    for curve in curves:
        key = (curve.kind, curve.isovalues)
        taken[key] = max(taken[key], curve.component + 1)
    pieces = []
    for curve in curves:
        for count, piece in enumerate(_runs(curve, members[curve.members])):
            if count:
                key = (curve.kind, curve.isovalues)
                piece = replace(piece, component=taken[key])
                taken[key] += 1
            pieces.append(piece)
    return pieces


def _runs(curve: Curve, kept: np.ndarray) -> Iterator[Curve]:
    """The pieces of a curve along its kept steps."""
    if kept.all():
        yield curve
        return
    nodes, members = curve.nodes, curve.members
    if curve.closed:  # begin behind a step that goes
        head = int(np.argmin(kept)) + 1
        nodes, members, kept = np.roll(nodes, -head), np.roll(members, -head), np.roll(kept, -head)
        nodes = np.append(nodes, nodes[0])
    steps = np.diff(np.concatenate([[0], kept.astype(np.int8), [0]]))
    for first, last in zip(np.flatnonzero(steps == 1), np.flatnonzero(steps == -1), strict=True):
        yield replace(curve, nodes=nodes[first : last + 1], members=members[first:last], closed=False)
