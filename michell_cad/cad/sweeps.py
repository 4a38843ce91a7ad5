"""Swept profiles as splines: where a point of the profile runs along a path.

At parameter v of a path the point (x, y) of the profile is at ``X(v) + x A(v) + y B(v)``, with the centre X and two
vectors A and B, whose length is the radius. X, A and B are cubic splines through the stations of the path, on the same
knots. So for a spline outline with control points c_j the surface is the tensor product spline with the poles
``X_i + c_jx A_i + c_jy B_i`` (Piegl and Tiller, The NURBS Book, Section 10.3), and mesh and CAD have one geometry.

A path is cut into stretches at its kinks, where A and B lie in the mitre plane. Closed paths have two stretches at
least, so that no face has to be its own neighbour along the path.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int
from scipy.interpolate import BSpline, make_interp_spline

from michell_cad.arrays import freeze
from michell_cad.cad.sweep_frames import turn_profiles
from michell_cad.cad.sweep_paths import Paths
from michell_cad.truss import Truss

STRAIGHT = 1e-9
"""A stretch is a prism if nothing leaves its place by more (relative to its length)."""


@dataclass(frozen=True, eq=False)
class Stretch:
    """A smooth part of a sweep.

    Parameters
    ----------
    knots : all knots, mm of path.
    poles : (k, 3, 3) float, mm: of X, A and B.
    degree : 3, or 1 for a prism.
    stations : (s,) float, parameters of the stations.
    members : (s - 1,) int, the member between each two stations.
    nodes : (s,) int, the node of the truss at each station, or -1.
    """

    knots: Float[np.ndarray, " t"]
    poles: Float[np.ndarray, "k 3 3"]
    degree: int
    stations: Float[np.ndarray, " s"]
    members: Int[np.ndarray, " s1"]
    nodes: Int[np.ndarray, " s"]

    def __post_init__(self) -> None:
        freeze(self, knots=np.float64, poles=np.float64, stations=np.float64, members=np.int64, nodes=np.int64)

    def sections(self, v: Float[np.ndarray, " j"]) -> Float[np.ndarray, "j 3 3"]:
        """X, A and B at parameters."""
        return BSpline(self.knots, self.poles, self.degree)(v)


@dataclass(frozen=True, eq=False)
class Sweep:
    """A profile swept along one path: its stretches in order, and the curve that it belongs to."""

    stretches: tuple[Stretch, ...]
    curve: int
    closed: bool


def lay_sweeps(paths: Paths, truss: Truss) -> tuple[Sweep, ...]:
    """The sweeps along all paths."""
    frames = lay_sections(paths, truss)
    sweeps = []
    for p, closed in enumerate(paths.closed.tolist()):
        mine = np.arange(paths.offsets[p], paths.offsets[p + 1])
        kinks = mine[paths.kinked[mine]]
        if closed:
            # A closed path begins at a kink, if there is one, and ends where it begins.
            begin = int(kinks[0] - mine[0]) if len(kinks) else 0
            mine = np.append(np.roll(mine, -begin), mine[begin])
        breaks = np.flatnonzero(paths.kinked[mine][1:-1]) + 1
        bounds = [0, *breaks.tolist(), len(mine) - 1]
        stretches: list[Stretch] = []
        for a, b in pairwise(bounds):
            alone = closed and len(bounds) == 2
            smooth = alone and not len(kinks)
            stretches += _fit(paths, frames, mine[a : b + 1], halve=alone, periodic=smooth)
        sweeps.append(Sweep(tuple(stretches), int(paths.curves[p]), closed))
    return tuple(sweeps)


def lay_sections(paths: Paths, truss: Truss) -> Float[np.ndarray, "n 3 3"]:
    """X, A and B at the stations, in the mitre plane at kinks."""
    T, normals = paths.leaving, turn_profiles(paths, truss)
    mitre = paths.arriving + T
    mitre /= np.linalg.norm(mitre, axis=1, keepdims=True)
    axes = np.stack([normals, np.cross(T, normals)], axis=1)
    # Along the path into the plane: v - t (v . m) / (t . m); nothing changes where there is no kink.
    along = np.einsum("nkd,nd->nk", axes, mitre) / (T * mitre).sum(1)[:, None]
    axes = axes - np.where(paths.kinked[:, None], along, 0)[..., None] * T[:, None]
    return np.concatenate([paths.points[:, None], paths.radii[:, None, None] * axes], axis=1)


def _fit(paths: Paths, frames: np.ndarray, some: np.ndarray, halve: bool, periodic: bool) -> list[Stretch]:
    """Stretches through some stations in order: one, or two halves that join smoothly."""
    F = frames[some]
    v = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(F[:, 0], axis=0), axis=1))])
    members, nodes = paths.members[some[:-1]], paths.nodes[some]
    if _is_prism(F, paths.leaving[some[0]], v[-1]) and not halve:
        poles = F[[0, -1]]
        return [Stretch(v[[0, 0, -1, -1]], poles, 1, v, members, nodes)]
    if not halve:
        return [_interpolated(v, F, members, nodes, None)]
    slope = make_interp_spline(v, F, 3, bc_type="periodic" if periodic else None).derivative()
    middle = len(v) // 2
    halves = []
    for part in (slice(0, middle + 1), slice(middle, len(v))):
        w = v[part]
        ends = [slope(w[0]) if periodic or part.start else None, slope(w[-1]) if periodic or not part.start else None]
        halves.append(_interpolated(w, F[part], members[part.start : part.stop - 1], nodes[part], ends))
    return halves


def _interpolated(v, F, members, nodes, ends: Sequence[np.ndarray | None] | None) -> Stretch:
    """The cubic spline through stations, with the slopes at its ends if they are given."""
    conditions = None
    if ends is not None:
        # "Not a knot" is no condition that one end can have alone: a free end has the third derivative of a parabola.
        conditions = tuple([(1, end)] if end is not None else [(3, np.zeros((3, 3)))] for end in ends)
    spline = make_interp_spline(v, F, 3, bc_type=conditions)
    return Stretch(spline.t, spline.c, 3, v, members, nodes)


def _is_prism(F: np.ndarray, tangent: np.ndarray, length: float) -> bool:
    """Whether the stations lie on a line and their sections are one section, seen along it."""
    X, axes = F[:, 0], F[:, 1:]
    aside = X - X[0] - ((X - X[0]) @ tangent)[:, None] * tangent
    axes = axes - (axes @ tangent)[..., None] * tangent
    return bool(max(np.abs(aside).max(), np.abs(axes - axes[0]).max()) <= STRAIGHT * length)
