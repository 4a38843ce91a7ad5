"""The truss: nodes, members, and the labelled curves that share them.

A truss is the graph of Arora et al. 2019, Section 4.4 (Eqs. 12 and 13), read as three families of curves. Departing
from the paper, the label of a curve holds the isovalues *and* a component number, since several disjoint curves can
have the same isovalues, and boundary and sharp-feature curves are curves with labels like all others.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum, StrEnum
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from michell_cad.arrays import freeze, require


class CurveKind(StrEnum):
    """Where a curve runs."""

    INTERIOR = "interior"
    """Two coordinates are integer; the curve runs through the solid along the third."""
    BOUNDARY = "boundary"
    """One coordinate is integer; the curve runs on the surface, between two sharp features or closed."""
    FEATURE = "feature"
    """The curve follows a sharp edge of the part."""


class NodeKind(IntEnum):
    """Where a node lies."""

    INTERIOR = 0
    BOUNDARY = 1
    FEATURE = 2
    CORNER = 3
    """The end of sharp features, or a sharp bend of one."""


FAMILIES = ("tension", "compression", "third", "feature")
"""Names of the families. Interior and boundary curves have one of the first three, see `metrics.name_families`."""

Isovalues = tuple[int | None, int | None, int | None]
"""The integer values of the three coordinates along a curve; None for a coordinate that varies."""


@dataclass(frozen=True, eq=False)
class Curve:
    """One labelled curve of a truss: (kind, isovalues, component) is unique in a truss.

    Parameters
    ----------
    kind : CurveKind
    family : one of `FAMILIES`.
    axis : coordinate (0, 1, 2) along which the curve runs; -1 for a feature curve.
    isovalues : integer coordinates of the curve, None for those that vary.
    component : 0, 1, ... numbers the curves that have the same kind and isovalues.
    nodes : (k,) int, nodes in order along the curve. A closed curve does not repeat its first node.
    members : (k - 1,) int, or (k,) for a closed curve; member i joins nodes i and i + 1 (either direction).
    closed : whether the last member returns to the first node.
    """

    kind: CurveKind
    family: str
    axis: int
    isovalues: Isovalues
    component: int
    nodes: Int[np.ndarray, " k"]
    members: Int[np.ndarray, " m"]
    closed: bool

    def __post_init__(self) -> None:
        freeze(self, nodes=np.int64, members=np.int64)
        require(self.family in FAMILIES, f"family must be one of {FAMILIES}, found {self.family!r}")
        expected = len(self.nodes) - (not self.closed)
        require(
            len(self.members) == expected and expected >= 1,
            f"a curve through {len(self.nodes)} nodes must have {expected} members, found {len(self.members)}",
        )

    @property
    def name(self) -> str:
        """The label as text, for example ``tension (4, *, 7) #0``; unique with the kind."""
        values = ", ".join("*" if value is None else str(value) for value in self.isovalues)
        kind = "" if self.kind is CurveKind.INTERIOR else f" {self.kind}"
        return f"{self.family}{kind} ({values}) #{self.component}"


@dataclass(frozen=True, eq=False)
class Truss:
    """Labelled curves over shared nodes and members.

    Parameters
    ----------
    nodes : (n_n, 3) float, mm.
    node_kinds : (n_n,) int, values of `NodeKind`.
    members : (n_m, 2) int, ascending node numbers, each pair of nodes at most once.
    curves : every member belongs to at least one curve. A boundary and an interior curve that run between the same
        two nodes share one member.
    spacing : edge of a typical truss cell, mm: the median over the part of the cell edges of the parametrization.

    Raises
    ------
    InvalidInputError
        If a member repeats or joins a node with itself, a curve leaves its members, or a member has no curve.
    """

    nodes: Float[np.ndarray, "n_n 3"]
    node_kinds: Int[np.ndarray, " n_n"]
    members: Int[np.ndarray, "n_m 2"]
    curves: tuple[Curve, ...]
    spacing: float

    def __post_init__(self) -> None:
        freeze(self, nodes=np.float64, node_kinds=np.int64, members=np.int64)
        M, n_n = self.members, len(self.nodes)
        require(np.isfinite(self.nodes).all(), "the nodes of a truss must be finite")
        require(len(self.node_kinds) == n_n, f"node_kinds must have {n_n} entries, found {len(self.node_kinds)}")
        require(self.spacing > 0, f"spacing must be positive, found {self.spacing}")
        if not len(M):
            require(not self.curves, "a truss without members has no curves")
            return
        require(M.min() >= 0 and M.max() < n_n, f"members must index the {n_n} nodes")
        require((M[:, 0] < M[:, 1]).all(), "the two nodes of a member must differ and be in ascending order")
        require(len(np.unique(M[:, 0] * n_n + M[:, 1])) == len(M), "two members join the same two nodes")
        covered = np.zeros(len(M), bool)
        nodes, following, members = _steps(self.curves)
        ends = np.sort(np.stack([nodes, following], axis=1), axis=1)
        require((ends == M[members]).all(), "a curve must step from node to node along its members")
        covered[members] = True
        require(covered.all(), f"{(~covered).sum()} members belong to no curve")
        labels = {(curve.kind, curve.isovalues, curve.component) for curve in self.curves}
        require(len(labels) == len(self.curves), "two curves have the same kind, isovalues and component")

    @cached_property
    def degrees(self) -> Int[np.ndarray, " n_n"]:
        """Number of members at each node."""
        return np.bincount(self.members.ravel(), minlength=len(self.nodes))

    @cached_property
    def lengths(self) -> Float[np.ndarray, " n_m"]:
        """Distances between the two nodes of each member, mm."""
        a, b = self.nodes[self.members].transpose(1, 0, 2)
        return np.linalg.norm(b - a, axis=1)

    @cached_property
    def curve_of_member(self) -> Int[np.ndarray, " n_m"]:
        """The curve that shapes each member: its interior curve if it has one, else boundary, else feature."""
        rank = {CurveKind.FEATURE: 0, CurveKind.BOUNDARY: 1, CurveKind.INTERIOR: 2}
        owner = np.full(len(self.members), -1)
        for number in sorted(range(len(self.curves)), key=lambda c: rank[self.curves[c].kind]):
            owner[self.curves[number].members] = number
        return owner


def _steps(curves: Sequence[Curve]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Start node, end node and member of every step along the curves."""
    start, end, members = [], [], []
    for curve in curves:
        start.append(curve.nodes if curve.closed else curve.nodes[:-1])
        end.append(np.roll(curve.nodes, -1) if curve.closed else curve.nodes[1:])
        members.append(curve.members)
    return np.concatenate(start), np.concatenate(end), np.concatenate(members)
