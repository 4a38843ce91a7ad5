"""What the host draws for a layout and knobs: tubes and node spheres per family, in centimetres.

Fusion's internal unit of length is the centimetre, whatever the document shows; here, and nowhere else, millimetres
become centimetres.
"""

import math
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise

from .layout import Layout, LayoutError, Vector
from .selection import SAME_RADIUS, Chosen, chord_fractions, entasis_weight
from .splines import Piece, curve_pieces, is_smooth, joined

CM_PER_MM = 0.1

SECTIONS = 5
"""A tube whose radius varies has at least so many sections: a loft through five follows the entasis within 1 %."""

LARGEST_TIMELINE = 2000
"""Timeline entries beyond which the STEP is offered instead. A judgement: designs of thousands of entries are slow to
edit in Fusion; it was not measured here."""

_PER_SECTION, _PER_TUBE = 2, 2
"""Timeline entries: plane and sketch of each section; sketch of the path and the sweep or loft of each tube."""


class TooLargeError(LayoutError):
    """A plan with more features than the host handles well; the STEP of the whole model is the way out."""


@dataclass(frozen=True)
class Section:
    """A circle across a tube: where on the path (0 to 1, by arc length), centre and radius in cm.

    `weight` is the entasis weight there if the knobs say how thick the tube is; None if its radius is fixed.
    """

    at: float
    centre: Vector
    radius: float
    weight: float | None


@dataclass(frozen=True)
class Tube:
    """A stretch of a curve without corners: a cubic spline in cm, and one section (sweep) or several (loft)."""

    name: str
    curve: int
    family: str
    points: tuple[Vector, ...]
    knots: tuple[float, ...]
    closed: bool
    sections: tuple[Section, ...]

    @property
    def is_sweep(self) -> bool:
        """Whether the radius is the same all along."""
        return len(self.sections) == 1


@dataclass(frozen=True)
class Sphere:
    """A node: its number, centre and radius in cm."""

    node: int
    centre: Vector
    radius: float


@dataclass(frozen=True)
class Plan:
    """All that is drawn; tubes in the order of the curves."""

    tubes: tuple[Tube, ...]
    spheres: tuple[Sphere, ...]

    @property
    def families(self) -> tuple[str, ...]:
        """The families that have tubes, in order of appearance."""
        return tuple(dict.fromkeys(tube.family for tube in self.tubes))

    @property
    def timeline_entries(self) -> int:
        """About how many entries the document's timeline gets."""
        return sum(_PER_TUBE + _PER_SECTION * len(tube.sections) for tube in self.tubes)


def make_plan(layout: Layout, chosen: Chosen) -> Plan:
    """Plan tubes for every member once (a member of several curves goes with the curve that names it) and the nodes."""
    owner = layout.owner(frozenset(chosen.curves))
    tubes = tuple(tube for number in chosen.curves for tube in _curve_tubes(layout, chosen, number, owner))
    return Plan(tubes, node_spheres(layout, chosen))


def node_spheres(layout: Layout, chosen: Chosen) -> tuple[Sphere, ...]:
    """A sphere at every node: node_ratio times the radius of its thickest member."""
    owner = layout.owner(frozenset(chosen.curves))
    largest: dict[int, float] = defaultdict(float)
    for number in chosen.curves:
        curve, weights = layout.curves[number], dict(chosen.stations[number])
        for step, member in enumerate(curve.members):
            if owner[member] != number:
                continue
            ends = (curve.nodes[step], curve.nodes[(step + 1) % len(curve.nodes)])
            radii = layout.radii_from(member, ends[0])
            for node, fixed in zip(ends, (radii[0], radii[2]), strict=True):
                if node in weights:
                    radius = fixed if chosen.radius is None else chosen.radius_at(weights[node])
                    largest[node] = max(largest[node], radius)
    return tuple(
        Sphere(node, in_cm(layout.nodes[node]), chosen.node_ratio * radius * CM_PER_MM)
        for node, radius in sorted(largest.items())
    )


def refuse_too_large(plan: Plan) -> None:
    """Refuse a plan that would choke the timeline.

    Raises
    ------
    TooLargeError
        If the plan has more than `LARGEST_TIMELINE` entries; the text offers the STEP file.
    """
    if plan.timeline_entries > LARGEST_TIMELINE:
        raise TooLargeError(
            f"This truss would become {len(plan.tubes):,} bodies and about {plan.timeline_entries:,} timeline "
            f"entries, more than the {LARGEST_TIMELINE:,} that Fusion handles well. Choose a family or a larger stride,"
            " or import the STEP file that michell-cad wrote beside the layout (Import Truss STEP)."
        )


def in_cm(point: Vector) -> Vector:
    """A point in mm as the host takes it."""
    return point[0] * CM_PER_MM, point[1] * CM_PER_MM, point[2] * CM_PER_MM


