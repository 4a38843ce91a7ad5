"""Members on the surface that keep to it: where few nodes are left on a rim, the trace between them gives waypoints.

A spline through the nodes alone cuts the corner of a small hole whose nodes were merged, and would leave the part.
"""

from dataclasses import replace

import numpy as np

from michell_cad.curves import Curve, CurveKind
from michell_cad.isocurves.network import CurveNetwork
from michell_cad.truss.values import Truss

RISE = 0.03
"""A surface member gets a waypoint where the middle of its trace is farther than this from its chord (relative to the
spacing): well below the radius of a member."""

STRONG_RISE = 0.1
"""From here on it gets three: a spline through the middle alone errs by a tenth of the rise."""

STEEPEST = 0.75
"""No waypoint where it is farther than this (relative to the chord; half a circle has 0.5)."""

ON_TRACE = 1e-6
"""Largest distance of a node from the vertices of a trace on which it counts as lying (relative to the spacing)."""


def keep_to_surface(truss: Truss, network: CurveNetwork) -> Truss:
    """Give the members of boundary and feature curves the middle of their trace as a waypoint, where it is off the
    chord.

    Only members that their own surface curve shapes, whose two nodes still lie on its trace, and that have no waypoint
    yet.
    """
    traced = {(c.kind, c.isovalues, c.component): c for c in network.curves if c.kind is not CurveKind.INTERIOR}
    waypoints, offsets = np.asarray(truss.waypoints), np.asarray(truss.waypoint_offsets)
    have = np.diff(offsets) > 0
    shaped_by = truss.shape_of_member
    points = {m: list(waypoints[a:b]) for m, (a, b) in enumerate(_ranges(offsets)) if b > a}
    for number, curve in enumerate(truss.curves):
        original = traced.get((curve.kind, curve.isovalues, curve.component))
        if original is None or original.closed != curve.closed:
            continue
        for member, quarters in _quarters(truss, curve, _trace(network, original)):
            if not have[member] and shaped_by[member] == number:
                rise = np.linalg.norm(quarters[1] - truss.nodes[truss.members[member]].mean(0))
                if RISE * truss.spacing < rise < STEEPEST * truss.lengths[member]:
                    points[member] = list(quarters if rise > STRONG_RISE * truss.spacing else quarters[1:2])
    counts = [len(points.get(m, ())) for m in range(len(truss.members))]
    flat = [point for m in sorted(points) for point in points[m]]
    return replace(
        truss,
        waypoints=np.array(flat).reshape(-1, 3),
        waypoint_offsets=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
    )


def _ranges(offsets: np.ndarray) -> zip:
    return zip(offsets[:-1].tolist(), offsets[1:].tolist(), strict=True)


def _trace(network: CurveNetwork, curve: Curve) -> np.ndarray:
    """All points of a traced curve in order; a closed one ends where it starts."""
    parts = []
    for node, member in zip(curve.nodes, curve.members, strict=False):
        path = network.path_points[network.path_offsets[member] : network.path_offsets[member + 1]]
        parts += [network.nodes[[node]], path if network.members[member, 0] == node else path[::-1]]
    parts.append(network.nodes[[curve.nodes[0] if curve.closed else curve.nodes[-1]]])
    return np.concatenate(parts)


def _quarters(truss: Truss, curve: Curve, trace: np.ndarray) -> list[tuple[int, np.ndarray]]:
    """The members of a curve whose nodes lie on its trace, with the points that quarter the trace between them."""
    away = np.linalg.norm(truss.nodes[curve.nodes][:, None] - trace[None, : -1 if curve.closed else None], axis=2)
    at = away.argmin(1)
    lies = away.min(1) <= ON_TRACE * truss.spacing
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(trace, axis=0), axis=1))])
    found = []
    for i, member in enumerate(curve.members.tolist()):
        j = (i + 1) % len(curve.nodes)
        if not (lies[i] and lies[j]):
            continue
        start, end = arc[at[i]], arc[at[j]]
        if curve.closed and end <= start:
            end += arc[-1]
        s = start + (end - start) * np.array([0.25, 0.5, 0.75])
        if curve.closed:
            s = s % arc[-1]
        points = np.stack([np.interp(s, arc, trace[:, d]) for d in range(3)], axis=1)
        found.append((member, points if truss.members[member, 0] == curve.nodes[i] else points[::-1]))
    return found
