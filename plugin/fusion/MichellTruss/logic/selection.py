"""Apply knobs to a layout as `michell_cad.knobs.apply_knobs` does: which curves stay, and how thick they are.

The rules are michell_cad's own; the tests compare the two on a real truss.
"""

import math
from collections import Counter, defaultdict
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from .layout import FAMILIES, Curve, Layout, LayoutError

DEFAULT_RADIUS_RATIO = 0.08
"""Default radius over cell edge, as in michell_cad."""

LARGEST_RADIUS_RATIO = 0.25
"""Largest radius (entasis included) over cell edge, as in michell_cad: beyond it no tube is left between two nodes."""

NEED_THE_SOLID = ("volume_fraction", "mass")
"""Knobs whose radius follows from the united solid, which only michell_cad can build."""

SIZING = ("radius", "entasis", "smallest_radius", *NEED_THE_SOLID)
"""Knobs that say how thick the members are."""

SAME_RADIUS = 2e-6
"""Radii in the file are rounded to 1e-6 mm; two that differ by less than this are the same, mm."""


@dataclass(frozen=True)
class Chosen:
    """What the knobs leave of a layout.

    `stations` holds for each kept curve the nodes that stay nodes, each with the entasis weight there: 0 at the ends of
    the curve, 1 in its middle. `radius` is the radius without entasis, mm; it is None where the file's own radii stand
    (sized by strength, by an edit, or for a volume), which no knob gives.
    """

    curves: tuple[int, ...]
    stations: dict[int, tuple[tuple[int, float], ...]]
    radius: float | None
    entasis: float
    smallest_radius: float
    node_ratio: float

    def radius_at(self, weight: float) -> float:
        """Radius where the entasis weight is `weight`, mm; only where a knob gives it."""
        assert self.radius is not None
        return max(self.radius * (1 + self.entasis * weight), self.smallest_radius)


def apply_knobs(layout: Layout, values: dict[str, Any]) -> Chosen:
    """Choose curves by family and density, and say how thick they are.

    A curve of a family with stride n and offset o stays if (v + o) mod n = 0 for each of its isovalues v. Curves of no
    family (sharp edges) stay. Knobs that the file does not name have michell_cad's value for a plain truss.

    Raises
    ------
    LayoutError
        If nothing is left, the radius is too large for the cells, or a knob needs the united solid.
    """
    kept = tuple(number for number, curve in enumerate(layout.curves) if _stays(curve, values))
    if not any(layout.curves[number].family in FAMILIES for number in kept):
        counts = Counter(curve.family for curve in layout.curves)
        raise LayoutError(
            "No curve is left with these settings. The layout has "
            + ", ".join(f"{counts[family]} {family}" for family in FAMILIES)
            + " curves: choose another family or a smaller 'every'."
        )
    radius = _radius(layout, values)
    entasis, smallest = float(values.get("entasis") or 0.0), float(values.get("smallest_radius") or 0.0)
    largest = LARGEST_RADIUS_RATIO * layout.spacing / (1 + max(entasis, 0.0))
    if radius is not None and max(radius, smallest) > largest:
        raise LayoutError(
            f"A radius of {max(radius, smallest):.4g} mm with entasis {entasis:g} is too large for cells of "
            f"{layout.spacing:.4g} mm: use at most {largest:.4g} mm."
        )
    stations = curve_stations(layout, kept)
    return Chosen(kept, stations, radius, entasis, smallest, float(values.get("node_ratio") or 1.0))


def _stays(curve: Curve, values: dict[str, Any]) -> bool:
    if curve.family not in FAMILIES:
        return True
    family = values.get("family", "all")
    if family != "all" and curve.family not in ((family,) if isinstance(family, str) else family):
        return False
    every, offset = (_of_family(values.get(name, plain), curve.family) for name, plain in (("every", 1), ("offset", 0)))
    return all(value is None or (value + offset) % every == 0 for value in curve.isovalues)


def _of_family(value: Any, family: str) -> int:
    return int(value[FAMILIES.index(family)] if isinstance(value, (tuple, list)) else value)


def _radius(layout: Layout, values: dict[str, Any]) -> float | None:
    """The radius that the knobs give, or None where the radii of the file stand."""
    before = {name: layout.knobs.get(name) for name in SIZING}
    unchanged = all((values.get(name) or None) == (before[name] or None) for name in SIZING)
    if unchanged and _sized_otherwise(layout):
        return None
    asked = [name for name in NEED_THE_SOLID if values.get(name)]
    if asked:
        raise LayoutError(
            f"'{asked[0].replace('_', ' ').capitalize()}' needs the united solid, which Fusion does not build here. "
            "Set it in michell-cad and draw the new truss.json, or set it to 0 and give a radius."
        )
    return float(values.get("radius") or DEFAULT_RADIUS_RATIO * layout.spacing)


