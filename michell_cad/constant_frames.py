"""Constant frames that match a stress field as well as they can: starts for the frame field and for straight grids.

For one frame in all tets the matching energy of Arora et al. 2019 (doi:10.1145/3328939.3328999), Eq. 4, is a sum of two
values of one function on the sphere: E = f(r2) + f(r3), f(r) = sum_t v_t (r' A_t r)^(1/2). f is even and smooth, so
that a polynomial through a hundred and fifty directions stands for all tets while the search goes on; the exact energy
has the last word.
"""

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from michell_cad.matching_energy import add_tets
from michell_cad.minimize import minimize
from michell_cad.part_axes import NAMINGS, part_axes
from michell_cad.rotations import rotation_matrix
from michell_cad.tet_mesh import TetMesh

_GENERIC = ((-0.92, -2.24, -1.60), (1.21, 1.09, -1.98))
"""Rotation vectors that, named in all ways, leave the smallest gaps in the grid on which the search starts; found by
random search."""

_DEGREE = 8
"""Of the polynomial; homogeneous ones of this degree span all even functions of lower degree on the sphere. The
coefficients of (r' A r)^(1/2) with eigenvalues from 1 to 10 fall by 2 per two degrees."""

_CHUNK = 2048
"""Tets at a time: their products with all directions fit in the cache."""

_STEP, _STEPS = 0.1, 60
"""Gradient descent on the polynomial: the second derivatives of f along the sphere are below 20."""

_POLISH = 30
"""Iterations on the exact energy, enough to converge also along flat valleys: whether two frames are the same minimum
must not depend on rounding."""

_SAME_AXIS = 0.97
"""Axes with at least this cosine (14 degrees) count as the same when frames are told apart."""


def constant_frames(mesh: TetMesh, metric: Float[np.ndarray, "n_t 3 3"], count: int) -> list[np.ndarray]:
    """Up to `count` constant frames at local minima of the data energy, lowest first, all different as frames.

    The search starts on a fixed grid of rotations of the part's own axes, so that turning the part turns the result.
    Frames that differ by the symmetries of Eq. 4 (signs, and exchange of the second and third axis) are one.

    Parameters
    ----------
    mesh : TetMesh
    metric : (n_t, 3, 3), the rescaled stress sigma+ of `frame_field.matching_metric`.
    count : frames wanted.
    """
    weights = mesh.volumes / mesh.volumes.sum()
    axes = part_axes(mesh)
    A = axes.T @ metric @ axes
    one_vertex = np.zeros_like(mesh.tets)  # a constant frame is one rotation vector that all tets share

    def energy(w: np.ndarray) -> tuple[float, np.ndarray]:
        gradient = np.zeros((1, 3))
        return add_tets(one_vertex, weights, A, w, gradient), gradient

    minima: list[tuple[float, np.ndarray]] = []
    for R in _distinct(*_descend(_SphereFunction(A, weights), rotation_grid()), count):
        w = Rotation.from_matrix(R).as_rotvec()[None]
        w, report = minimize(energy, w, lambda g: g, iterations=_POLISH)
        minima.append((report.value, rotation_matrix(w[0])))
    values, frames = np.array([value for value, _ in minima]), np.array([R for _, R in minima])
    return [axes @ R for R in _distinct(values, frames, count)]


class _SphereFunction:
    """The even polynomial through f(r) = sum_t v_t (r' A_t r)^(1/2) at all axes of the grid of rotations."""

    def __init__(self, A: Float[np.ndarray, "n_t 3 3"], weights: Float[np.ndarray, " n_t"]) -> None:
        d = _DEGREE
        self._exponents = np.array([(i, j, d - i - j) for i in range(d + 1) for j in range(d + 1 - i)])
        r = rotation_grid().transpose(0, 2, 1).reshape(-1, 3)
        i, j = np.triu_indices(3)
        squares = (r[:, i] * r[:, j] * np.where(i == j, 1, 2)).T
        parts = [slice(first, first + _CHUNK) for first in range(0, len(A), _CHUNK)]
        values = sum(weights[part] @ np.sqrt(A[part][:, i, j] @ squares) for part in parts)
        self._coefficients = np.linalg.lstsq(self._monomials(r), values, rcond=None)[0]

    def _monomials(self, r: Float[np.ndarray, "k 3"], lowered: int | None = None) -> np.ndarray:
        """x^a y^b z^c for all exponents, or their derivatives by the coordinate `lowered`."""
        powers = np.cumprod(np.concatenate([np.ones((1, *r.shape)), np.repeat(r[None], _DEGREE, axis=0)]), axis=0)
        exponents, factor = self._exponents.copy(), 1
        if lowered is not None:
            factor = exponents[:, lowered].copy()
            exponents[:, lowered] = np.maximum(exponents[:, lowered] - 1, 0)
        return factor * np.prod([powers[exponents[:, d], :, d] for d in range(3)], axis=0).T

    def __call__(self, r: Float[np.ndarray, "k 3"]) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, "k 3"]]:
        """Values, and gradients in space."""
        gradient = np.stack([self._monomials(r, lowered=d) @ self._coefficients for d in range(3)], axis=1)
        return np.einsum("kd,kd->k", gradient, r) / _DEGREE, gradient  # Euler's theorem


def _descend(f: _SphereFunction, R: Float[np.ndarray, "k 3 3"]) -> tuple[np.ndarray, np.ndarray]:
    """Gradient descent of f(r2) + f(r3) from all rotations at once: energies and rotations.

    Under R -> R exp [d]_x the axes turn by dr2 = d1 r3 - d3 r1, dr3 = d2 r1 - d1 r2.
    """
    for _ in range(_STEPS):
        (_, g2), (_, g3) = f(R[:, :, 1]), f(R[:, :, 2])
        along = [np.einsum("kd,kdj->kj", g, R) for g in (g2, g3)]  # components of both gradients on r1, r2, r3
        d = np.stack([along[0][:, 2] - along[1][:, 1], along[1][:, 0], -along[0][:, 0]], axis=1)
        R = R @ rotation_matrix(-_STEP * d)
    return f(R[:, :, 1])[0] + f(R[:, :, 2])[0], R


def _distinct(energies: np.ndarray, frames: np.ndarray, count: int) -> list[np.ndarray]:
    """The `count` lowest frames that differ from each other."""
    kept: list[np.ndarray] = []
    for number in np.argsort(energies, kind="stable"):
        if len(kept) < count and all(not _same_frame(frames[number], other) for other in kept):
            kept.append(frames[number])
    return kept


def rotation_grid() -> Float[np.ndarray, "k 3 3"]:
    """Rotations that cover the frames which Eq. 4 tells apart within 26 degrees, and come together with all that
    naming the axes differently makes of them, so that it does not matter which naming is at hand.
    """
    cyclic = [N for N in NAMINGS if (N >= 0).all()]  # of the namings themselves, those that Eq. 4 tells apart
    return np.array(cyclic + [N @ rotation_matrix(np.array(w)) for w in _GENERIC for N in NAMINGS])


def _same_frame(A: np.ndarray, B: np.ndarray) -> bool:
    cosines = np.abs(A.T @ B)
    return bool(cosines[0, 0] > _SAME_AXIS and max(cosines[1, 1], cosines[1, 2]) > _SAME_AXIS)
