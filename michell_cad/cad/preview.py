"""A mesh to look at while a knob is turned: tubes along the splines and balls at the nodes, laid over each other.

It is not the solid: nothing is prepared, filleted or united, so that it takes milliseconds; see `mesh_truss` for that.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from michell_cad.arrays import freeze, require
from michell_cad.knobs import Knobs
from michell_cad.splines import fit_splines
from michell_cad.truss import SizedTruss, member_radius

RINGS = 5
"""Rings of points along a member."""

SIDES = 8

_GOLDEN = (1 + 5**0.5) / 2
_BALL = np.array([(x, y * _GOLDEN, 0) for x in (-1, 1) for y in (-1, 1)], float)
_BALL = np.concatenate([np.roll(_BALL, turn, axis=1) for turn in range(3)]) / np.sqrt(1 + _GOLDEN**2)
"""Corners of an icosahedron on the unit sphere."""


def _ball_triangles() -> np.ndarray:
    """Triangles of the icosahedron, outward: every three corners that are all neighbours."""
    near = np.linalg.norm(_BALL[:, None] - _BALL, axis=2) < 1.1
    n = len(_BALL)
    found = [
        (i, j, k) if np.linalg.det(_BALL[[i, j, k]]) > 0 else (i, k, j)
        for i in range(n)
        for j in range(i + 1, n)
        for k in range(j + 1, n)
        if near[i, j] and near[j, k] and near[i, k]
    ]
    return np.array(found)


_BALL_TRIANGLES = _ball_triangles()


@dataclass(frozen=True, eq=False)
class PreviewMesh:
    """Triangles to draw.

    Parameters
    ----------
    vertices : (n, 3) float, mm.
    triangles : (t, 3) int, counter-clockwise seen from outside.
    curve : (t,) int, the curve that each triangle belongs to; -1 at nodes.
    """

    vertices: Float[np.ndarray, "n 3"]
    triangles: Int[np.ndarray, "t 3"]
    curve: Int[np.ndarray, " t"]

    def __post_init__(self) -> None:
        freeze(self, vertices=np.float64, triangles=np.int64, curve=np.int64)


def preview_truss(sized: SizedTruss, knobs: Knobs, sides: int = SIDES) -> PreviewMesh:
    """A mesh of a sized truss to look at; `node_ratio` of the knobs is used."""
    require(sides >= 3, f"a tube needs at least 3 sides, found {sides}")
    truss = sized.truss
    n_m = len(truss.members)
    splines, s = fit_splines(truss), np.linspace(0, 1, RINGS)
    d = splines.tangents(s)
    # One direction for all rings of a member, the axis farthest from its chord: the tube hardly twists.
    chord = np.abs(truss.nodes[truss.members[:, 1]] - truss.nodes[truss.members[:, 0]])
    away = np.eye(3)[chord.argmin(1)][:, None]
    x = away - (away * d).sum(-1, keepdims=True) * d
    x = x / np.linalg.norm(x, axis=-1, keepdims=True)
    angle = np.arange(sides) * 2 * np.pi / sides
    around = np.cos(angle)[:, None] * x[:, :, None] + np.sin(angle)[:, None] * np.cross(d, x)[:, :, None]
    r = member_radius(sized.radii[:, None], s)
    tubes = splines.positions(s)[:, :, None] + r[..., None, None] * around
    number = np.arange(n_m * RINGS * sides).reshape(n_m, RINGS, sides)
    a, b = number[:, :-1], number[:, 1:]
    a_next, b_next = np.roll(a, -1, axis=2), np.roll(b, -1, axis=2)
    walls = np.stack([np.stack([a, a_next, b_next], -1), np.stack([a, b_next, b], -1)], axis=3)
    thick = np.zeros(len(truss.nodes))
    np.maximum.at(thick, truss.members, sized.radii[:, [0, 2]])
    nodes = np.flatnonzero(thick)
    balls = truss.nodes[nodes, None] + knobs.node_ratio * thick[nodes, None, None] * _BALL
    ball_triangles = number.size + len(_BALL) * np.arange(len(nodes))[:, None, None] + _BALL_TRIANGLES
    return PreviewMesh(
        np.concatenate([tubes.reshape(-1, 3), balls.reshape(-1, 3)]),
        np.concatenate([walls.reshape(-1, 3), ball_triangles.reshape(-1, 3)]),
        np.concatenate(
            [np.repeat(truss.curve_of_member, 2 * (RINGS - 1) * sides), np.full(len(nodes) * len(_BALL_TRIANGLES), -1)]
        ),
    )
