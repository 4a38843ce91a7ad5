"""Members on the surface that keep to it: where few nodes are left on a rim, the trace between them gives waypoints.

A spline through the nodes alone cuts the corner of a small hole whose nodes were merged, and would leave the part.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from michell_cad.arrays import expand
from michell_cad.curves import Curve, CurveKind
from michell_cad.isocurves.network import CurveNetwork
from michell_cad.truss.values import Truss, curve_steps

RISE = 0.03
"""A surface member gets a waypoint where the middle of its trace is farther than this from its chord (relative to the
spacing): well below the radius of a member."""

STRONG_RISE = 0.1
"""From here on it gets three: a spline through the middle alone errs by a tenth of the rise."""

STEEPEST = 0.75
"""No waypoint where it is farther than this (relative to the chord; half a circle has 0.5)."""


def keep_to_surface(truss: Truss, network: CurveNetwork, origin: Int[np.ndarray, " n_n"]) -> Truss:
    """Give the members of boundary and feature curves the middle of their trace as a waypoint, where it is off the
    chord.

    Only members that their own surface curve shapes, whose two nodes still lie on its trace, and that have no waypoint
    yet.

    Parameters
    ----------
    truss, network : the cleaned truss, and what it was made of.
    origin : the node of the network at the place of each node of the truss, or -1.
    """
    member, quarters = _quarters(truss, network, origin)
    free = np.diff(np.asarray(truss.waypoint_offsets))[member] == 0
    rise = np.linalg.norm(quarters[:, 1] - truss.nodes[truss.members[member]].mean(1), axis=1)
    led = free & (rise > RISE * truss.spacing) & (rise < STEEPEST * truss.lengths[member])
    strong = rise > STRONG_RISE * truss.spacing
    return add_waypoints(truss, member[led], quarters[led], np.where(strong[led, None], _ALL, _MIDDLE))


_ALL, _MIDDLE = np.array([True, True, True]), np.array([False, True, False])


def add_waypoints(
    truss: Truss, member: Int[np.ndarray, " k"], points: Float[np.ndarray, "k q 3"], use: Bool[np.ndarray, "k q"]
) -> Truss:
    """The truss with those of the given points that are in use as waypoints of members, which must have none so far."""
    have = np.diff(np.asarray(truss.waypoint_offsets))
    owner = np.concatenate([np.repeat(np.arange(len(have)), have), np.repeat(member, use.sum(1))])
    waypoints = np.concatenate([np.asarray(truss.waypoints), points[use]])
    order = np.argsort(owner, kind="stable")
    offsets = np.concatenate([[0], np.cumsum(np.bincount(owner, minlength=len(have)))])
    return replace(truss, waypoints=waypoints[order], waypoint_offsets=offsets)


def _quarters(truss: Truss, network: CurveNetwork, origin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Members that their own surface curve shapes, whose nodes lie on its trace, and the points (k, 3, 3) that quarter
    the trace between them, in the direction of the member.
    """
    traced = {(c.kind, c.isovalues, c.component): c for c in network.curves if c.kind is not CurveKind.INTERIOR}
    pairs = [(n, c, traced.get((c.kind, c.isovalues, c.component))) for n, c in enumerate(truss.curves)]
    pairs = [(n, c, trace) for n, c, trace in pairs if trace is not None and trace.closed == c.closed]
    if not pairs:
        return np.zeros(0, np.int64), np.zeros((0, 3, 3))
    traces = _Traces.of(network, [trace for _, _, trace in pairs])
    start, end, member = curve_steps([curve for _, curve, _ in pairs])
    number = np.repeat(np.arange(len(pairs)), [len(curve.members) for _, curve, _ in pairs])
    shaped = truss.shape_of_member[member] == np.array([n for n, _, _ in pairs])[number]
    begin, finish = traces.find(number, origin[start]), traces.find(number, origin[end])
    mine = shaped & (begin >= 0) & (finish >= 0)
    start, member, number, begin, finish = (array[mine] for array in (start, member, number, begin, finish))
    quarters = traces.between(number, begin, finish)
    backward = truss.members[member, 0] != start
    quarters[backward] = quarters[backward, ::-1]
    return member, quarters


@dataclass(frozen=True, eq=False)
class _Traces:
    """Traced curves, point by point, one after the other; closed ones end where they begin."""

    points: np.ndarray
    arc: np.ndarray
    """Arc length up to each point, all curves in one, mm."""
    offsets: np.ndarray
    nodes: np.ndarray
    """The node of the network at each point, -1 for points between nodes."""
    closed: np.ndarray

    @staticmethod
    def of(network: CurveNetwork, curves: list[Curve]) -> "_Traces":
        start, _, member = curve_steps(curves)
        sizes = np.array([len(curve.members) for curve in curves])
        closed = np.array([curve.closed for curve in curves])
        tips = np.array([curve.nodes[0 if curve.closed else -1] for curve in curves])
        # A step for each member, from its first node over its path, and at the end of each curve one of a node alone.
        start, member = (np.insert(array, np.cumsum(sizes), tip) for array, tip in ((start, tips), (member, -1)))
        counts = np.where(member >= 0, np.diff(network.path_offsets)[member], 0) + 1
        step, local = expand(counts)
        forward = network.members[member[step], 0] == start[step]
        place = network.path_offsets[member[step]] + np.where(forward, local - 1, counts[step] - 1 - local)
        points = network.nodes[start[step]]
        inner = local > 0
        points[inner] = network.path_points[place[inner]]
        offsets = np.concatenate([[0], np.cumsum(counts)])[np.concatenate([[0], np.cumsum(sizes + 1)])]
        lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
        lengths[offsets[1:-1] - 1] = 0
        return _Traces(
            points, np.concatenate([[0.0], np.cumsum(lengths)]), offsets, np.where(inner, -1, start[step]), closed
        )

    def find(self, curve: np.ndarray, node: np.ndarray) -> np.ndarray:
        """Where on the trace of each curve a node of the network lies first, or -1."""
        owner = np.repeat(np.arange(len(self.closed)), np.diff(self.offsets))
        n = int(max(self.nodes.max(initial=0), node.max(initial=0))) + 1
        at = np.flatnonzero(self.nodes >= 0)
        keys, first = np.unique(owner[at] * n + self.nodes[at], return_index=True)
        wanted = curve * n + node
        place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        return np.where((node >= 0) & (keys[place] == wanted), at[first[place]], -1)

    def between(self, curve: np.ndarray, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
        """The points (k, 3, 3) that quarter the way along a curve from one of its points to another."""
        last = self.arc[self.offsets[1:] - 1]
        length = last - self.arc[self.offsets[:-1]]
        closed = self.closed[curve]
        span = self.arc[end] - self.arc[begin]
        span = np.where(closed & (span <= 0), span + length[curve], span)
        s = self.arc[begin][:, None] + span[:, None] * np.array([0.25, 0.5, 0.75])
        s = np.where(closed[:, None] & (s > last[curve][:, None]), s - length[curve][:, None], s)
        return np.stack([np.interp(s, self.arc, self.points[:, d]) for d in range(3)], axis=2)
