"""Parts of a truss that can move: with rigid joints, connected parts that their supports leave a rigid motion."""

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Int
from scipy.sparse.csgraph import connected_components

from michell_cad.arrays import freeze
from michell_cad.errors import InvalidInputError
from michell_cad.problem import DesignProblem
from michell_cad.rigid_motions import free_motions, name_motions, rigid_motions
from michell_cad.strength.loads import held_nodes
from michell_cad.truss import SizedTruss, Truss, keep_curves

NAMED_PARTS = 3
"""Loose parts that a message names; the others it counts."""


@dataclass(frozen=True, eq=False)
class LoosePart:
    """A connected part of a truss that is free to move.

    Parameters
    ----------
    members : (k,) int, its members, ascending.
    motions : how it can move, in words.
    """

    members: Int[np.ndarray, " k"]
    motions: tuple[str, ...]

    def __post_init__(self) -> None:
        freeze(self, members=np.int64)


def find_loose_parts(truss: Truss, held: Bool[np.ndarray, "n_n 6"]) -> list[LoosePart]:
    """Find the connected parts of a truss that these held displacements and rotations leave free to move."""
    n_n = len(truss.nodes)
    graph = sp.coo_matrix((np.ones(len(truss.members)), tuple(truss.members.T)), shape=(n_n, n_n))
    part_of_node = connected_components(graph, directed=False)[1]
    part_of_member = part_of_node[truss.members[:, 0]]
    loose = []
    for part in np.unique(part_of_member):
        nodes = np.flatnonzero(part_of_node == part)
        x = truss.nodes[nodes]
        x = (x - x.mean(0)) / np.ptp(x, axis=0).max()
        rows = np.zeros((len(x), 6, 6))
        rows[:, :3] = rigid_motions(x)
        rows[:, 3:, 3:] = np.eye(3)
        motions = name_motions(free_motions(rows[held[nodes]]))
        if motions:
            loose.append(LoosePart(np.flatnonzero(part_of_member == part), tuple(motions)))
    return loose


def require_no_loose_part(truss: Truss, held: Bool[np.ndarray, "n_n 6"]) -> None:
    """Refuse a mechanism, naming what is loose by its curve, its place and its motions."""
    loose = find_loose_parts(truss, held)
    if loose:
        more = f"; and {len(loose) - NAMED_PARTS} more" if len(loose) > NAMED_PARTS else ""
        raise InvalidInputError(
            f"the truss is a mechanism, {len(loose)} of its connected parts can move: "
            + "; ".join(_describe(truss, part) for part in loose[:NAMED_PARTS])
            + f"{more}. Keep curves that join them to a held region (knobs.family, knobs.every), hold more faces, or "
            "leave them out (keep_supported)"
        )


def keep_supported(problem: DesignProblem, truss: Truss) -> Truss:
    """The truss without its loose parts: short curves in thin places may have met no other curve.

    Raises
    ------
    InvalidInputError
        If nothing is left.
    """
    while loose := find_loose_parts(truss, held_nodes(problem, truss)):
        going = np.zeros(len(truss.members), bool)
        going[np.concatenate([part.members for part in loose])] = True
        if going.all():
            raise InvalidInputError(
                f"no part of the truss is supported: {_describe(truss, loose[0])}. Hold more faces, or keep more curves"
            )
        truss = keep_curves(truss, np.array([not going[curve.members[0]] for curve in truss.curves]))
    return truss


def leave_out_loose_parts(problem: DesignProblem, sized: SizedTruss) -> tuple[SizedTruss, list[str]]:
    """The truss without its loose parts, with the same radii and nodes, and a note on each of the first loose parts.

    Raises
    ------
    InvalidInputError
        If nothing is left.
    """
    notes: list[str] = []
    while loose := find_loose_parts(sized.truss, held_nodes(problem, sized.truss)):
        notes += [f"a loose part carries nothing: {_describe(sized.truss, part)}" for part in loose[:NAMED_PARTS]]
        if len(loose) > NAMED_PARTS:
            notes.append(f"{len(loose) - NAMED_PARTS} more loose parts carry nothing")
        stays = np.ones(len(sized.truss.members), bool)
        stays[np.concatenate([part.members for part in loose])] = False
        if not stays.any():
            raise InvalidInputError(
                f"no part of the truss is supported: {_describe(sized.truss, loose[0])}. Hold more faces, or keep "
                "more curves"
            )
        sized = _keep_members(sized, stays)
    return sized, notes


def _keep_members(sized: SizedTruss, stays: Bool[np.ndarray, " n_m"]) -> SizedTruss:
    """Whole connected parts of a truss; the other nodes stay, without members."""
    truss = sized.truss
    number = np.cumsum(stays) - 1
    counts = np.diff(np.asarray(truss.waypoint_offsets))
    kept = replace(
        truss,
        members=truss.members[stays],
        curves=tuple(
            replace(curve, members=number[curve.members]) for curve in truss.curves if stays[curve.members[0]]
        ),
        waypoints=np.asarray(truss.waypoints)[np.repeat(stays, counts)],
        waypoint_offsets=np.concatenate([[0], np.cumsum(counts[stays])]),
    )
    return SizedTruss(kept, sized.radii[stays])


def _describe(truss: Truss, part: LoosePart) -> str:
    x, y, z = truss.nodes[truss.members[part.members]].reshape(-1, 3).mean(0)
    curves = [truss.curves[c].name for c in np.unique(truss.curve_of_member[part.members])]
    others = f" and {len(curves) - 1} more" if len(curves) > 1 else ""
    members = f"{len(part.members)} member{'s' if len(part.members) > 1 else ''}"
    return f"{curves[0]}{others}, {members} around ({x:.4g}, {y:.4g}, {z:.4g}) mm: {', '.join(part.motions)}"
