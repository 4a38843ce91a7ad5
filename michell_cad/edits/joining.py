"""Joining two trusses at the common face of their parts, so that their nodes meet there (Arora et al. 2019, Figure 17).

The first truss keeps its net on the common face. Of the second one what runs in the face goes, and the nodes in which
its other members end there move to nodes of the first, each to one of its own: those that meet already stay, and the
sum of the squared ways of the others is least. What finds no node within reach is taken off.
"""

from collections import Counter
from dataclasses import replace
from typing import Literal

import igl
import numpy as np
from jaxtyping import Bool, Float, Int
from pydantic import Field
from scipy.optimize import linear_sum_assignment

from michell_cad.arrays import require
from michell_cad.curves import Curve
from michell_cad.edits.sheets import AddSheet
from michell_cad.edits.structure import Edit, SelectingEdit, Structure
from michell_cad.tet_mesh import TetMesh
from michell_cad.truss import NodeKind, Truss, keep_members, without_loose

ON_FACE = 0.1
"""Nodes nearer to the other part than this lie on the common face (relative to the cell edge)."""

LARGEST_OVERLAP = 0.05
"""Parts that touch overlap by no more than this share of the smaller one: bent faces of two meshes do a little."""

REACH = 1.0
"""So far a node may move to meet one of the other truss (relative to the larger cell edge)."""


class Join(Edit):
    """The truss of another design, with its own knobs and edits, joined to this one.

    Its curves are chosen, edited and sized as its own file says, and its tags, sheets, attachments and what it keeps
    come along. Edits that stand before this one in the list are about the structure without it, later ones about all.
    Node and fillet ratio and the profile are of the whole solid, so that they are those of this design.
    """

    do: Literal["join"] = "join"
    design: str = Field(description="The other design file, in the same coordinates.")
    reach: float | None = Field(default=None, gt=0, description="How far nodes may move, mm; default: a cell edge.")

    def apply(self, structure: Structure) -> Structure:
        from michell_cad.design_file import open_structure  # which knows all edits, this one among them

        other = open_structure(self.design)
        first, count = len(structure.pieces), len(other.pieces)
        curves = tuple(replace(curve, part=curve.part + first) for curve in other.truss.curves)
        second = replace(other.truss, curves=curves)
        truss = join_trusses(structure.truss, structure.whole_mesh, second, other.whole_mesh, self.reach)
        mine = [_about(edit, 0, range(first)) for edit in structure.noted]
        theirs = [_about(edit, first, range(first, first + count)) for edit in other.noted]
        # What they say of curves in the common face, which go, is void.
        theirs = [edit for edit in theirs if not isinstance(edit, SelectingEdit) or edit.where.members(truss).any()]
        kept = tuple(replace(one, name=f"joined {one.name}") for one in other.whole_kept)
        return replace(
            structure.with_truss(truss),
            noted=(*mine, *theirs),
            joined=(*structure.joined, *other.pieces),
            kept_of_others=(*structure.kept_of_others, *kept),
        )


def _about(edit: Edit, shift: int, parts: range) -> Edit:
    """A noted edit in a structure where its parts have higher numbers, about these only."""
    if isinstance(edit, SelectingEdit):
        shifted: SelectingEdit = edit.model_copy(update={"where": edit.where.shifted(shift)})
        return shifted.narrowed(parts)
    return edit.model_copy(update={"part": edit.part + shift}) if isinstance(edit, AddSheet) else edit


