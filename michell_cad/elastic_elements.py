"""Linear elasticity tet by tet, compiled: the stiffness matrix, and the forces of the averaged stress.

The smoothing of `elasticity` applies its operator up to 40 times; a pass of NumPy over all tets for each step of the
formula takes ten times as long as these two.
"""

from typing import Any

import numpy as np

from michell_cad.compiled import compiled

PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
"""The six components of a symmetric tensor, in the order in which the averaged stress is kept."""


def _add_stiffness(entry: Any, hats: Any, volumes: Any, lmbda: float, mu: float, blocks: Any) -> None:
    """Add volume (lambda g_a g_b' + mu g_b g_a' + mu (g_a . g_b) I) of every tet to its block (a, b).

    entry (n_t, 4, 4) are the numbers of the blocks, hats (n_t, 4, 3) the gradients g, blocks (n, 3, 3).
    """
    for t in range(len(entry)):
        for a in range(4):
            for b in range(4):
                block = blocks[entry[t, a, b]]
                dot = 0.0
                for i in range(3):
                    dot += hats[t, a, i] * hats[t, b, i]
                for i in range(3):
                    for j in range(3):
                        block[i, j] += volumes[t] * (
                            lmbda * hats[t, a, i] * hats[t, b, j] + mu * hats[t, b, i] * hats[t, a, j]
                        )
                    block[i, i] += volumes[t] * mu * dot


def _add_averaged_force(
    tets: Any, hats: Any, volumes: Any, vertex_volumes: Any, lmbda: float, mu: float, u: Any, nodal: Any, force: Any
) -> None:
    """Add the nodal forces in equilibrium with the averaged stress of the displacement u (n_v, 3) to `force`.

    sigma = lambda tr(eps) I + 2 mu eps in each tet goes to its vertices, weighted by volume, into `nodal` (n_v, 6),
    zero before, see `PAIRS`; the mean of the four corners is the averaged stress s of a tet, and volume s g_a its force
    at corner a.
    """
    H, s = np.empty((3, 3)), np.empty(6)
    for t in range(len(tets)):
        for i in range(3):
            for j in range(3):
                H[i, j] = 0.0
                for a in range(4):
                    H[i, j] += u[tets[t, a], i] * hats[t, a, j]
        pressure = lmbda * (H[0, 0] + H[1, 1] + H[2, 2])
        for a in range(4):
            share = 0.25 * volumes[t] / vertex_volumes[tets[t, a]]
            row = nodal[tets[t, a]]
            for i in range(3):
                row[i] += share * (2 * mu * H[i, i] + pressure)
            row[3] += share * mu * (H[1, 2] + H[2, 1])
            row[4] += share * mu * (H[0, 2] + H[2, 0])
            row[5] += share * mu * (H[0, 1] + H[1, 0])
    for t in range(len(tets)):
        for k in range(6):
            s[k] = (
                0.25
                * volumes[t]
                * (nodal[tets[t, 0], k] + nodal[tets[t, 1], k] + nodal[tets[t, 2], k] + nodal[tets[t, 3], k])
            )
        for a in range(4):
            x, y, z = hats[t, a, 0], hats[t, a, 1], hats[t, a, 2]
            row = force[tets[t, a]]
            row[0] += s[0] * x + s[5] * y + s[4] * z
            row[1] += s[5] * x + s[1] * y + s[3] * z
            row[2] += s[4] * x + s[3] * y + s[2] * z


add_stiffness = compiled(_add_stiffness, reorder=True)
add_averaged_force = compiled(_add_averaged_force, reorder=True)
