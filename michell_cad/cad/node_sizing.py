"""The size of one node, member by member, compiled: see `nodes` for the rules.

A truss asks for its nodes again and again, a few at a time; NumPy over all pairs of members takes 50 times as long.
"""

from typing import Any

import numpy as np

from michell_cad.cad.nodes import CREASE_CLEARANCE, MARGIN, OVERLAP, SETTLE, SHARPEST_TURN, SMALLEST_RATIO
from michell_cad.compiled import compiled

NEWTON_STEPS = 60
"""More than enough: the first steps double R at least where the angle is very acute, the last ones are quadratic."""
NEWTON_TOLERANCE = 1e-9
"""Relative accuracy of R, on its safe side."""

SETTLE_STEPS = 60
"""Radii that are tried between R and its largest, and then between R and its smallest value."""


def _angle_between(a: Any, b: Any) -> float:
    """Angle between two unit vectors, accurate near 0 and near pi."""
    less = (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2
    more = (a[0] + b[0]) ** 2 + (a[1] + b[1]) ** 2 + (a[2] + b[2]) ** 2
    return 2 * np.arctan2(np.sqrt(less), np.sqrt(more))


def _separating_radius(angle: float, r_1: float, r_2: float, f_1: float, f_2: float) -> float:
    """Smallest R at which two caps at `angle` leave `MARGIN` between them; inf if there is none.

    The sum of the cap angles falls with R and is convex, so Newton's method climbs to the root from below.
    """
    if angle <= 2 * MARGIN:
        return np.inf
    R = max(r_1, r_2) * SMALLEST_RATIO
    for _ in range(NEWTON_STEPS):
        sine_1, sine_2 = (r_1 + f_1) / (R + f_1), (r_2 + f_2) / (R + f_2)
        excess = np.arcsin(sine_1) + np.arcsin(sine_2) - (angle - MARGIN)
        if excess <= 0:
            break
        slope = sine_1 / ((R + f_1) * np.sqrt(1 - sine_1**2)) + sine_2 / ((R + f_2) * np.sqrt(1 - sine_2**2))
        R += excess / slope
        if excess / slope <= NEWTON_TOLERANCE * R:
            break
    return R * (1 + NEWTON_TOLERANCE)


def _size_node(
    d: Any, wanted: Any, smallest: float, largest: float, fillet_ratio: float, r: Any, f: Any, reach: Any, creased: Any
) -> tuple[float, Any]:
    """Sphere, fillets and creases of a node with k members; returns R and the rivals, see `NodeSizes`.

    d (k, 3) unit vectors into the members and wanted (k,) their radii; smallest and largest R / r, fillet_ratio f / r.
    Written: r, f, reach (k,) float and creased (k,) bool; a rival is a number below k.
    """
    k = len(d)
    angle, crease = np.empty((k, k)), np.zeros((k, k), np.bool_)
    for i in range(k):
        r[i], creased[i] = wanted[i], False
        for j in range(i + 1, k):
            angle[i, j] = angle[j, i] = angle_between(d[i], d[j])
    while True:
        widest, needed = 0.0, 0.0
        for i in range(k):
            widest = max(widest, r[i])
            f[i] = fillet_ratio * r[i]
        for i in range(k):
            for j in range(i + 1, k):
                R = separating_radius(angle[i, j], r[i], r[j], f[i], f[j])
                if crease[i, j] or R > largest * widest:
                    crease[i, j] = crease[j, i] = creased[i] = creased[j] = True
                else:
                    needed = max(needed, R)
        if not equalise(creased, r):
            break
    fit_crease_fillets(angle, crease, creased, r, f)
    R = settle_radius(max(smallest * widest, needed), angle, creased, r, f)
    for i in range(k):
        reach[i] = np.sqrt((R + f[i]) ** 2 - (r[i] + f[i]) ** 2)
        if creased[i]:
            reach[i] += CREASE_CLEARANCE * r[i]
    return R, reach_beyond_tips(angle, creased, r, f, reach)


def _equalise(creased: Any, r: Any) -> bool:
    """Give the creased ends the largest of their radii; returns whether that changes one."""
    largest, changes = 0.0, False
    for i in range(len(r)):
        if creased[i]:
            largest = max(largest, r[i])
    for i in range(len(r)):
        if creased[i] and r[i] != largest:
            r[i], changes = largest, True
    return changes


def _fit_crease_fillets(angle: Any, crease: Any, creased: Any, r: Any, f: Any) -> None:
    """Give the creased ends one fillet: what is wanted, or what the sharpest crease allows.

    f <= q (r + f) sin(alpha / 2) with q = `SHARPEST_TURN` gives f <= r x / (1 - x) with x = q sin(alpha / 2).
    """
    smallest, share = np.inf, np.inf
    for i in range(len(r)):
        if creased[i]:
            smallest = min(smallest, f[i])
        for j in range(i + 1, len(r)):
            if crease[i, j]:
                x = SHARPEST_TURN * np.sin(angle[i, j] / 2)
                share = min(share, x / (1 - x))
    for i in range(len(r)):
        if creased[i]:
            f[i] = min(smallest, share * r[i])


def _settle_radius(start: float, angle: Any, creased: Any, r: Any, f: Any) -> float:
    """Raise the R of a node with creases until every pair of ends is clear, or creased and overlaps clearly.

    If no larger R does, smaller ones are tried; inf if none is found.
    """
    widest, has_crease = 0.0, False
    for i in range(len(r)):
        widest, has_crease = max(widest, r[i]), has_crease or creased[i]
    if not has_crease:
        return start
    lowest = SMALLEST_RATIO * widest
    for step in range(SETTLE_STEPS):
        R = start + step / (SETTLE_STEPS - 1) * (SETTLE - 1) * start
        if is_settled(R, angle, creased, r, f):
            return R
    for step in range(1, SETTLE_STEPS):
        R = start - step / (SETTLE_STEPS - 1) * (start - lowest)
        if is_settled(R, angle, creased, r, f):
            return R
    return np.inf


def _is_settled(R: float, angle: Any, creased: Any, r: Any, f: Any) -> bool:
    """Whether every pair of caps is clear of each other, or creased and overlaps clearly."""
    k = len(r)
    cap = np.empty(k)
    for i in range(k):
        cap[i] = np.arcsin(min((r[i] + f[i]) / (R + f[i]), 1.0))
    for i in range(k):
        for j in range(i + 1, k):
            total = cap[i] + cap[j]
            clear = total + MARGIN <= angle[i, j]
            if not (clear or (creased[i] and creased[j] and total - OVERLAP >= angle[i, j])):
                return False
    return True


def _reach_beyond_tips(angle: Any, creased: Any, r: Any, f: Any, reach: Any) -> Any:
    """Let creased tubes begin beyond the tips of their creases; returns the ends with the farthest tips, or -1."""
    k = len(r)
    rival = np.full(k, -1)
    for i in range(k):
        for step in range(1, k):
            j = (i + step) % k
            if creased[i] and creased[j]:
                tip = (r[i] + f[i]) / np.tan(angle[i, j] / 2) + CREASE_CLEARANCE * r[i]
                # Of equal tips the last counts, as long as one lies beyond the sphere.
                if tip > reach[i] or (rival[i] >= 0 and tip == reach[i]):
                    reach[i], rival[i] = tip, j
    return rival


angle_between = compiled(_angle_between, inline=True)
separating_radius = compiled(_separating_radius)
equalise = compiled(_equalise)
fit_crease_fillets = compiled(_fit_crease_fillets)
is_settled = compiled(_is_settled)
settle_radius = compiled(_settle_radius)
reach_beyond_tips = compiled(_reach_beyond_tips)
size_node = compiled(_size_node)
