"""Axes of a part that turn with it: the directions from which the searches for frames and maps start.

The axes of inertia (any text on mechanics) are not defined where two moments are equal, as of a square bar, or all
three, as of a cube: rounding would choose. There the fourth moments decide, which know a square from a circle. What is
left open is the naming: order and signs. Whoever uses the axes has to use all `NAMINGS` alike.
"""

from itertools import permutations, product

import numpy as np
from jaxtyping import Float

from michell_cad.tet_mesh import TetMesh

SAME_MOMENT = 0.02
"""Moments of inertia count as equal when they differ by less than this fraction of the largest second moment."""

ROUND = 1e-9
"""Below this fraction of the fourth moments their anisotropy is rounding: the section is round, and any axes do."""

_SWEEPS = 30
"""Turns about each axis of a part with three equal moments; a cube takes five to come within rounding."""

NAMINGS: Float[np.ndarray, "24 3 3"] = np.array(
    [
        np.diag(signs)[list(order)]
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
        if np.linalg.det(np.diag(signs)[list(order)]) > 0
    ]
)
"""The 24 rotations that map coordinate axes to coordinate axes."""


def part_axes(mesh: TetMesh) -> Float[np.ndarray, "3 3"]:
    """Axes of the part as the columns of a rotation, up to `NAMINGS`.

    The axes of inertia; in planes of equal moments those that make the mean of x^4 + y^4 smallest, which for a square
    are the normals of its sides.
    """
    V = mesh.volumes
    x = mesh.vertices - V @ mesh.centroids / V.sum()
    corners = x[mesh.tets]
    sums = corners.sum(1)
    # The integral of x x' over a tet is volume/20 (sum of x_a x_a' over its corners + the same of their sum).
    second = np.einsum("t,tai,taj->ij", V, corners, corners) + np.einsum("t,ti,tj->ij", V, sums, sums)
    moments, axes = np.linalg.eigh(second)
    same = np.diff(moments) < SAME_MOMENT * moments[2]
    planes = [(i, j) for i, j, equal in ((0, 1, same[0]), (1, 2, same[1]), (0, 2, same.all())) if equal]
    for _ in range(_SWEEPS if len(planes) > 1 else 1):
        for i, j in planes:
            z = (x @ axes[:, i] + 1j * (x @ axes[:, j]))[mesh.tets]
            axes[:, [i, j]] = axes[:, [i, j]] @ _turn_within(z, V)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return axes


def _turn_within(z: np.ndarray, volumes: np.ndarray) -> Float[np.ndarray, "2 2"]:
    """The turn of the axes of a plane, z = x + i y at the corners of tets, that makes the mean of x^4 + y^4 smallest.

    x^4 + y^4 = 3/4 |z|^4 + 1/4 Re z^4, and z^4 turns by -4 alpha when the axes turn by alpha. The mean of z^4 over a
    tet is the complete homogeneous polynomial of degree 4 of its values at the corners, over 35.
    """
    h = [np.ones(len(z), complex), *(np.zeros(len(z), complex) for _ in range(4))]
    for corner in z.T:
        for degree in range(1, 5):
            h[degree] += corner * h[degree - 1]
    fourth = volumes @ h[4] / 35
    if np.abs(fourth) <= ROUND * (volumes @ np.mean(np.abs(z) ** 4, axis=1)):
        return np.eye(2)
    # Of the four turns that do, the one nearest to none.
    alpha = np.angle(-fourth) / 4
    return np.array([[np.cos(alpha), -np.sin(alpha)], [np.sin(alpha), np.cos(alpha)]])
