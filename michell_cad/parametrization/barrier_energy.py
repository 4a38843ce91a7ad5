"""The energy of `fold_barrier`, tet by tet, compiled: one pass gathers the map, adds energy and gradient."""

from typing import Any

import numpy as np

from michell_cad.compiled import compiled


def _add_tets(
    tets: Any,
    hats: Any,
    R: Any,
    phi: Any,
    w: Any,
    beta: float,
    mu: float,
    d0: float,
    dh: float,
    eps: float,
    gradient: Any,
) -> tuple[float, float]:
    """Return the energy and the smallest d = det J - d0; add the gradient to `gradient`.

    The energy of a tet is w (beta sum_i (M_ii - 1)^2 + sum_{i != j} M_ij^2 + mu psi(chi(d)/dh)) with M = J R,
    chi(d) = (d + (eps^2 + d^2)^(1/2))/2 and psi(s) = (1 - s)^2/s for s < 1, else 0. It is inf as soon as eps = 0 and
    d <= 0.

    tets (n_t, 4), hats (n_t, 4, 3) the gradients of the barycentric coordinates, R (n_t, 3, 3), phi and gradient
    (n_v, 3), w (n_t,).
    """
    J, C, P, M = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    energy, least = 0.0, np.inf
    for t in range(len(tets)):
        for i in range(3):
            for k in range(3):
                J[i, k] = 0.0
                for a in range(4):
                    J[i, k] += phi[tets[t, a], i] * hats[t, a, k]
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            for e in range(3):
                f, g = (e + 1) % 3, (e + 2) % 3
                C[i, e] = J[j, f] * J[k, g] - J[j, g] * J[k, f]
        d = J[0, 0] * C[0, 0] + J[0, 1] * C[0, 1] + J[0, 2] * C[0, 2] - d0
        least = min(least, d)
        if eps == 0 and d <= 0:
            return np.inf, least

        for i in range(3):
            for j in range(3):
                M[i, j] = J[i, 0] * R[t, 0, j] + J[i, 1] * R[t, 1, j] + J[i, 2] * R[t, 2, j]
            M[i, i] -= 1
            for j in range(3):
                penalty = w[t] * (beta if i == j else 1.0)
                energy += penalty * M[i, j] ** 2
                M[i, j] *= 2 * penalty
            for k in range(3):
                P[i, k] = M[i, 0] * R[t, k, 0] + M[i, 1] * R[t, k, 1] + M[i, 2] * R[t, k, 2]

        root = np.sqrt(eps * eps + d * d)
        # For negative d in the form that does not cancel.
        chi = (d + root) / 2 if d > 0 else eps * eps / (2 * (root - d))
        s = chi / dh
        if s < 1:
            energy += mu * w[t] * (1 - s) ** 2 / s
            slope = mu * w[t] * (1 - 1 / (s * s)) / dh * chi / root  # d chi / d d = chi / root
            for i in range(3):
                for k in range(3):
                    P[i, k] += slope * C[i, k]
        for a in range(4):
            for i in range(3):
                gradient[tets[t, a], i] += P[i, 0] * hats[t, a, 0] + P[i, 1] * hats[t, a, 1] + P[i, 2] * hats[t, a, 2]
    return energy, least


add_tets = compiled(_add_tets, reorder=True)
