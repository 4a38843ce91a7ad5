"""Selections: which curves, or which members, an edit is about.

A selection is a frozen value that is asked of a truss, so that it means the same after other edits. Two questions can
be asked of each: `curves` for edits of whole curves (removing, thinning, entasis, attachments), `members` for edits of
their pieces (radii, tags).

* What is said about a curve (family, label, length, where it runs) holds for the members that the curve names, see
  `Truss.curve_of_member`: a member on an interior and a boundary curve belongs to the interior one.
* What is said about a place (a box, a ball, a solid) holds for the members whose middle lies there, and for the curves
  with at least one such member.

``a & b``, ``a | b`` and ``~a`` combine them. `sentences` gives the plain form, a table for TOML and JSON.
"""

import difflib
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from michell_cad.arrays import require
from michell_cad.curves import FAMILIES, CurveKind
from michell_cad.errors import InvalidInputError
from michell_cad.knobs import on_stride
from michell_cad.truss import Truss

Number = float | int
Point = tuple[Number, Number, Number]


class Selection(ABC):
    """Some of the curves and members of a truss; see the module."""

    @abstractmethod
    def curves(self, truss: Truss) -> Bool[np.ndarray, " n_c"]:
        """The selected curves of a truss, as a mask."""

    @abstractmethod
    def members(self, truss: Truss) -> Bool[np.ndarray, " n_m"]:
        """The selected members of a truss, as a mask."""

    @abstractmethod
    def plain(self) -> dict[str, Any]:
        """The selection as a table of plain values, see `sentences`."""

    def shifted(self, by: int) -> "Selection":
        """The same of a truss whose parts have numbers higher by `by`, see `Part`."""
        return self

    def __and__(self, other: "Selection") -> "Selection":
        return AllOf((self, other))

    def __or__(self, other: "Selection") -> "Selection":
        return AnyOf((self, other))

    def __invert__(self) -> "Selection":
        return NotOf(self)

    def __str__(self) -> str:
        return " and ".join(f"{key} = {value}" for key, value in self.plain().items()) or "everything"


class _OfCurves(Selection):
    """What is said about curves."""

    def members(self, truss: Truss) -> np.ndarray:
        return self.curves(truss)[truss.curve_of_member]


class _OfPlaces(Selection):
    """What is said about places."""

    @abstractmethod
    def holds(self, points: Float[np.ndarray, "k 3"]) -> Bool[np.ndarray, " k"]:
        """Whether points lie there."""

    def members(self, truss: Truss) -> np.ndarray:
        return self.holds(truss.nodes[truss.members].mean(1))

    def curves(self, truss: Truss) -> np.ndarray:
        here = self.members(truss)
        return np.array([here[curve.members].any() for curve in truss.curves], bool)


@dataclass(frozen=True)
class Everything(_OfCurves):
    """All curves."""

    def curves(self, truss: Truss) -> np.ndarray:
        return np.ones(len(truss.curves), bool)

    def plain(self) -> dict[str, Any]:
        return {}


