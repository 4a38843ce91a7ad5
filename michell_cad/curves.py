"""The labelled curves of networks and trusses: where a curve runs, what it is called, and which members it takes.

Departing from Arora et al. 2019, the label of a curve holds the isovalues *and* a component number, since several
disjoint curves can have the same isovalues; boundary and sharp-feature curves are curves with labels like all others.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum, StrEnum
from functools import cached_property
from typing import SupportsIndex, overload

import numpy as np
from jaxtyping import Bool, Int

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


TRACED_FAMILIES = ("tension", "compression", "third")
"""Families of the interior and boundary curves, see `metrics.name_families`."""

FAMILIES = (*TRACED_FAMILIES, "feature", "added", "brace")
"""Names of all families: the traced ones, sharp edges, curves that a designer has added, and braces (see
`strength.braces`), which are interior curves of one member without isovalues."""

KINDS = tuple(CurveKind)
"""The kinds in the order in which arrays number them."""

NO_ISOVALUE = np.iinfo(np.int64).max
"""Stands for an isovalue that is None in arrays of isovalues."""

Isovalues = tuple[int | None, int | None, int | None]
"""The integer values of the three coordinates along a curve; None for a coordinate that varies."""


@dataclass(frozen=True, eq=False)
class Curve:
    """One labelled curve of a truss: (kind, isovalues, component) is unique in a truss.

    Parameters
    ----------
    kind : CurveKind
    family : one of `FAMILIES`.
    axis : coordinate (0, 1, 2) along which the curve runs; -1 for features, added curves and braces.
    isovalues : integer coordinates of the curve, None for those that vary.
    component : 0, 1, ... numbers the curves that have the same kind and isovalues.
    nodes : (k,) int, nodes in order along the curve. A closed curve does not repeat its first node.
    members : (k - 1,) int, or (k,) for a closed curve; member i joins nodes i and i + 1 (either direction).
    closed : whether the last member returns to the first node.
    part : which of several joined trusses the curve is of, 0 for the one that the others were joined to.
    """

    kind: CurveKind
    family: str
    axis: int
    isovalues: Isovalues
    component: int
    nodes: Int[np.ndarray, " k"]
    members: Int[np.ndarray, " m"]
    closed: bool
    part: int = 0

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
        kind = f" {self.kind}" if self.kind is CurveKind.BOUNDARY else ""
        return f"{self.family}{kind} ({values}) #{self.component}"


@dataclass(frozen=True, eq=False)
class Curves(Sequence[Curve]):
    """A sequence of curves, stored as arrays: a `Curve` costs more to make than to trace, so it is made when asked for.

    Parameters
    ----------
    kinds : (n,) int, indices into `KINDS`.
    families : (n,) int, indices into `FAMILIES`.
    axes : (n,) int, coordinate along which each curve runs; -1 for a feature curve.
    isovalues : (n, 3) int, `NO_ISOVALUE` for a coordinate that varies.
    components : (n,) int.
    closed : (n,) bool.
    nodes, node_offsets : those of curve c are ``nodes[node_offsets[c] : node_offsets[c + 1]]``.
    members, member_offsets : likewise.

    Raises
    ------
    InvalidInputError
        If the arrays do not fit together, or a curve has not as many members as its nodes ask for.
    """

    kinds: Int[np.ndarray, " n"]
    families: Int[np.ndarray, " n"]
    axes: Int[np.ndarray, " n"]
    isovalues: Int[np.ndarray, "n 3"]
    components: Int[np.ndarray, " n"]
    closed: Bool[np.ndarray, " n"]
    nodes: Int[np.ndarray, " k"]
    node_offsets: Int[np.ndarray, " n1"]
    members: Int[np.ndarray, " m"]
    member_offsets: Int[np.ndarray, " n1"]

    def __post_init__(self) -> None:
        integers = ("kinds", "families", "axes", "isovalues", "components")
        freeze(self, closed=np.bool_, **dict.fromkeys(integers, np.int64))
        freeze(self, nodes=np.int64, node_offsets=np.int64, members=np.int64, member_offsets=np.int64)
        n = len(self.closed)
        lengths = {name: len(getattr(self, name)) for name in integers}
        require(set(lengths.values()) == {n}, f"labels must have {n} entries each, like closed, found {lengths}")
        for codes, names in ((self.kinds, KINDS), (self.families, FAMILIES)):
            require(((codes >= 0) & (codes < len(names))).all(), f"curves must have numbers of {names}")
        for entries, offsets in ((self.nodes, self.node_offsets), (self.members, self.member_offsets)):
            require(
                offsets.shape == (n + 1,) and offsets[0] == 0 and offsets[-1] == len(entries),
                f"offsets must have {n + 1} entries from 0 to {len(entries)}",
            )
        expected = np.diff(self.node_offsets) - ~self.closed
        wrong = (np.diff(self.member_offsets) != expected) | (expected < 1)
        require(
            not wrong.any(),
            f"an open curve must have one member less than nodes, a closed one as many, and each at least one; "
            f"{wrong.sum()} curves do not, first curve {int(wrong.argmax()) if n else -1}",
        )

    @staticmethod
    def of(curves: Iterable[Curve]) -> "Curves":
        """The given curves in their order."""
        curves = tuple(curves)

        def joined(parts: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
            offsets = np.concatenate([[0], np.cumsum([len(part) for part in parts], dtype=np.int64)])
            return np.concatenate([np.zeros(0, np.int64), *parts]), offsets

        values = [[NO_ISOVALUE if value is None else value for value in curve.isovalues] for curve in curves]
        return Curves(
            np.array([KINDS.index(curve.kind) for curve in curves], np.int64),
            np.array([FAMILIES.index(curve.family) for curve in curves], np.int64),
            np.array([curve.axis for curve in curves], np.int64),
            np.array(values, np.int64).reshape(-1, 3),
            np.array([curve.component for curve in curves], np.int64),
            np.array([curve.closed for curve in curves], bool),
            *joined([curve.nodes for curve in curves]),
            *joined([curve.members for curve in curves]),
        )

    def __len__(self) -> int:
        return len(self.closed)

    def __iter__(self) -> Iterator[Curve]:
        return iter(self._made)

    @overload
    def __getitem__(self, index: SupportsIndex) -> Curve: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Curve, ...]: ...
    def __getitem__(self, index: SupportsIndex | slice) -> Curve | tuple[Curve, ...]:
        return self._made[index]

    @cached_property
    def _made(self) -> tuple[Curve, ...]:
        """All curves, made at once and once, so that a curve stays the same object."""
        codes = (self.kinds, self.families, self.axes, self.components, self.closed)
        labels = zip(*(code.tolist() for code in codes), strict=True)
        values = [[None if v == NO_ISOVALUE else v for v in row] for row in self.isovalues.tolist()]
        nodes, members = self.node_offsets.tolist(), self.member_offsets.tolist()
        return tuple(
            Curve(
                KINDS[kind],
                FAMILIES[family],
                axis,
                (a, b, c),
                component,
                self.nodes[nodes[i] : nodes[i + 1]],
                self.members[members[i] : members[i + 1]],
                closed,
            )
            for i, ((kind, family, axis, component, closed), (a, b, c)) in enumerate(zip(labels, values, strict=True))
        )
