"""Cut the boundary of mitred tubes into pieces, compiled: see `mitres` for the envelope that is cut.

Tables of numbers come out; `mitres` makes values of them.
"""

from typing import Any

import numpy as np

from michell_cad.cad.vectors import cross, distance, dot
from michell_cad.compiled import compiled

SPHERE = -1
"""Stands for the sphere where a number of a member would name a neighbour."""

SAME_POINT = 1e-6
"""Corners computed from different members agree within this distance (relative to r)."""

TURN = 2 * np.pi

TINY = float(np.finfo(float).tiny)

MOST_CUTS = 3
"""A piece between two corners is cut in at most so many: where its own tube and its neighbour have their angles 0."""


def _bisectors(d: Any, N: Any, B: Any, r: float) -> tuple[Any, Any]:
    """Coefficients (a, b)[e, j] of v = a cos u + b sin u on the plane that bisects ends e and j; 0 for e itself."""
    k = len(d)
    a, b = np.zeros((k, k)), np.zeros((k, k))
    for e in range(k):
        for j in range(k):
            if j != e:
                less, more = 0.0, 0.0
                for i in range(3):
                    less += (d[e, i] - d[j, i]) ** 2
                    more += (d[e, i] + d[j, i]) ** 2
                along, across = dot(N[e], d[j]), dot(B[e], d[j])
                size = r * np.sqrt(more / less) / max(np.hypot(along, across), TINY)
                a[e, j], b[e, j] = size * along, size * across
    return a, b


def _binormals(d: Any, N: Any) -> Any:
    """The vector products d x N."""
    B = np.empty(d.shape)
    for e in range(len(d)):
        cross(d[e], N[e], B[e])
    return B


def _sort_along(values: Any) -> Any:
    """Sort a few values in place; returns where each was."""
    place = np.arange(len(values))
    for i in range(1, len(values)):
        value, j = values[i], i
        while j > 0 and values[j - 1] > value:
            values[j], place[j] = values[j - 1], place[j - 1]
            j -= 1
        values[j], place[j] = value, i
    return place


def _envelope(e: int, a: Any, b: Any, H: float) -> tuple[Any, Any]:
    """Where the envelope around end e passes from one neighbour to another: angles, ascending, and neighbours from
    there on; empty if all is sphere."""
    k = len(a)
    rivals, n = np.empty(k, np.int64), 0
    for j in range(k):
        if j != e and np.hypot(a[e, j], b[e, j]) > H:
            rivals[n] = j
            n += 1
    angles, count = np.empty(n * (n + 1)), 0
    for i in range(n):
        p, q = a[e, rivals[i]], b[e, rivals[i]]
        middle, half = np.arctan2(q, p), np.arccos(H / np.hypot(p, q))
        angles[count], angles[count + 1] = (middle - half) % TURN, (middle + half) % TURN
        count += 2
        for j in rivals[i + 1 : n]:
            zero = np.arctan2(a[e, j] - p, q - b[e, j])
            angles[count], angles[count + 1] = zero % TURN, (zero + np.pi) % TURN
            count += 2
    sort_along(angles)
    m = 0
    for angle in angles:
        if m == 0 or angle != angles[m - 1]:
            angles[m] = angle
            m += 1
    top = np.empty(m, np.int64)
    for i in range(m):
        middle = (angles[i] + (angles[i + 1] if i + 1 < m else angles[0] + TURN)) / 2
        top[i], highest = SPHERE, H
        for j in rivals[:n]:
            height = a[e, j] * np.cos(middle) + b[e, j] * np.sin(middle)
            if height > highest:
                top[i], highest = j, height
    u, neighbour, count = np.empty(m), np.empty(m, np.int64), 0
    for i in range(m):
        if top[i] != top[i - 1]:
            u[count], neighbour[count] = angles[i], top[i]
            count += 1
    return u[:count], neighbour[:count]


def _envelopes(d: Any, N: Any, R: float, r: float) -> tuple[Any, Any, Any, Any, Any]:
    """The envelopes of all ends: offsets (k + 1,), angles and neighbours, and the coefficients of the bisectors."""
    k = len(d)
    a, b = bisectors(d, N, binormals(d, N), r)
    offsets = np.zeros(k + 1, np.int64)
    angles, neighbours = np.empty(4 * k**3), np.empty(4 * k**3, np.int64)
    for e in range(k):
        u, top = envelope(e, a, b, np.sqrt(R**2 - r**2))
        offsets[e + 1] = offsets[e] + len(u)
        for i in range(len(u)):
            angles[offsets[e] + i], neighbours[offsets[e] + i] = u[i], top[i]
    return offsets, angles[: offsets[k]], neighbours[: offsets[k]], a, b


