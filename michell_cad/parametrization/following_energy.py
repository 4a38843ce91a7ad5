"""The energy of `stress_following`, tet by tet, compiled.

One pass over the tets gathers the four values of the map, adds the energy and scatters its gradient. With NumPy the
same takes forty passes over arrays that do not fit in the cache, and five times as long; this energy is evaluated
hundreds of times.
"""

from typing import Any

import numpy as np

from michell_cad.compiled import compiled

ROUNDING = 0.01
"""Under the root of the first term: it rounds off the kink at exact alignment (relative, squared)."""
ORTHOGONALITY = 2.0
"""Weight of the second term. At 1 the curves cross obliquely (angles deviate by 14 degrees on average over five of the
paper's problems, by 5 at 3) for hardly less stress left uncarried, and acute nodes are what tubes cannot meet in."""
BARRIER = 0.01
"""Weight of the barrier."""


def _add_tets(
    tets: Any, hats: Any, phi: Any, A: Any, W: Any, w: Any, spacing: float, d0: float, dh: float, gradient: Any
) -> float:
    """Return the energy and add its gradient to `gradient`; inf as soon as a determinant is not above d0.

    Names as in `stress_following`: tets (n_t, 4), hats (n_t, 4, 3) the gradients of the barycentric coordinates, phi
    and gradient (n_v, 3), A (n_t, 3, 3), W and w (n_t,), spacing = k_s.
    """
    J, C, N, NA, P = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    B, T, Q, BQ = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    length, h = np.empty(3), np.empty(3)
    S, X = np.zeros((3, 3)), np.zeros((3, 3))
    energy = 0.0
    for t in range(len(tets)):
        for i in range(3):
            for d in range(3):
                J[i, d] = 0.0
                for a in range(4):
                    J[i, d] += phi[tets[t, a], i] * hats[t, a, d]
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            for d in range(3):
                e, f = (d + 1) % 3, (d + 2) % 3
                C[i, d] = J[j, e] * J[k, f] - J[j, f] * J[k, e]
        det = J[0, 0] * C[0, 0] + J[0, 1] * C[0, 1] + J[0, 2] * C[0, 2]
        s = (det - d0) / dh
        if not s > 0:
            return np.inf

        # Conjugacy of the gradients: S = N A N' without its diagonal, rows of N of length one.
        for i in range(3):
            length[i] = np.sqrt(J[i, 0] ** 2 + J[i, 1] ** 2 + J[i, 2] ** 2)
            for d in range(3):
                N[i, d] = J[i, d] / length[i]
        for i in range(3):
            for d in range(3):
                NA[i, d] = N[i, 0] * A[t, 0, d] + N[i, 1] * A[t, 1, d] + N[i, 2] * A[t, 2, d]
        squares = 0.0
        for i in range(3):
            k = (i + 1) % 3
            S[i, k] = S[k, i] = NA[i, 0] * N[k, 0] + NA[i, 1] * N[k, 1] + NA[i, 2] * N[k, 2]
            squares += 2 * S[i, k] ** 2
        root = np.sqrt(squares + ROUNDING)
        energy += W[t] * root
        for i in range(3):
            for d in range(3):
                P[i, d] = 2 * W[t] / root * (S[i, 0] * NA[0, d] + S[i, 1] * NA[1, d] + S[i, 2] * NA[2, d])
            along = P[i, 0] * N[i, 0] + P[i, 1] * N[i, 1] + P[i, 2] * N[i, 2]
            for d in range(3):
                P[i, d] = (P[i, d] - along * N[i, d]) / length[i]

        # Angles between the tangents, columns of B = J^-1 = C'/det, and spacing: Q is the gradient with respect to B.
        for i in range(3):
            h[i] = np.sqrt(C[i, 0] ** 2 + C[i, 1] ** 2 + C[i, 2] ** 2) / det
            for d in range(3):
                B[d, i] = C[i, d] / det
                T[d, i] = B[d, i] / h[i]
        for i in range(3):
            k = (i + 1) % 3
            X[i, k] = X[k, i] = T[0, i] * T[0, k] + T[1, i] * T[1, k] + T[2, i] * T[2, k]
            energy += ORTHOGONALITY * W[t] * X[i, k] ** 2
        for i in range(3):
            h2 = h[i] ** 2
            energy += spacing * w[t] * (h2 + 1 / h2 - 2)
            for d in range(3):
                Q[d, i] = 2 * ORTHOGONALITY * W[t] * (T[d, 0] * X[0, i] + T[d, 1] * X[1, i] + T[d, 2] * X[2, i])
            along = Q[0, i] * T[0, i] + Q[1, i] * T[1, i] + Q[2, i] * T[2, i]
            stretch = spacing * w[t] * (2 - 2 / h2**2)
            for d in range(3):
                Q[d, i] = (Q[d, i] - along * T[d, i]) / h[i] + stretch * B[d, i]

        # d B = -B dJ B, so the gradient with respect to J is -B' Q B'.
        for i in range(3):
            for k in range(3):
                BQ[i, k] = B[0, i] * Q[0, k] + B[1, i] * Q[1, k] + B[2, i] * Q[2, k]
        slope = 0.0
        if s < 1:
            energy += BARRIER * w[t] * (1 - s) ** 2 / s
            slope = BARRIER * w[t] * (1 - 1 / (s * s)) / dh
        for i in range(3):
            for d in range(3):
                P[i, d] += slope * C[i, d] - (BQ[i, 0] * B[d, 0] + BQ[i, 1] * B[d, 1] + BQ[i, 2] * B[d, 2])
        for a in range(4):
            for i in range(3):
                gradient[tets[t, a], i] += P[i, 0] * hats[t, a, 0] + P[i, 1] * hats[t, a, 1] + P[i, 2] * hats[t, a, 2]
    return energy


add_tets = compiled(_add_tets, reorder=True)
