"""The paths along which profiles are swept: the curves of a truss as stations, cut where no sweep can follow.

A path runs along its curve over the members that this curve names (`Truss.curve_of_member`), as the bars of round
trusses do, so a curve has more than one path where another curve names one of its members. Between members that are
shaped by different curves, and at sharp bends, a path has a kink. A small kink is a mitre joint: both sides end in the
plane between them. Where a kink is too sharp for that, or has no room, the path ends, and another one begins.

A member whose profile would fold over itself on the inside of its bend is made straight.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from michell_cad.arrays import expand, freeze
from michell_cad.splines import MemberSplines, bezier, bezier_slopes, fit_splines
from michell_cad.truss import SizedTruss, Truss, member_radius

STATIONS = 4
"""Stations on each piece of a curve: a cubic through stations then errs by less than 1e-4 of the length of a piece that
turns by 30 degrees."""

SMOOTH = 1e-6
"""Tangents that differ by less are one, radians."""

LARGEST_MITRE = np.deg2rad(100.0)
"""A profile is 1.6 times as long in the mitre of such a kink."""

ROOM = 0.9
"""How far a mitre may reach along its path, relative to the next station."""

PINCHED = 0.95
"""A profile may reach so far from its path, relative to the radius of its bend."""


@dataclass(frozen=True, eq=False)
class Paths:
    """Stations along paths; path p has ``offsets[p] : offsets[p + 1]``. A closed path does not repeat its first one.

    Parameters
    ----------
    points : (n, 3) float, mm.
    arriving, leaving : (n, 3) float, unit tangents before and behind; they differ at kinks.
    radii : (n,) float, mm.
    members : (n,) int, the member that goes on from the station, or the last one of an open path.
    nodes : (n,) int, the node of the truss at the station, or -1.
    offsets, curves, closed : of the paths; `curves` are those that they belong to.
    straightened : (k,) int, members that do not follow their curve.
    """

    points: Float[np.ndarray, "n 3"]
    arriving: Float[np.ndarray, "n 3"]
    leaving: Float[np.ndarray, "n 3"]
    radii: Float[np.ndarray, " n"]
    members: Int[np.ndarray, " n"]
    nodes: Int[np.ndarray, " n"]
    offsets: Int[np.ndarray, " p1"]
    curves: Int[np.ndarray, " p"]
    closed: Bool[np.ndarray, " p"]
    straightened: Int[np.ndarray, " k"]

    def __post_init__(self) -> None:
        freeze(self, points=np.float64, arriving=np.float64, leaving=np.float64, radii=np.float64)
        freeze(self, members=np.int64, nodes=np.int64, offsets=np.int64, curves=np.int64, closed=bool)
        freeze(self, straightened=np.int64)

    @cached_property
    def path(self) -> Int[np.ndarray, " n"]:
        """The path of each station."""
        return expand(np.diff(self.offsets))[0]

    @cached_property
    def kinked(self) -> Bool[np.ndarray, " n"]:
        """Stations at which the two tangents differ."""
        return np.linalg.norm(self.leaving - self.arriving, axis=1) > SMOOTH


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Bézier pieces in the order of their chains; a chain becomes one path or several."""

    points: np.ndarray
    member: np.ndarray
    radii: np.ndarray
    start: np.ndarray
    end: np.ndarray
    first: np.ndarray
    curve: np.ndarray
    closed: np.ndarray


def lay_paths(sized: SizedTruss, reach: float) -> Paths:
    """The paths of a truss for a profile that reaches `reach` radii from its centre."""
    straightened = np.zeros(0, np.int64)
    splines = fit_splines(sized.truss)
    while True:
        pieces = _cut_chains(_chain_pieces(sized, _straight(splines, sized.truss, straightened)), reach)
        paths = _place_stations(pieces, straightened)
        pinched = np.setdiff1d(_pinched_members(paths, reach), straightened)
        if not len(pinched):
            return paths
        straightened = np.union1d(straightened, pinched)


def _straight(splines: MemberSplines, truss: Truss, members: np.ndarray) -> MemberSplines:
    """The splines with some members along their chords."""
    if not len(members):
        return splines
    counts = np.diff(splines.offsets)
    chord = np.zeros(len(counts), bool)
    chord[members] = True
    new_counts = np.where(chord, 1, counts)
    offsets = np.concatenate([[0], np.cumsum(new_counts)])
    points = np.empty((offsets[-1], 4, 3))
    owner, local = expand(new_counts)
    points[~chord[owner]] = splines.control_points[(splines.offsets[:-1][owner] + local)[~chord[owner]]]
    a, b = truss.nodes[truss.members[members]].transpose(1, 0, 2)
    points[offsets[members]] = a[:, None] + np.array([0, 1, 2, 3])[:, None] / 3 * (b - a)[:, None]
    return MemberSplines(points, offsets)