def join_trusses(first: Truss, part: TetMesh, second: Truss, other_part: TetMesh, reach: float | None = None) -> Truss:
    """One truss of two, whose nodes on the common face of their parts meet.

    The labels of the second one get component numbers after those of the first.

    Raises
    ------
    InvalidInputError
        If the parts overlap, or no two nodes on the common face are within reach of each other.
    """
    share = _overlap(part, other_part)
    require(
        share <= LARGEST_OVERLAP,
        f"edit 'join': the parts overlap by {share:.0%} of the smaller one; they must have a face in common, each on "
        "its own side",
    )
    spacing = max(first.spacing, second.spacing)
    reach = REACH * spacing if reach is None else reach
    hosts = np.flatnonzero(on_surface(first, other_part, ON_FACE * spacing))
    in_face = on_surface(second, part, ON_FACE * spacing)
    require(
        len(hosts) and in_face.any(),
        f"edit 'join': the parts have no common face: {len(hosts)} nodes of the first truss and {in_face.sum()} of the "
        f"second lie within {ON_FACE * spacing:.3g} mm of the other part; both must be in the same coordinates",
    )
    across = np.asarray(~in_face[second.members].all(1))
    guests = np.intersect1d(np.flatnonzero(in_face), second.members[across])
    away = np.linalg.norm(second.nodes[guests, None] - first.nodes[hosts], axis=2)
    cost = np.minimum(away, 2 * reach) ** 2
    # Worth more than all others together: a sharp edge that goes on behind the face is not bent to spare others a way.
    cost[_meeting(away, ON_FACE * spacing)] = -4 * reach**2 * len(guests)
    rows, columns = linear_sum_assignment(cost)
    near = away[rows, columns] <= reach
    require(
        near.any(),
        f"edit 'join': no nodes meet: on the common face they are at least {away.min():.3g} mm apart, and may move by "
        f"{reach:.3g} mm; raise reach",
    )
    partner = np.full(len(second.nodes), -1)
    partner[guests[rows[near]]] = hosts[columns[near]]
    left = without_loose(second, across, stays=(second.degrees <= 1) | (partner >= 0))
    return _unite(first, *_cut(second, left, partner))


def _meeting(away: Float[np.ndarray, "g h"], distance: float) -> Bool[np.ndarray, "g h"]:
    """Pairs that meet already: nearer than a distance, and each the nearest of the other."""
    nearest = (away == away.min(1, keepdims=True)) & (away == away.min(0, keepdims=True))
    return nearest & (away <= distance)


def _overlap(part: TetMesh, other: TetMesh) -> float:
    """How much of the smaller part lies in the other one, by the tets' centroids."""
    small, large = sorted((part, other), key=lambda mesh: mesh.volumes.sum())
    winding = igl.fast_winding_number(large.vertices, large.boundary_triangles, small.centroids)
    return float(small.volumes[np.asarray(winding) > 0.5].sum() / small.volumes.sum())


def on_surface(truss: Truss, part: TetMesh, distance: float) -> Bool[np.ndarray, " n_n"]:
    """Nodes on the surface of their own part that are nearer than a distance to another one."""
    squared = np.asarray(igl.point_mesh_squared_distance(truss.nodes, part.vertices, part.boundary_triangles)[0])
    return (truss.node_kinds != NodeKind.INTERIOR) & (squared <= distance**2)


def _cut(truss: Truss, members: np.ndarray, partner: np.ndarray) -> tuple[Truss, np.ndarray]:
    """The truss with some of its members, and the partners of the nodes that are left."""
    places = {tuple(place): int(host) for place, host in zip(truss.nodes.tolist(), partner, strict=True)}
    left = keep_members(truss, members)
    return left, np.array([places[tuple(place)] for place in left.nodes.tolist()])


def _unite(first: Truss, second: Truss, partner: Int[np.ndarray, " n_n"]) -> Truss:
    """Both trusses as one; nodes of the second with a partner become it."""
    new = np.flatnonzero(partner < 0)
    number = partner.copy()
    number[new] = len(first.nodes) + np.arange(len(new))
    ends = number[second.members]
    turned = ends[:, 0] > ends[:, 1]
    offsets, points = np.asarray(second.waypoint_offsets), np.array(second.waypoints)
    for m in np.flatnonzero(turned):
        points[offsets[m] : offsets[m + 1]] = points[offsets[m] : offsets[m + 1]][::-1]
    return Truss(
        np.concatenate([first.nodes, second.nodes[new]]),
        np.concatenate([first.node_kinds, second.node_kinds[new]]),
        np.concatenate([first.members, np.sort(ends, axis=1)]),
        (*first.curves, *_relabelled(first, second, number)),
        min(first.spacing, second.spacing),
        np.concatenate([np.asarray(first.waypoints), points]),
        np.concatenate([np.asarray(first.waypoint_offsets), np.asarray(first.waypoint_offsets)[-1] + offsets[1:]]),
    )


def _relabelled(first: Truss, second: Truss, number: np.ndarray) -> list[Curve]:
    """The curves of the second truss with new node and member numbers, and components that the first does not have."""
    used = Counter[tuple]()
    for curve in first.curves:
        key = (curve.kind, curve.isovalues)
        used[key] = max(used[key], curve.component + 1)
    return [
        replace(
            curve,
            component=curve.component + used[curve.kind, curve.isovalues],
            nodes=number[curve.nodes],
            members=curve.members + len(first.members),
        )
        for curve in second.curves
    ]
