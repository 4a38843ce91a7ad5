"""The six rigid motions of a body: which of them its supports leave free, and in plain words."""

import numpy as np
from jaxtyping import Float

RANK_TOLERANCE = 1e-9
"""Singular values of the held rigid motions below this fraction of the largest one count as zero (relative)."""


def rigid_motions(x: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3 6"]:
    """Displacements at the points `x` of the three unit translations and the three unit rotations about the origin.

    Row d of point n is row d of [I, -[x]_x]. The transpose takes a force at x to its resultant force and moment.
    """
    rows = np.zeros((len(x), 3, 6))
    rows[:, [0, 1, 2], [0, 1, 2]] = 1
    for axis in range(3):
        rows[:, :, 3 + axis] = np.cross(np.eye(3)[axis], x)
    return rows


def free_motions(held: Float[np.ndarray, "k 6"]) -> Float[np.ndarray, "6 j"]:
    """Rigid motions that vanish in every held component: an orthonormal basis of the null space of `held`.

    Points should be given about the body's centre in units of its size, so that translations and rotations compare.
    """
    values, vectors = np.linalg.eigh(held.T @ held)
    return vectors[:, values <= RANK_TOLERANCE * max(values.max(), 1.0)]


def name_motions(motions: Float[np.ndarray, "6 j"]) -> list[str]:
    """Say what each motion is, by its largest translation or rotation."""
    largest = np.argmax(np.abs(motions), axis=0).tolist()
    return [f"it can move along {'xyz'[k]}" if k < 3 else f"it can turn about {'xyz'[k - 3]}" for k in largest]
