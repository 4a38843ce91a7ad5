"""Finer triangles on the same surface, for regions that cut through large faces before there is a tet mesh."""

import numpy as np
from jaxtyping import Int

from michell_cad.domain.outline import Surface


def refine_surface(surface: Surface, longest: float) -> Surface:
    """Halve edges until none is longer than `longest` (mm); neighbours agree on every edge, so it stays closed."""
    V, F, owner = surface.vertices, surface.triangles, surface.face_numbers
    while True:
        sides = F[:, [[0, 1], [1, 2], [2, 0]]]
        lengths = np.linalg.norm(V[sides[:, :, 0]] - V[sides[:, :, 1]], axis=2)
        halved = lengths > longest
        if not halved.any():
            return Surface(V, F, owner)
        ends = np.sort(sides[halved], axis=1)
        key, inverse = np.unique(ends[:, 0] * len(V) + ends[:, 1], return_inverse=True)
        middle = np.full(F.shape, -1)
        middle[halved] = len(V) + inverse
        V = np.concatenate([V, (V[key // len(V)] + V[key % len(V)]) / 2])
        F, origin = _split(F, middle)
        owner = owner[origin]


def _split(F: Int[np.ndarray, "n 3"], middle: Int[np.ndarray, "n 3"]) -> tuple[np.ndarray, np.ndarray]:
    """Split triangles at the middles of their edges (-1: edge not halved); also the triangle that each comes from."""
    pieces, origins = [], []

    def add(where: np.ndarray, *corners: np.ndarray) -> None:
        pieces.append(np.stack(corners, axis=1))
        origins.append(where)

    count = (middle >= 0).sum(1)
    whole, all_three = np.flatnonzero(count == 0), np.flatnonzero(count == 3)
    add(whole, *F[whole].T)
    (a, b, c), (p, q, r) = F[all_three].T, middle[all_three].T
    for corners in ((a, p, r), (p, b, q), (r, q, c), (p, q, r)):
        add(all_three, *corners)
    for first in range(3):
        i, j, k = first, (first + 1) % 3, (first + 2) % 3
        one = np.flatnonzero((count == 1) & (middle[:, i] >= 0))
        add(one, F[one, i], middle[one, i], F[one, k])
        add(one, middle[one, i], F[one, j], F[one, k])
        two = np.flatnonzero((count == 2) & (middle[:, k] < 0))
        add(two, middle[two, i], F[two, j], middle[two, j])
        add(two, F[two, i], middle[two, i], middle[two, j])
        add(two, F[two, i], middle[two, j], F[two, k])
    return np.concatenate(pieces), np.concatenate(origins)
