"""Where members aim when they leave their nodes, and the room that these then take, compiled; see `layout`, point 1.

How far an end aims depends on where its tube begins, and that on all the directions at its node, but on no other node:
each node is done by itself until all its tubes begin where they aim.
"""

from typing import Any

import numpy as np

from michell_cad.cad.centerlines import point_at
from michell_cad.cad.node_sizing import size_node
from michell_cad.cad.vectors import cross, normalise
from michell_cad.compiled import compiled

AIM_GROWTH, AIM_POWER = 1.4, 0.6
"""A member whose tube begins x times as far as it aims aims x^`AIM_POWER` times as far, but not more than `AIM_GROWTH`
times: its rivals do the same, and both then begin earlier (1 / x for two curves that touch in the node)."""

AIM_ENOUGH = 1.03
"""A tube that begins farther out than it aims by less than this factor is let be (relative)."""

FARTHEST_AIM = 0.6
"""No member aims farther than this along its curve by itself: the rest is its other node's (relative to its length)."""

NUDGE = np.radians(0.7)
"""Directions of creased members in special position are turned by multiples of this angle."""


def _nudge(d: Any, angle: float) -> None:
    """Turn a unit vector by an angle, about an axis that depends on it alone."""
    beside, axis, across = np.empty(3), np.empty(3), np.empty(3)
    beside[0], beside[1], beside[2] = d[2] + 0.3, d[0] - 0.2, d[1] + 0.1
    cross(d, beside, axis)
    normalise(axis)
    cross(axis, d, across)
    for i in range(3):
        d[i] += np.tan(angle) * across[i]
    normalise(d)


def _point_end(points: Any, length: float, end: int, aim: float, nudges: int, d: Any) -> None:
    """Write the direction of an end: from its node to the point of its curve at the distance `aim`."""
    s = min(aim / length, 1.0)
    node = points[0] if end % 2 == 0 else points[-1]
    point_at(points, s if end % 2 == 0 else 1 - s, False, d)
    for i in range(3):
        d[i] -= node[i]
    normalise(d)
    if nudges:
        # Different for every member of the node, the same in every run.
        nudge(d, NUDGE * nudges * (1 + (7 * (end // 2) + end % 2) % 5) / 3)


def _size_nodes(
    nodes: Any,
    order: Any,
    bounds: Any,
    points: Any,
    lengths: Any,
    radii: Any,
    nudges: Any,
    room: Any,
    fillet_ratio: Any,
    aim: Any,
    directions: Any,
    sphere: Any,
    end_radius: Any,
    fillet: Any,
    reach: Any,
    creased: Any,
    rival: Any,
) -> None:
    """Size some nodes; their ends aim farther until their tubes begin where they aim.

    The ends of node i are order[bounds[i] : bounds[i + 1]]. points (n_m, k, 3), lengths (n_m,) of the curves, radii
    (n_e,) wanted, nudges (n_n,), room (n_n, 2) smallest and largest R / r and fillet_ratio (n_n,). `aim` (n_e,) is
    raised; written: directions (n_e, 3), sphere (n_n,), and the rest by end, see `NodeSizes`.
    """
    for i in nodes:
        ends = order[bounds[i] : bounds[i + 1]]
        k = len(ends)
        d, bends, wished = np.empty((k, 3)), np.empty(k, np.bool_), np.empty(k)
        r, f, start = np.empty(k), np.empty(k), np.empty(k)
        again = k > 0
        while again:
            for j, e in enumerate(ends):
                wished[j] = radii[e]
                point_end(points[e // 2], lengths[e // 2], e, aim[e], nudges[i], d[j])
            sphere[i], rivals = size_node(d, wished, room[i, 0], room[i, 1], fillet_ratio[i], r, f, start, bends)
            again = False
            for j, e in enumerate(ends):
                wanted = min(start[j], FARTHEST_AIM * lengths[e // 2])
                for x in range(3):
                    directions[e, x] = d[j, x]
                end_radius[e], fillet[e], reach[e], creased[e] = r[j], f[j], start[j], bends[j]
                rival[e] = ends[rivals[j]] if rivals[j] >= 0 else -1
                if wanted > AIM_ENOUGH * aim[e]:
                    aim[e] *= min((wanted / aim[e]) ** AIM_POWER, AIM_GROWTH)
                    again = True


nudge = compiled(_nudge)
point_end = compiled(_point_end)
size_nodes = compiled(_size_nodes)