def _curve_tubes(layout: Layout, chosen: Chosen, number: int, owner: dict[int, int]) -> list[Tube]:
    curve = layout.curves[number]
    pieces = curve_pieces(layout, curve)
    starts = [0.0]
    for piece in pieces:
        starts.append(starts[-1] + piece.length)
    thickness = _thickness(layout, chosen, number, pieces, starts)
    mine = [owner[curve.members[piece.step]] == number for piece in pieces]
    stations = {node for node, _ in chosen.stations[number]}

    def at_node(i: int) -> bool:
        return pieces[i].step != pieces[i - 1].step and curve.nodes[pieces[i].step] in stations

    def goes_on(i: int) -> bool:
        """Whether piece i continues the one before it, without a corner and without a jump of the radius."""
        if not (mine[i] and mine[i - 1] and is_smooth(pieces[i - 1], pieces[i])):
            return False
        before = thickness(pieces[i - 1].step, starts[i] if i else starts[-1])[0]
        return not at_node(i) or abs(thickness(pieces[i].step, starts[i])[0] - before) <= SAME_RADIUS

    tubes = []
    for run in _runs(mine, goes_on, curve.closed):
        closed = curve.closed and len(run) == len(pieces) and goes_on(run[0])
        marks = [0, *(k for k, i in enumerate(run) if k and at_node(i)), len(run)]
        spline = joined(tuple(pieces[i] for i in run))
        tubes.append(
            Tube(
                name=curve.name,
                curve=number,
                family=curve.family,
                points=tuple(map(in_cm, spline.points)),
                knots=tuple(knot * CM_PER_MM for knot in spline.knots),
                closed=closed,
                sections=_sections([pieces[i] for i in run], [starts[i] for i in run], marks, closed, thickness),
            )
        )
    return _numbered(tubes)


def _runs(mine: list[bool], goes_on: Callable[[int], bool], closed: bool) -> list[list[int]]:
    """Numbers of one's own pieces that go on into each other; those of a closed curve may pass its first node."""
    n = len(mine)
    first = next((i for i in range(n) if not goes_on(i)), 0) if closed else 0
    runs: list[list[int]] = []
    for i in ((first + k) % n for k in range(n)):
        if mine[i]:
            if i == first or not goes_on(i):
                runs.append([])
            runs[-1].append(i)
    return runs


Thickness = Callable[[int, float], tuple[float, float | None]]
"""Radius in mm and entasis weight (None: fixed) at a step of a curve and an arc length on it."""


def _thickness(
    layout: Layout, chosen: Chosen, number: int, pieces: tuple[Piece, ...], starts: list[float]
) -> Thickness:
    """How thick a curve is along its arc length."""
    curve = layout.curves[number]
    ends: dict[int, list[float]] = {}
    for piece, start, end in zip(pieces, starts, starts[1:], strict=False):
        ends[piece.step] = [ends.get(piece.step, [start])[0], end]

    def fixed(step: int, length: float) -> tuple[float, None]:
        r0, r1, r2 = layout.radii_from(curve.members[step], curve.nodes[step])
        s = (length - ends[step][0]) / (ends[step][1] - ends[step][0])
        # michell_cad.truss.member_radius: the quartic through the three radii, level at both ends.
        return r0 + (r2 - r0) * s * s * (3 - 2 * s) + 16 * (s * (1 - s)) ** 2 * (r1 - (r0 + r2) / 2), None

    if chosen.radius is None:
        return fixed
    stations = [node for node, _ in chosen.stations[number]]
    fractions = chord_fractions(layout, tuple(stations), number)
    lengths = [ends[step][0] if step in ends else starts[-1] for step, n in enumerate(curve.nodes) if n in stations]

    def of_knobs(step: int, length: float) -> tuple[float, float]:
        # Without entasis a tube stays a sweep, whatever the parameter becomes later.
        even = curve.closed or chosen.entasis == 0
        weight = 0.0 if even else entasis_weight(_interpolated(length, lengths, fractions))
        return chosen.radius_at(weight), weight

    return of_knobs


def _interpolated(x: float, xs: list[float], ys: tuple[float, ...]) -> float:
    """y at x on the polyline through (xs, ys), ascending xs."""
    i = next((k for k in range(1, len(xs) - 1) if x < xs[k]), len(xs) - 1)
    return ys[i - 1] + (ys[i] - ys[i - 1]) * (x - xs[i - 1]) / (xs[i] - xs[i - 1])


def _sections(
    run: list[Piece], starts: list[float], marks: list[int], closed: bool, thickness: Thickness
) -> tuple[Section, ...]:
    """Sections at the nodes of a run, and between them where there are few; one only if the radius never changes."""
    before = [0.0, *accumulate(piece.length for piece in run)]
    # A radius of the file may swell in the middle of every member; entasis swells once along the whole curve.
    least = 2 if thickness(run[0].step, starts[0])[1] is None else 1
    between = max(least, math.ceil((SECTIONS - 1) / (len(marks) - 1)))
    lengths = [before[marks[0]]]
    for a, b in pairwise(marks):
        lengths += [before[a] + (before[b] - before[a]) * k / between for k in range(1, between + 1)]
    place = [next((k for k in range(len(run)) if length < before[k + 1]), len(run) - 1) for length in lengths]
    thick = [thickness(run[i].step, starts[i] + s - before[i]) for i, s in zip(place, lengths, strict=True)]
    radii = [radius for radius, _ in thick]
    if max(radii) - min(radii) <= SAME_RADIUS:
        # One section makes a sweep. The loft of a closed curve returns to its first section by itself.
        lengths = lengths[:1]
    elif closed:
        lengths.pop()
    sections = []
    for length, i, (radius, weight) in zip(lengths, place, thick, strict=False):
        local = min(1.0, (length - before[i]) / run[i].length)
        centre = in_cm(run[i].point_at_length(local))
        sections.append(Section(length / before[-1], centre, radius * CM_PER_MM, weight))
    return tuple(sections)


def _numbered(tubes: list[Tube]) -> list[Tube]:
    """Tubes of one curve told apart by their names."""
    if len(tubes) == 1:
        return tubes
    return [replace(tube, name=f"{tube.name}, part {k}") for k, tube in enumerate(tubes, start=1)]
