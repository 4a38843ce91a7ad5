"""The matching energy of frames and stress (Eq. 4 of Arora et al. 2019), tet by tet, compiled.

One pass gathers the rotation vectors, adds the energy and scatters its gradient; NumPy takes thirty passes and four
times as long, and the frame field evaluates this energy hundreds of times.
"""

from typing import Any

import numpy as np

from michell_cad.compiled import compiled

_SMALL_ANGLE = 1e-4
"""Below this angle (radians) the Taylor series are exact to double precision: their next terms are below 1e-16."""


def _add_tets(tets: Any, weights: Any, A: Any, w: Any, gradient: Any) -> float:
    """Return sum_t v_t (|r2|_A + |r3|_A), R = exp [w_t]_x, w_t the mean of four vectors; add its gradient to
    `gradient`.

    tets (n_t, 4), weights v (n_t,), A (n_t, 3, 3) symmetric positive definite, w and gradient (n_v, 3).

    With S = R' A R the energy changes under R -> R exp [d]_x by v . d, where
    v = (S23 (1/n2 - 1/n3), S13/n3, -S12/n2), n2 = S22^(1/2), n3 = S33^(1/2): the axes turn by dr2 = d1 r3 - d3 r1,
    dr3 = d2 r1 - d1 r2. The gradient with respect to w_t is J' v with the right Jacobian of the exponential map,
    J = I - b [w]_x + e [w]_x^2, b = (1 - cos |w|)/|w|^2, e = (|w| - sin |w|)/|w|^3.
    """
    R, AR = np.empty((3, 3)), np.empty((3, 3))
    x, v, c, cc = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    energy = 0.0
    for t in range(len(tets)):
        for i in range(3):
            x[i] = 0.25 * (w[tets[t, 0], i] + w[tets[t, 1], i] + w[tets[t, 2], i] + w[tets[t, 3], i])
        angle2 = x[0] ** 2 + x[1] ** 2 + x[2] ** 2
        angle = np.sqrt(angle2)
        if angle < _SMALL_ANGLE:
            a, b, e = 1 - angle2 / 6, 0.5 - angle2 / 24, 1 / 6 - angle2 / 120
        else:
            a, b, e = np.sin(angle) / angle, (1 - np.cos(angle)) / angle2, (angle - np.sin(angle)) / (angle2 * angle)
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            R[i, i] = 1 - b * (x[j] ** 2 + x[k] ** 2)
            R[k, j] = b * x[j] * x[k] + a * x[i]
            R[j, k] = b * x[j] * x[k] - a * x[i]
        for i in range(3):
            for j in range(3):
                AR[i, j] = A[t, i, 0] * R[0, j] + A[t, i, 1] * R[1, j] + A[t, i, 2] * R[2, j]
        S12 = R[0, 0] * AR[0, 1] + R[1, 0] * AR[1, 1] + R[2, 0] * AR[2, 1]
        S13 = R[0, 0] * AR[0, 2] + R[1, 0] * AR[1, 2] + R[2, 0] * AR[2, 2]
        S23 = R[0, 1] * AR[0, 2] + R[1, 1] * AR[1, 2] + R[2, 1] * AR[2, 2]
        n2 = np.sqrt(R[0, 1] * AR[0, 1] + R[1, 1] * AR[1, 1] + R[2, 1] * AR[2, 1])
        n3 = np.sqrt(R[0, 2] * AR[0, 2] + R[1, 2] * AR[1, 2] + R[2, 2] * AR[2, 2])
        energy += weights[t] * (n2 + n3)
        v[0], v[1], v[2] = S23 * (1 / n2 - 1 / n3), S13 / n3, -S12 / n2
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            c[i] = x[j] * v[k] - x[k] * v[j]
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            cc[i] = x[j] * c[k] - x[k] * c[j]
        for i in range(3):
            share = 0.25 * weights[t] * (v[i] + b * c[i] + e * cc[i])
            for corner in range(4):
                gradient[tets[t, corner], i] += share
    return energy


add_tets = compiled(_add_tets, reorder=True)