def _chain_pieces(sized: SizedTruss, splines: MemberSplines) -> _Pieces:
    """The pieces of all members, each once, along the curves that name them."""
    truss = sized.truss
    owner = truss.curve_of_member
    member, forward, first, curve_of, closed = [], [], [], [], []
    for number, curve in enumerate(truss.curves):
        mine = np.flatnonzero(owner[curve.members] == number)
        if not len(mine):
            continue
        whole = curve.closed and len(mine) == len(curve.members)
        if curve.closed and not whole:
            # Start behind a member of another curve.
            gap = int(np.flatnonzero(owner[curve.members] != number)[0])
            mine = mine[np.argsort((mine - gap) % len(curve.members))]
        member.append(curve.members[mine])
        forward.append(truss.members[curve.members[mine], 0] == curve.nodes[mine])
        breaks = np.ones(len(mine), bool)
        breaks[1:] = np.diff(mine) % len(curve.members) != 1
        first.append(breaks)
        curve_of.append(np.full(len(mine), number))
        closed.append(np.full(len(mine), whole))
    member, forward, first, curve_of, closed = map(np.concatenate, (member, forward, first, curve_of, closed))
    counts = np.diff(splines.offsets)[member]
    step, local = expand(counts)
    ahead = forward[step]
    place = splines.offsets[:-1][member[step]] + np.where(ahead, local, counts[step] - 1 - local)
    P = splines.control_points[place]
    P = np.where(ahead[:, None, None], P, P[:, ::-1])
    # Fractions of a member at the ends of its pieces, in its own direction.
    length = np.linalg.norm(np.diff(bezier(P[:, None], np.linspace(0, 1, 9)), axis=1), axis=2).sum(1)
    run = np.cumsum(length)
    total = np.bincount(step, length, len(member))
    begin = run - length - (np.cumsum(total) - total)[step]
    radii = np.where(forward[:, None], sized.radii[member], sized.radii[member, ::-1])
    ends = np.where(forward[:, None], truss.members[member], truss.members[member, ::-1])
    is_first, is_last = local == 0, local == counts[step] - 1
    fractions = np.stack([begin, begin + length], axis=1) / total[step][:, None]
    t = np.arange(STATIONS + 1) / STATIONS
    s = fractions[:, :1] + t * (fractions[:, 1:] - fractions[:, :1])
    return _Pieces(
        P,
        member[step],
        member_radius(radii[step][:, None], s),
        np.where(is_first, ends[step, 0], -1),
        np.where(is_last, ends[step, 1], -1),
        first[step] & is_first,
        curve_of[step],
        closed[step],
    )


def _cut_chains(pieces: _Pieces, reach: float) -> _Pieces:
    """The chains cut at kinks that are too sharp, or have no room, for a mitre."""
    P, n = pieces.points, len(pieces.points)
    chain = np.cumsum(pieces.first) - 1
    begins = np.flatnonzero(pieces.first)
    before = np.arange(n) - 1
    last = np.append(begins[1:], n) - 1
    before[begins] = last
    leave, arrive = bezier_slopes(P, np.zeros(n)), bezier_slopes(P, np.ones(n))[before]
    angle = np.arctan2(np.linalg.norm(np.cross(arrive, leave), axis=1), (arrive * leave).sum(1))
    span = np.linalg.norm(np.diff(bezier(P[:, None], np.arange(STATIONS + 1) / STATIONS), axis=1), axis=2)
    room = ROOM * np.minimum(span[:, 0], span[before, -1])
    mitre = reach * pieces.radii[:, 0] * np.tan(np.minimum(angle, LARGEST_MITRE) / 2)
    cut = (angle > SMOOTH) & ((angle > LARGEST_MITRE) | (mitre > room))
    order, first = np.arange(n), cut.copy()
    for a, b in zip(begins.tolist(), (last + 1).tolist(), strict=True):
        if pieces.closed[a] and cut[a:b].any():
            # A closed chain that is cut begins at the cut.
            order[a:b] = np.roll(order[a:b], -int(np.argmax(cut[a:b])))
            first[a:b] = cut[order[a:b]]
    first[begins] = True
    closed = pieces.closed & ~np.isin(chain, chain[cut])
    return _Pieces(
        P[order],
        pieces.member[order],
        pieces.radii[order],
        pieces.start[order],
        pieces.end[order],
        first,
        pieces.curve[order],
        closed[order],
    )


def _place_stations(pieces: _Pieces, straightened: np.ndarray) -> Paths:
    """Stations of the pieces, the last one of a path taken from the end of its last piece."""
    n = len(pieces.points)
    begins = np.flatnonzero(pieces.first)
    ends = np.append(begins[1:], n)
    closed = pieces.closed[begins]
    t = np.arange(STATIONS + 1) / STATIONS
    points = bezier(pieces.points[:, None], t)
    tangents = bezier_slopes(pieces.points[:, None], t)
    before = np.arange(n) - 1
    before[begins] = np.where(closed, ends - 1, begins)
    arriving = tangents.copy()
    arriving[:, 0] = tangents[before, -1]
    arriving[begins[~closed], 0] = tangents[begins[~closed], 0]
    nodes = np.full((n, STATIONS + 1), -1)
    nodes[:, 0], nodes[:, -1] = pieces.start, pieces.end
    kept = np.ones((n, STATIONS + 1), bool)
    kept[:, -1] = False
    kept[ends[~closed] - 1, -1] = True
    path = np.cumsum(pieces.first) - 1
    counts = np.bincount(np.broadcast_to(path[:, None], kept.shape)[kept], minlength=len(begins))
    return Paths(
        points[kept],
        arriving[kept],
        tangents[kept],
        pieces.radii[kept],
        np.broadcast_to(pieces.member[:, None], kept.shape)[kept],
        nodes[kept],
        np.concatenate([[0], np.cumsum(counts)]),
        pieces.curve[begins],
        closed,
        straightened,
    )


def _pinched_members(paths: Paths, reach: float) -> np.ndarray:
    """Members along which the bend is too narrow for the profile: curvature times reach, from station to station."""
    following = np.arange(len(paths.points)) + 1
    last = paths.offsets[1:] - 1
    following[last] = np.where(paths.closed, paths.offsets[:-1], last)
    chord = np.linalg.norm(paths.points[following] - paths.points, axis=1)
    t, u = paths.leaving, paths.arriving[following]
    angle = np.arctan2(np.linalg.norm(np.cross(t, u), axis=1), (t * u).sum(1))
    angle[last[~paths.closed]] = 0.0
    wide = reach * np.maximum(paths.radii, paths.radii[following])
    return np.unique(paths.members[angle * wide > PINCHED * chord])
