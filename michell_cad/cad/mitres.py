"""Creased members of one node: where their equal tubes meet each other and the sphere of the node.

All creased members of a node have the same radius r, and their axes run through the node. A point of the surface of
their union belongs to the member whose direction is nearest, so that member e, at the angle u around its axis, begins
at
    v(u) = max(H, max_j r / tan(alpha_ej / 2) cos(u - u_j)),
H = sqrt(R^2 - r^2), where alpha_ej is the angle to member j and u_j the angle around e at which j lies. The pieces of
this envelope are arcs of the circle in which the tube leaves the sphere, and arcs of the ellipse in the plane that
bisects e and j: with b the bisector and w the common normal of both, x = r / sin(alpha / 2) cos(t) b + r sin(t) w,
where t = u - u_j seen from the one member and t = -(u - u_j) from the other.

With fillets of radius f, these are the offsets of the tubes and the sphere, r + f and R + f, see `creases`.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from michell_cad.cad.mitre_cuts import cut, envelopes

SHORTEST_EDGE = 0.01
"""Edges of a mitre are at least this long (relative to r): what is shorter comes from members in special position."""


@dataclass(frozen=True)
class Piece:
    """A piece of the boundary at which a mitred tube begins: from angle `start` to `stop` around it."""

    end: int
    neighbour: int
    start: float
    stop: float
    first: int
    last: int


@dataclass(frozen=True, eq=False)
class Mitre:
    """The corners (k, 3), relative to the node, and for each mitred end the pieces in ascending order of angle.

    The first piece of an end starts at angle 0, the last stops at 2 pi. Every piece between two members occurs twice,
    with the same two corners in opposite order.
    """

    corners: Float[np.ndarray, "k 3"]
    pieces: tuple[tuple[Piece, ...], ...]


@dataclass(frozen=True, eq=False)
class NodeMitre:
    """The mitred ends of one node and how they are cut; member k of `mitre` is `ends[k]`."""

    ends: Int[np.ndarray, " k"]
    mitre: Mitre


def cut_mitre(
    directions: Float[np.ndarray, "k 3"], normals: Float[np.ndarray, "k 3"], R: float, r: float
) -> Mitre | None:
    """Cut the mitred members of one node; None if an edge would be too short or members are in special position.

    Parameters
    ----------
    directions : unit vectors along the members.
    normals : unit vectors at angle 0 around each member.
    R, r : radii of the sphere and of all the tubes, mm.
    """
    found, corners, links, spans = cut(directions, normals, R, r)
    if not found or (spans[:, 1] - spans[:, 0]).min() < SHORTEST_EDGE:
        return None
    pieces: list[list[Piece]] = [[] for _ in directions]
    for (end, neighbour, first, last), (start, stop) in zip(links.tolist(), spans.tolist(), strict=True):
        pieces[end].append(Piece(end, neighbour, start, stop, first, last))
    return Mitre(corners, tuple(tuple(sorted(path, key=lambda piece: piece.start)) for path in pieces))


def corner_angles(
    directions: Float[np.ndarray, "k 3"], normals: Float[np.ndarray, "k 3"], R: float, r: float
) -> list[Float[np.ndarray, " _"]]:
    """Angles around each end, from its normal, at which its envelope changes from one neighbour to another."""
    offsets, angles = envelopes(directions, normals, R, r)[:2]
    return np.split(angles, offsets[1:-1])
