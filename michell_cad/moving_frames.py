"""Rotation-minimising frames along many curves at once.

Source: Wang, Jüttler, Zheng and Liu 2008, Computation of rotation minimizing frames, ACM Trans. Graph. 27(1),
doi:10.1145/1330511.1330513: the double reflection of Table I, which errs by the fourth power of the step. At a kink, a
point with two tangents, the frame turns by the smallest rotation from one to the other, as it does along an arc.
"""

import numpy as np
from jaxtyping import Float, Int


def transport_normals(
    points: Float[np.ndarray, "n 3"],
    arriving: Float[np.ndarray, "n 3"],
    leaving: Float[np.ndarray, "n 3"],
    offsets: Int[np.ndarray, " r1"],
    first: Float[np.ndarray, "r 3"],
) -> Float[np.ndarray, "n 3"]:
    """Unit normals carried along curves without twist.

    Parameters
    ----------
    points : of curve r in order, ``points[offsets[r] : offsets[r + 1]]``.
    arriving, leaving : unit tangents at the points, before and behind; they differ at kinks.
    offsets : where the points of each curve begin, and the number of all.
    first : the normal at the first point of each curve, perpendicular to the tangent that leaves there.

    Returns
    -------
    (n, 3) float
        Perpendicular to the tangents that leave.
    """
    normals = np.empty_like(points)
    normals[offsets[:-1]] = first
    counts = np.diff(offsets)
    for k in range(int(counts.max(initial=1)) - 1):
        i = offsets[:-1][counts > k + 1] + k
        carried = reflect_twice(points[i + 1] - points[i], leaving[i], arriving[i + 1], normals[i])
        normals[i + 1] = turn_minimally(arriving[i + 1], leaving[i + 1], carried)
    return normals


def reflect_twice(
    step: Float[np.ndarray, "n 3"],
    start: Float[np.ndarray, "n 3"],
    end: Float[np.ndarray, "n 3"],
    normal: Float[np.ndarray, "n 3"],
) -> Float[np.ndarray, "n 3"]:
    """Normals at the end of steps, from those at their start: reflected at the middle of the step, and then so that the
    reflected start tangent becomes the end tangent (Wang et al. 2008, Table I)."""
    reflected, tangent = _reflect(step, normal), _reflect(step, start)
    carried = _reflect(end - tangent, reflected)
    carried = carried - _dot(carried, end) * end
    return carried / np.linalg.norm(carried, axis=1, keepdims=True)


def turn_minimally(
    before: Float[np.ndarray, "n 3"], behind: Float[np.ndarray, "n 3"], normal: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n 3"]:
    """Normals turned with the smallest rotation from a tangent to another one (not its opposite)."""
    turned = normal - _dot(normal, behind) / (1 + _dot(before, behind)) * (before + behind)
    turned = turned - _dot(turned, behind) * behind
    return turned / np.linalg.norm(turned, axis=1, keepdims=True)


def _reflect(across: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Vectors reflected at the planes across others; unchanged where these are zero."""
    square = _dot(across, across)
    return v - 2 * np.divide(_dot(across, v), square, out=np.zeros_like(square), where=square > 0) * across


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("nd,nd->n", a, b)[:, None]