def _sized_otherwise(layout: Layout) -> bool:
    """Whether the radii of the file are others than its knobs give."""
    if any(layout.knobs.get(name) for name in NEED_THE_SOLID):
        return True
    everything = tuple(range(len(layout.curves)))
    radius = float(layout.knobs.get("radius") or DEFAULT_RADIUS_RATIO * layout.spacing)
    smallest = float(layout.knobs.get("smallest_radius") or 0.0)
    plain = Chosen(everything, {}, radius, float(layout.knobs.get("entasis") or 0.0), smallest, 1.0)
    owner = layout.owner(frozenset(everything))
    for number, curve in enumerate(layout.curves):
        fractions = chord_fractions(layout, curve.nodes, number)
        expected = [plain.radius_at(entasis_weight(x)) for x in fractions]
        expected.append(expected[0])
        for step, member in enumerate(curve.members):
            found = layout.radii_from(member, curve.nodes[step])
            ends = zip(expected[step : step + 2], (found[0], found[2]), strict=True)
            if owner[member] == number and any(abs(a - b) > SAME_RADIUS for a, b in ends):
                return True
    return False


def entasis_weight(x: float) -> float:
    """w(x) = 16 x^2 (1 - x)^2 at the fraction x of a curve: 0 at its ends, 1 in its middle."""
    return 16 * (x * (1 - x)) ** 2


def chord_fractions(layout: Layout, nodes: tuple[int, ...], curve: int) -> tuple[float, ...]:
    """Where each node lies on its curve, by chord length: 0 at the start, 1 at the end; 0 all along a closed curve."""
    if layout.curves[curve].closed:
        return (0.0,) * len(nodes)
    run = [0.0]
    for a, b in pairwise(nodes):
        run.append(run[-1] + math.dist(layout.nodes[a], layout.nodes[b]))
    return tuple(length / run[-1] for length in run)


def curve_stations(layout: Layout, kept: tuple[int, ...]) -> dict[int, tuple[tuple[int, float], ...]]:
    """For each kept curve its nodes that stay nodes, with their entasis weights; see `dissolved_nodes`."""
    gone = dissolved_nodes(layout, kept)
    stations = {}
    for number in kept:
        nodes = tuple(node for node in layout.curves[number].nodes if node not in gone)
        fractions = chord_fractions(layout, nodes, number)
        stations[number] = tuple(zip(nodes, map(entasis_weight, fractions), strict=True))
    return stations


def dissolved_nodes(layout: Layout, kept: tuple[int, ...]) -> frozenset[int]:
    """Nodes that a thinner truss no longer needs, as `michell_cad.truss.keep_curves` finds them.

    They have two members left, both on the same curves, are no corner and no end of a kept curve; and without them no
    member joins a node with itself, or the same two nodes as another one. A whole truss keeps all its nodes.
    """
    if len(kept) == len(layout.curves):
        return frozenset()
    curves_of: dict[int, set[int]] = defaultdict(set)
    for number in kept:
        for member in layout.curves[number].members:
            curves_of[member].add(number)
    members_at: dict[int, list[int]] = defaultdict(list)
    for member in sorted(curves_of):
        for node in layout.members[member].nodes:
            members_at[node].append(member)
    tips = {layout.curves[n].nodes[end] for n in kept if not layout.curves[n].closed for end in (0, -1)}
    passing = {
        node
        for node, around in members_at.items()
        if len(around) == 2
        and node not in tips
        and node not in layout.corners
        and curves_of[around[0]] == curves_of[around[1]]
    }
    while needed := passing & _nodes_for_simple_members(_chains(layout, members_at, passing)):
        passing -= needed
    return frozenset(passing)


def _chains(layout: Layout, members_at: dict[int, list[int]], passing: set[int]) -> list[list[int]]:
    """Nodes along every chain of members through passing nodes; a chain of passing nodes only ends where it began."""
    chains, walked = [], set()

    def walk(node: int, member: int) -> list[int]:
        chain = [node]
        while member not in walked:
            walked.add(member)
            a, b = layout.members[member].nodes
            node = a + b - node
            chain.append(node)
            if node in passing:
                first, second = members_at[node]
                member = second if first == member else first
        return chain

    for start_anywhere in (False, True):
        for node in sorted(members_at):
            for member in members_at[node]:
                if member not in walked and (start_anywhere or node not in passing):
                    chains.append(walk(node, member))
    return chains


def _nodes_for_simple_members(chains: list[list[int]]) -> set[int]:
    """Nodes to keep so that merged members join different nodes, and no two the same; of several the shortest stays."""
    needed: set[int] = set()
    between: dict[tuple[int, int], list[list[int]]] = defaultdict(list)
    for chain in chains:
        last = len(chain) - 1
        if chain[0] == chain[-1]:
            needed |= {chain[0], chain[last // 3], chain[(2 * last) // 3]}
        else:
            between[min(chain[0], chain[-1]), max(chain[0], chain[-1])].append(chain)
    for same_ends in between.values():
        for chain in sorted(same_ends, key=len)[1:]:
            inner = chain[1:-1]
            needed.add(inner[len(inner) // 2])
    return needed


DRAWN = (*SIZING, "family", "every", "offset", "node_ratio")
"""Knobs that shape the native bodies; any other knob of the schema shapes only what michell_cad exports."""