def _cut(d: Any, N: Any, R: float, r: float) -> tuple[bool, Any, Any, Any]:
    """Cut the mitred members of one node.

    d, N (k, 3) unit vectors along the members and to their angles 0; R, r radii of the sphere and of the tubes.
    Returns whether there is a cut at all, corners (c, 3), and for each piece (end, neighbour, first corner, last
    corner) and (start, stop).
    """
    k, H = len(d), np.sqrt(R**2 - r**2)
    B = binormals(d, N)
    offsets, angles, neighbours, a, b = envelopes(d, N, R, r)
    corners, of_break, count = find_corners(d, N, B, H, r, offsets, angles, neighbours, a, b)
    links, spans = np.empty((MOST_CUTS * len(angles) + k, 4), np.int64), np.empty((MOST_CUTS * len(angles) + k, 2))
    if count < 0:
        return False, corners, links[:0], spans[:0]
    for e in range(k):
        last = neighbours[offsets[e + 1] - 1] if offsets[e + 1] > offsets[e] else SPHERE
        for i in range(3):
            corners[count + e, i] = (H if last == SPHERE else a[e, last]) * d[e, i] + r * N[e, i]
    n = 0
    for e in range(k):
        if offsets[e + 1] == offsets[e]:
            links[n, 0], links[n, 1], links[n, 2], links[n, 3] = e, SPHERE, count + e, count + e
            spans[n, 0], spans[n, 1] = 0.0, TURN
            n += 1
        for i in range(offsets[e], offsets[e + 1]):
            n = cut_between(e, i, offsets, angles, neighbours, of_break, count, corners, N, B, links, spans, n)
    return True, corners[: count + k], links[:n], spans[:n]


def _find_corners(
    d: Any, N: Any, B: Any, H: float, r: float, offsets: Any, angles: Any, neighbours: Any, a: Any, b: Any
) -> tuple[Any, Any, int]:
    """Corners, with room for one more for each end; the corner of each break; their number.

    The number is -1 if not all members that meet in a corner find it: they are in special position.
    """
    k = len(d)
    corners, keys = np.empty((len(angles) + k, 3)), np.empty((len(angles) + k, 3), np.int64)
    of_break, seen, count = np.empty(len(angles), np.int64), np.zeros(len(angles) + k, np.int64), 0
    for e in range(k):
        for i in range(offsets[e], offsets[e + 1]):
            u, j = angles[i], neighbours[i]
            before = neighbours[i - 1] if i > offsets[e] else neighbours[offsets[e + 1] - 1]
            height = H if j == SPHERE else a[e, j] * np.cos(u) + b[e, j] * np.sin(u)
            # The three parts that meet here, ascending: the sphere, if it is one of them, comes first.
            low, high = min(j, before), max(j, before)
            keys[count, 0], keys[count, 1], keys[count, 2] = min(e, low), max(min(e, high), low), max(e, high)
            for x in range(3):
                corners[count, x] = height * d[e, x] + r * (np.cos(u) * N[e, x] + np.sin(u) * B[e, x])
            found = 0
            while found < count:
                same = keys[count, 0] == keys[found, 0] and keys[count, 1] == keys[found, 1]
                same &= keys[count, 2] == keys[found, 2]
                if same and distance(corners[count], corners[found]) < SAME_POINT * r:
                    break
                found += 1
            of_break[i] = found
            seen[found] += 1
            count = max(count, found + 1)
    for c in range(count):
        if seen[c] != (2 if keys[c, 0] == SPHERE else 3):
            return corners, of_break, -1
    return corners, of_break, count


def _cut_between(
    e: int,
    i: int,
    offsets: Any,
    angles: Any,
    neighbours: Any,
    of_break: Any,
    zero: int,
    corners: Any,
    N: Any,
    B: Any,
    links: Any,
    spans: Any,
    n: int,
) -> int:
    """Enter the pieces of end e from break i to the next one, cut where the end or its neighbour has its angle 0.

    Corner `zero` + e is at angle 0 of end e. Returns the number of pieces so far.
    """
    j, u = neighbours[i], angles[i]
    following = i + 1 if i + 1 < offsets[e + 1] else offsets[e]
    stop = angles[following] if angles[following] > u else angles[following] + TURN
    at, corner, m = np.empty(4), np.empty(4, np.int64), 2
    at[0], corner[0], at[1], corner[1] = u, of_break[i], stop, of_break[following]
    if stop > TURN:
        at[m], corner[m] = TURN, zero + e
        m += 1
    if j != SPHERE and offsets[j + 1] > offsets[j] and neighbours[offsets[j + 1] - 1] == e:
        where = np.arctan2(dot(corners[zero + j], B[e]), dot(corners[zero + j], N[e])) % TURN
        at[m], corner[m] = where if where > u else where + TURN, zero + j
        m += 1
    order = sort_along(at[:m])
    for x in range(m - 1):
        shift = TURN if at[x] >= TURN else 0.0
        links[n, 0], links[n, 1], links[n, 2], links[n, 3] = e, j, corner[order[x]], corner[order[x + 1]]
        spans[n, 0], spans[n, 1] = at[x] - shift, at[x + 1] - shift
        n += 1
    return n


binormals = compiled(_binormals)
sort_along = compiled(_sort_along)
bisectors = compiled(_bisectors)
envelope = compiled(_envelope)
envelopes = compiled(_envelopes)
find_corners = compiled(_find_corners)
cut_between = compiled(_cut_between)
cut = compiled(_cut)
