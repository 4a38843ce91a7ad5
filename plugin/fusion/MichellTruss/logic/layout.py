"""Read the layout file `truss.json` of michell_cad: nodes, members with radii, labelled curves with splines; mm."""

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

FORMAT = "michell_cad.truss"
NEWEST_VERSION = 1
FAMILIES = ("tension", "compression", "third")
"""Families that the knobs choose from, in the order of knobs with one value each; other curves always stay."""

Vector = tuple[float, float, float]


class LayoutError(Exception):
    """Something that the designer can put right; the message says what and how."""


@dataclass(frozen=True)
class Member:
    """A strut between two nodes; radii at its first node, in the middle and at its second node, mm."""

    nodes: tuple[int, int]
    radii: Vector


@dataclass(frozen=True)
class Spline:
    """A B-spline: degree, control points in mm, and all knots."""

    degree: int
    knots: tuple[float, ...]
    points: tuple[Vector, ...]


@dataclass(frozen=True)
class Curve:
    """A labelled curve through nodes along members; isovalues are None for a coordinate that varies."""

    name: str
    family: str
    kind: str
    isovalues: tuple[int | None, ...]
    closed: bool
    nodes: tuple[int, ...]
    members: tuple[int, ...]
    spline: Spline


@dataclass(frozen=True)
class Layout:
    """A truss as the file holds it; `text` is the file itself, which the document keeps for later edits."""

    spacing: float
    knobs: dict[str, Any]
    nodes: tuple[Vector, ...]
    corners: frozenset[int]
    members: tuple[Member, ...]
    curves: tuple[Curve, ...]
    text: str = field(repr=False)

    def owner(self, kept: frozenset[int]) -> dict[int, int]:
        """The curve that names each member among the kept curves: interior before boundary before the others."""
        order = {"interior": 0, "boundary": 1}
        owner: dict[int, int] = {}
        for number in sorted(kept, key=lambda c: (order.get(self.curves[c].kind, 2), c)):
            for member in self.curves[number].members:
                owner.setdefault(member, number)
        return owner

    def radii_from(self, member: int, node: int) -> Vector:
        """Radii of a member at the given node, in the middle and at its other node, mm."""
        radii = self.members[member].radii
        return radii if self.members[member].nodes[0] == node else (radii[2], radii[1], radii[0])


def read_layout(path: str | Path) -> Layout:
    """Read a layout file.

    Raises
    ------
    LayoutError
        If the file cannot be read, is no layout, is damaged, or was written by a newer michell_cad.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise LayoutError(
            f"{path.name} cannot be read: {error}. Choose the truss.json that michell-cad wrote."
        ) from error
    return parse_layout(text, path.name)


def parse_layout(text: str, name: str) -> Layout:
    """The layout in a text; `name` stands for it in messages. Raises like `read_layout`."""
    try:
        data = json.loads(text)
    except ValueError as error:
        raise LayoutError(
            f"{name} is damaged or no layout file ({error}). Choose the truss.json that michell-cad wrote, "
            "or write it again."
        ) from error
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise LayoutError(f"{name} is not a truss layout. Choose the truss.json that michell-cad wrote.")
    version = data.get("version")
    if not isinstance(version, int) or version > NEWEST_VERSION:
        raise LayoutError(
            f"{name} was written by a newer michell_cad (layout version {version}; this add-in reads up to version "
            f"{NEWEST_VERSION}). Install the add-in that came with that michell_cad, or write the layout with an older "
            "one."
        )
    if data.get("units") != {"length": "mm"}:
        raise LayoutError(f"{name} gives lengths in {data.get('units')}; this add-in reads millimetres only.")
    try:
        layout = _layout(data, text)
        _check(layout)
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise LayoutError(
            f"{name} is incomplete or damaged ({type(error).__name__}: {error}). Write it again with michell-cad."
        ) from error
    return layout


def _layout(data: dict[str, Any], text: str) -> Layout:
    return Layout(
        spacing=float(data["spacing"]),
        knobs=dict(data["knobs"]),
        nodes=tuple(_vector(node["position"]) for node in data["nodes"]),
        corners=frozenset(number for number, node in enumerate(data["nodes"]) if node["kind"] == "corner"),
        members=tuple(Member(_pair(member["nodes"]), _vector(member["radii"])) for member in data["members"]),
        curves=tuple(_curve(curve) for curve in data["curves"]),
        text=text,
    )


def _curve(data: dict[str, Any]) -> Curve:
    spline = data["spline"]
    return Curve(
        name=str(data["name"]),
        family=str(data["family"]),
        kind=str(data["kind"]),
        isovalues=tuple(None if value is None else int(value) for value in data["isovalues"]),
        closed=bool(data["closed"]),
        nodes=tuple(int(node) for node in data["nodes"]),
        members=tuple(int(member) for member in data["members"]),
        spline=Spline(
            int(spline["degree"]),
            tuple(float(knot) for knot in spline["knots"]),
            tuple(_vector(point) for point in spline["control_points"]),
        ),
    )


def _vector(values: Any) -> Vector:
    x, y, z = (float(value) for value in values)
    if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(z)):
        raise ValueError("a number is not finite")
    return x, y, z


def _pair(values: Any) -> tuple[int, int]:
    a, b = (int(value) for value in values)
    return a, b


def _check(layout: Layout) -> None:
    """Refuse numbers that do not fit together, so that nothing is drawn from a damaged file."""
    n_nodes, n_members = len(layout.nodes), len(layout.members)
    if not layout.spacing > 0:
        raise ValueError(f"spacing must be positive, found {layout.spacing}")
    if not layout.curves:
        raise ValueError("there are no curves")
    if not all(0 <= node < n_nodes for member in layout.members for node in member.nodes):
        raise ValueError("a member ends at a node that is not there")
    if not all(min(member.radii) > 0 for member in layout.members):
        raise ValueError("a radius is not positive")
    for curve in layout.curves:
        spline = curve.spline
        ahead = curve.nodes[1:] + curve.nodes[:1] if curve.closed else curve.nodes[1:]
        steps = list(zip(curve.nodes, ahead, strict=False))
        if len(curve.members) != len(steps) or not all(0 <= member < n_members for member in curve.members):
            raise ValueError(f"the members of {curve.name} do not fit its nodes")
        if any(sorted(step) != sorted(layout.members[m].nodes) for step, m in zip(steps, curve.members, strict=True)):
            raise ValueError(f"the members of {curve.name} do not join its nodes")
        if spline.degree != 3 or len(spline.points) % 3 != 1 or len(spline.knots) != len(spline.points) + 4:
            raise ValueError(f"the spline of {curve.name} is not made of cubic pieces")
