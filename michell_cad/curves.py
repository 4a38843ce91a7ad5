"""The labelled curves of networks and trusses: where a curve runs, what it is called, and which members it takes.

Departing from Arora et al. 2019, the label of a curve holds the isovalues *and* a component number, since several
disjoint curves can have the same isovalues; boundary and sharp-feature curves are curves with labels like all others.
"""

from dataclasses import dataclass
from enum import IntEnum, StrEnum

import numpy as np
from jaxtyping import Int

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
        kind = f" {self.kind}" if self.kind is CurveKind.BOUNDARY else ""
        return f"{self.family}{kind} ({values}) #{self.component}"