@dataclass(frozen=True)
class Family(_OfCurves):
    """Curves of families: tension, compression, third, feature (sharp edges), added.

    Parameters
    ----------
    names : families. The sharp edges belong to none of the three traced families, so they stay as they are unless
        they are named.
    surface : whether the boundary curves go with their family.
    """

    names: str | tuple[str, ...]
    surface: bool = True

    def __post_init__(self) -> None:
        names = (self.names,) if isinstance(self.names, str) else self.names
        object.__setattr__(self, "names", names)
        for name in names:
            near = difflib.get_close_matches(str(name), FAMILIES, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"they are {', '.join(FAMILIES)}"
            require(name in FAMILIES, f"family {name!r} does not exist; {hint}")
        require(names, f"name at least one family of {', '.join(FAMILIES)}")

    def curves(self, truss: Truss) -> np.ndarray:
        return np.array(
            [c.family in self.names and (self.surface or c.kind is not CurveKind.BOUNDARY) for c in truss.curves], bool
        )

    def plain(self) -> dict[str, Any]:
        return {"family": self.names[0] if len(self.names) == 1 else list(self.names)} | (
            {} if self.surface else {"surface": False}
        )


@dataclass(frozen=True)
class Label(_OfCurves):
    """Curves by their isovalues: those whose value of one coordinate lies in a range, both ends included.

    Parameters
    ----------
    coordinate : 0, 1 or 2, or the family that runs along it.
    low, high : isovalues. Equal ones select a layer: all curves in one isosurface of the coordinate.
    """

    coordinate: int | str
    low: int
    high: int

    def __post_init__(self) -> None:
        require(
            not isinstance(self.coordinate, bool) and self.coordinate in (0, 1, 2, *FAMILIES[:3]),
            f"coordinate must be 0, 1, 2 or a family that runs along it, found {self.coordinate!r}",
        )
        require(self.low <= self.high, f"label range must ascend, found {self.low} to {self.high}")

    def curves(self, truss: Truss) -> np.ndarray:
        values = [curve.isovalues[axis] for curve, axis in zip(truss.curves, self._axes(truss), strict=True)]
        return np.array([v is not None and self.low <= v <= self.high for v in values], bool)

    def _axes(self, truss: Truss) -> list[int]:
        """The coordinate for each curve: a family may run along another one in each of several joined parts."""
        if isinstance(self.coordinate, int):
            return [self.coordinate] * len(truss.curves)
        axes = {curve.part: curve.axis for curve in truss.curves if curve.family == self.coordinate}
        require(axes, f"coordinate {self.coordinate!r}: the truss has no curve of that family")
        return [axes.get(curve.part, curve.axis) for curve in truss.curves]

    def plain(self) -> dict[str, Any]:
        return {"label": [self.low, self.high], "coordinate": self.coordinate}


@dataclass(frozen=True)
class Every(_OfCurves):
    """Every n-th curve by its label: (v + offset) mod n = 0 for each isovalue v. Sharp edges have none and are not in.

    Parameters
    ----------
    n : stride, at least 1.
    offset : shift of the labels.
    """

    n: int
    offset: int = 0

    def __post_init__(self) -> None:
        require(self.n >= 1, f"every must be at least 1, found {self.n}")

    def curves(self, truss: Truss) -> np.ndarray:
        return np.array(
            [c.isovalues != (None, None, None) and on_stride(c, self.n, self.offset) for c in truss.curves], bool
        )

    def plain(self) -> dict[str, Any]:
        return {"every": self.n} | ({"offset": self.offset} if self.offset else {})


@dataclass(frozen=True)
class Part(_OfCurves):
    """Curves of some of several joined trusses: 0 is the one to which the others were joined, 1 the first of these."""

    numbers: tuple[int, ...]

    def __post_init__(self) -> None:
        require(self.numbers and min(self.numbers) >= 0, f"parts count from 0, found {list(self.numbers)}")

    def curves(self, truss: Truss) -> np.ndarray:
        return np.array([curve.part in self.numbers for curve in truss.curves], bool)

    def plain(self) -> dict[str, Any]:
        return {"part": self.numbers[0] if len(self.numbers) == 1 else list(self.numbers)}

    def shifted(self, by: int) -> Selection:
        return Part(tuple(number + by for number in self.numbers))


@dataclass(frozen=True)
class Length(_OfCurves):
    """Curves whose length lies in a range, mm, both ends included."""

    low: Number = 0.0
    high: Number = np.inf

    def __post_init__(self) -> None:
        require(0 <= self.low <= self.high, f"length range must ascend from 0, found {self.low} to {self.high} mm")

    def curves(self, truss: Truss) -> np.ndarray:
        lengths = np.array([truss.lengths[curve.members].sum() for curve in truss.curves])
        return (lengths >= self.low) & (lengths <= self.high)

    def plain(self) -> dict[str, Any]:
        return {"length": [self.low] if np.isinf(self.high) else [self.low, self.high]}


@dataclass(frozen=True)
class Where(_OfCurves):
    """Curves by where they run: ``boundary`` (on the surface, sharp edges included) or ``inside``."""

    place: str

    def __post_init__(self) -> None:
        require(self.place in PLACES, f"where must be one of {', '.join(PLACES)}, found {self.place!r}")

    def curves(self, truss: Truss) -> np.ndarray:
        inside = np.array([curve.kind is CurveKind.INTERIOR for curve in truss.curves], bool)
        return inside if self.place == "inside" else ~inside

    def plain(self) -> dict[str, Any]:
        return {"where": self.place}


PLACES = ("boundary", "inside")


@dataclass(frozen=True)
class Box(_OfPlaces):
    """A box along the axes between two opposite corners, mm."""

    one: Point
    other: Point

    def __post_init__(self) -> None:
        for name in ("one", "other"):
            object.__setattr__(self, name, as_point(getattr(self, name), "a corner of the box"))

    def holds(self, points: np.ndarray) -> np.ndarray:
        low, high = np.minimum(self.one, self.other), np.maximum(self.one, self.other)
        return np.asarray(((points >= low) & (points <= high)).all(1))

    def plain(self) -> dict[str, Any]:
        return {"box": [list(self.one), list(self.other)]}


@dataclass(frozen=True)
class Near(_OfPlaces):
    """Within a distance of a point, mm."""

    point: Point
    within: Number

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", as_point(self.point, "near"))
        require(self.within > 0, f"within must be a positive distance in mm, found {self.within}")

    def holds(self, points: np.ndarray) -> np.ndarray:
        return np.linalg.norm(points - np.array(self.point), axis=1) <= self.within

    def plain(self) -> dict[str, Any]:
        return {"near": list(self.point), "within": self.within}


@dataclass(frozen=True)
class InSolid(_OfPlaces):
    """Inside a solid: any file that can be a part (.step, .brep, .stl, .obj, .3mf ...)."""

    file: str

    def holds(self, points: np.ndarray) -> np.ndarray:
        import igl

        from michell_cad.domain import read_outline  # CAD loads only where a solid is asked for

        surface = read_outline(self.file).surface
        winding = igl.fast_winding_number(surface.vertices, surface.triangles, points)
        return np.asarray(np.asarray(winding) > 0.5)

    def plain(self) -> dict[str, Any]:
        return {"solid": self.file}


@dataclass(frozen=True)
class AllOf(Selection):
    """What is in all of the selections."""

    parts: tuple[Selection, ...]

    def curves(self, truss: Truss) -> np.ndarray:
        return np.logical_and.reduce([part.curves(truss) for part in self.parts])

    def members(self, truss: Truss) -> np.ndarray:
        return np.logical_and.reduce([part.members(truss) for part in self.parts])

    def plain(self) -> dict[str, Any]:
        return {"all": [part.plain() for part in self.parts]}

    def shifted(self, by: int) -> Selection:
        return AllOf(tuple(part.shifted(by) for part in self.parts))


@dataclass(frozen=True)
class AnyOf(Selection):
    """What is in any of the selections."""

    parts: tuple[Selection, ...]

    def curves(self, truss: Truss) -> np.ndarray:
        return np.logical_or.reduce([part.curves(truss) for part in self.parts])

    def members(self, truss: Truss) -> np.ndarray:
        return np.logical_or.reduce([part.members(truss) for part in self.parts])

    def plain(self) -> dict[str, Any]:
        return {"any": [part.plain() for part in self.parts]}

    def shifted(self, by: int) -> Selection:
        return AnyOf(tuple(part.shifted(by) for part in self.parts))


@dataclass(frozen=True)
class NotOf(Selection):
    """What is not in the selection."""

    part: Selection

    def curves(self, truss: Truss) -> np.ndarray:
        return ~self.part.curves(truss)

    def members(self, truss: Truss) -> np.ndarray:
        return ~self.part.members(truss)

    def plain(self) -> dict[str, Any]:
        return {"not": self.part.plain()}

    def shifted(self, by: int) -> Selection:
        return NotOf(self.part.shifted(by))


def as_point(value: Any, name: str) -> Point:
    """Three finite numbers as a point."""
    try:
        x, y, z = (float(v) for v in value)
    except (TypeError, ValueError):
        raise InvalidInputError(f"{name} must be three numbers in mm, found {value!r}") from None
    require(np.isfinite([x, y, z]).all(), f"{name} must be finite, found {value!r}")
    return x, y, z
