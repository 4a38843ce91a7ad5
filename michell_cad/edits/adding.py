"""More curves: a strut between two nodes, or a curve through points.

An added curve has the family ``added``, no isovalues, and the next free component number. It meets the truss in the
nodes that lie nearest to its points; where it passes other members without a common node the solid leads them through
one, see `cad.prepare`.
"""

from dataclasses import replace
from itertools import pairwise
from typing import Literal

import numpy as np
from pydantic import Field

from michell_cad.arrays import require
from michell_cad.curves import Curve, CurveKind, NodeKind
from michell_cad.edits.selections import Point
from michell_cad.edits.structure import Edit, Structure
from michell_cad.truss import Truss

REACH = 0.5
"""A point means the nearest node up to this distance (relative to the cell edge): half a cell, so that it is clear."""


class AddStrut(Edit):
    """A straight member between two nodes."""

    do: Literal["add strut"] = "add strut"
    between: tuple[Point, Point] = Field(description="A point near each of the two nodes, mm.")
    reach: float | None = Field(default=None, gt=0, description="How far the nodes may be, mm; default: half a cell.")

    def apply(self, structure: Structure) -> Structure:
        return _added(structure, self, self.between, loose=False)


class AddCurve(Edit):
    """A curve through points, from node to node."""

    do: Literal["add curve"] = "add curve"
    through: tuple[Point, ...] = Field(
        min_length=2, description="Points along the curve, mm; those near nodes mean these."
    )
    reach: float | None = Field(default=None, gt=0, description="How far the nodes may be, mm; default: half a cell.")
    loose: bool = Field(default=False, description="Whether the curve may end where there is no node.")

    def apply(self, structure: Structure) -> Structure:
        return _added(structure, self, self.through, self.loose)


def _added(structure: Structure, edit: AddStrut | AddCurve, through: tuple[Point, ...], loose: bool) -> Structure:
    """The structure with a curve through points."""
    truss = structure.truss
    reach = REACH * truss.spacing if edit.reach is None else edit.reach
    points = np.array(through)
    away = np.linalg.norm(points[:, None] - truss.nodes, axis=2)
    node = np.where(away.min(1) <= reach, away.argmin(1), -1)
    remedy = (
        "move the point, or raise reach" if isinstance(edit, AddStrut) else "move it, raise reach, or set loose = true"
    )
    for end in (0, -1):
        require(
            node[end] >= 0 or loose,
            f"edit {edit.do!r}: no node lies within {reach:.4g} mm of {through[end]}, the nearest is at "
            f"{_text(truss.nodes[away[end].argmin()])}, {away[end].min():.4g} mm away; {remedy}",
        )
    truss, node = _with_ends(truss, points, node)
    stops = [k for k in range(len(points)) if node[k] >= 0 and (k == 0 or node[k] != node[k - 1])]
    require(len(stops) > 1, f"edit {edit.do!r}: all points mean the same node; move them apart")
    return structure.with_truss(_add(truss, points, node, stops, edit.do))


def _text(point: np.ndarray) -> str:
    return f"({', '.join(f'{value:.4g}' for value in point)})"


def _with_ends(truss: Truss, points: np.ndarray, node: np.ndarray) -> tuple[Truss, np.ndarray]:
    """The truss with a new node at each end of the curve that has none."""
    node = node.copy()
    for end in (0, -1):
        if node[end] < 0:
            node[end] = len(truss.nodes)
            truss = replace(
                truss,
                nodes=np.vstack([truss.nodes, points[end]]),
                node_kinds=np.append(truss.node_kinds, NodeKind.INTERIOR),
            )
    return truss, node


def _add(truss: Truss, points: np.ndarray, node: np.ndarray, stops: list[int], do: str) -> Truss:
    """The truss with a curve through the nodes of some points, and the others as waypoints between them."""
    known = {(int(a), int(b)): m for m, (a, b) in enumerate(truss.members)}
    new, waypoints, members = [], [], []
    for first, last in pairwise(stops):
        between = points[first + 1 : last][node[first + 1 : last] < 0]
        a, b = int(node[first]), int(node[last])
        pair = (min(a, b), max(a, b))
        require(
            pair not in known,
            f"edit {do!r}: a member joins the nodes at {points[first].tolist()} and {points[last].tolist()} already",
        )
        known[pair] = len(truss.members) + len(new)
        members.append(known[pair])
        new.append(pair)
        waypoints.append(between if a < b else between[::-1])
    label = (CurveKind.INTERIOR, (None, None, None))
    component = 1 + max((c.component for c in truss.curves if (c.kind, c.isovalues) == label), default=-1)
    curve = Curve(label[0], "added", -1, label[1], component, node[stops], np.array(members), False)
    counts = [len(part) for part in waypoints]
    return replace(
        truss,
        members=np.vstack([truss.members, new]),
        curves=(*truss.curves, curve),
        waypoints=np.vstack([np.asarray(truss.waypoints), *waypoints]),
        waypoint_offsets=np.concatenate(
            [np.asarray(truss.waypoint_offsets), len(np.asarray(truss.waypoints)) + np.cumsum(counts)]
        ),
    )
