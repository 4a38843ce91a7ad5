"""How a profile is turned about its path: carried without twist, and at first along the frame of the families.

1. Along a path the frame is rotation-minimising (`michell_cad.moving_frames`). Around a closed path an angle is left
   over (the holonomy), which is spread evenly over its length.
2. One angle is free for each path. It turns the profile's x axis as near as it can to the curves of the next family
   (tension, compression, third, tension, ...) that cross the path at its nodes, and its y axis to those of the family
   after that: the mean over all crossings, of directions without sign. So all members of one family look alike, and a
   design that is turned has profiles turned with it. Other curves (sharp edges, added ones) have their x or y axes
   along whatever meets them; one that nothing meets has its x axis in the plane in which it bends, or, if it is
   straight, in that of the coordinate axis farthest from it.
3. Of the two opposite x axes that are left, the one that points outward from the middle of the truss is taken.
"""

import numpy as np
from jaxtyping import Float

from michell_cad.cad.sweep_paths import Paths
from michell_cad.curves import TRACED_FAMILIES
from michell_cad.moving_frames import reflect_twice, transport_normals, turn_minimally
from michell_cad.truss import Truss

ALIKE = 1e-6
"""Mean directions shorter than this say nothing (relative to directions that all agree)."""


def turn_profiles(paths: Paths, truss: Truss) -> Float[np.ndarray, "n 3"]:
    """The profile's x axis at each station, perpendicular to the tangent that leaves there."""
    normals = _carry(paths)
    angle = _mean_angles(paths, normals, truss)
    normals = _turned(normals, paths.leaving, angle[paths.path])
    middle = truss.nodes[np.unique(truss.members)].mean(0)
    outward = np.bincount(paths.path, ((paths.points - middle) * normals).sum(1))
    return np.where((outward < 0)[paths.path, None], -normals, normals)


def _carry(paths: Paths) -> np.ndarray:
    """Normals without twist from an arbitrary first one, but for what closes closed paths."""
    begin = paths.offsets[:-1]
    normals = transport_normals(
        paths.points, paths.arriving, paths.leaving, paths.offsets, _first_normals(paths, paths.leaving[begin])
    )
    closed = np.flatnonzero(paths.closed)
    if not len(closed):
        return normals
    a, z = begin[closed], paths.offsets[1:][closed] - 1
    back = reflect_twice(paths.points[a] - paths.points[z], paths.leaving[z], paths.arriving[a], normals[z])
    back = turn_minimally(paths.arriving[a], paths.leaving[a], back)
    left = _angle(back, normals[a], paths.leaving[a])
    following = np.arange(len(paths.points)) + 1
    following[paths.offsets[1:] - 1] = begin
    step = np.linalg.norm(paths.points[following] - paths.points, axis=1)
    run = np.cumsum(step) - step
    total = np.bincount(paths.path, step)
    share = (run - run[begin][paths.path]) / total[paths.path]
    missing = np.zeros(len(paths.closed))
    missing[closed] = left
    return _turned(normals, paths.leaving, share * missing[paths.path])


def _first_normals(paths: Paths, tangents: np.ndarray) -> np.ndarray:
    """Towards the inside of the path's bend, or, where it is straight, the axis farthest from it."""
    count = np.bincount(paths.path)
    center = np.stack([np.bincount(paths.path, paths.points[:, k]) / count for k in range(3)], axis=1)
    begin = paths.offsets[:-1]
    bend = center - paths.points[begin]
    bend -= (bend * tangents).sum(1, keepdims=True) * tangents
    size = np.linalg.norm(center - paths.points[begin], axis=1)
    straight = np.linalg.norm(bend, axis=1) <= ALIKE * size
    axis = np.eye(3)[np.abs(tangents).argmin(1)]
    bend[straight] = (axis - (axis * tangents).sum(1, keepdims=True) * tangents)[straight]
    return bend / np.linalg.norm(bend, axis=1, keepdims=True)


def _mean_angles(paths: Paths, normals: np.ndarray, truss: Truss) -> np.ndarray:
    """The angle for each path by which its x axis has to turn, see the module; 0 where nothing meets it."""
    station, other, member = _crossings(paths, truss)
    t = paths.leaving[station]
    across = other - (other * t).sum(1, keepdims=True) * t
    size = np.linalg.norm(across, axis=1)
    angle = np.arctan2((across * np.cross(t, normals[station])).sum(1), (across * normals[station]).sum(1))
    family = np.array([_number(curve.family) for curve in truss.curves])
    mine, theirs = family[paths.curves[paths.path[station]]], family[truss.curve_of_member[member]]
    traced = (mine >= 0) & (theirs >= 0)
    next_one, after = traced & ((theirs - mine) % 3 == 1), traced & ((theirs - mine) % 3 == 2)
    # Directions without sign are even at twice their angle; a direction for either axis at four times its angle.
    n_p = len(paths.curves)
    twice = np.exp(2j * (angle - np.where(after, np.pi / 2, 0)))
    of_families = _sum(paths.path[station], np.where(next_one | after, size, 0) * twice, n_p)
    of_all = _sum(paths.path[station], size * np.exp(4j * angle), n_p)
    weight = np.bincount(paths.path[station], size, n_p) + np.finfo(float).tiny
    return np.where(
        np.abs(of_families) > ALIKE * weight,
        np.angle(of_families) / 2,
        np.where(np.abs(of_all) > ALIKE * weight, np.angle(of_all) / 4, 0),
    )


def _crossings(paths: Paths, truss: Truss) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stations at nodes, with the chords' directions of the members of other curves that meet there, and these."""
    at = np.flatnonzero(paths.nodes >= 0)
    ends, member = truss.members.ravel(), np.repeat(np.arange(len(truss.members)), 2)
    order = np.argsort(ends, kind="stable")
    bounds = np.searchsorted(ends[order], np.arange(len(truss.nodes) + 1))
    count = np.diff(bounds)[paths.nodes[at]]
    station = np.repeat(at, count)
    place = np.arange(len(station)) - np.repeat(np.cumsum(count) - count, count)
    member = member[order][bounds[paths.nodes[station]] + place]
    apart = truss.curve_of_member[member] != paths.curves[paths.path[station]]
    station, member = station[apart], member[apart]
    chord = truss.nodes[truss.members[member, 1]] - truss.nodes[truss.members[member, 0]]
    return station, chord / np.linalg.norm(chord, axis=1, keepdims=True), member


def _number(family: str) -> int:
    return TRACED_FAMILIES.index(family) if family in TRACED_FAMILIES else -1


def _sum(group: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    return np.bincount(group, np.real(values), count) + 1j * np.bincount(group, np.imag(values), count)


def _angle(start: np.ndarray, end: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Angles about axes that turn unit vectors into others."""
    return np.arctan2((np.cross(start, end) * axis).sum(1), (start * end).sum(1))


def _turned(normals: np.ndarray, axes: np.ndarray, angle: np.ndarray) -> np.ndarray:
    return np.cos(angle)[:, None] * normals + np.sin(angle)[:, None] * np.cross(axes, normals)
