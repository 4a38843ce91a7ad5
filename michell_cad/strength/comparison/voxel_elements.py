"""The trilinear brick with eight nodes: shape functions and stiffness.

Any finite-element text (Hughes, The Finite Element Method, 2000, Section 3.5): on [-1, 1]^3, corner a at s_a,
N_a = (1 + s_a1 x1) (1 + s_a2 x2) (1 + s_a3 x3) / 8. Two Gauss points along each axis integrate the stiffness of a brick
exactly.
"""

from itertools import product

import numpy as np
from jaxtyping import Float

from michell_cad.elasticity import lame_parameters
from michell_cad.problem import Material

CORNERS: Float[np.ndarray, "8 3"] = np.array(list(product((-1.0, 1.0), repeat=3)))
"""Of [-1, 1]^3; the third coordinate runs fastest."""

GAUSS_POINTS: Float[np.ndarray, "8 3"] = CORNERS / np.sqrt(3)
"""Each with the weight one."""

FINE_POINTS: Float[np.ndarray, "64 3"] = (
    0.5 * CORNERS[:, None] + 0.5 * GAUSS_POINTS  # those of each eighth of the brick
).reshape(-1, 3)
"""Points of equal weight, for integrals that stop somewhere in a brick, and exact for its stiffness, too."""


def shape_functions(x: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 8"]:
    """Values of the eight functions at points of [-1, 1]^3; outside they are the same polynomials."""
    return np.prod(1 + CORNERS * x[:, None], axis=2) / 8


def shape_gradients(x: Float[np.ndarray, "n 3"], edges: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "n 8 3"]:
    """Gradients of the eight functions in a brick with the given edges, mm; points as for `shape_functions`."""
    factors = 1 + CORNERS * x[:, None]
    others = np.stack([factors[..., [1, 2]].prod(-1), factors[..., [0, 2]].prod(-1), factors[..., [0, 1]].prod(-1)], -1)
    return CORNERS * others / 8 * (2 / edges)


def brick_stiffness(edges: Float[np.ndarray, " 3"], material: Material) -> Float[np.ndarray, "24 24"]:
    """K_ab = integral of lambda g_a g_b' + mu g_b g_a' + mu (g_a . g_b) I over a brick, N/mm; component 3 a + d."""
    lmbda, mu = lame_parameters(material)
    g = shape_gradients(GAUSS_POINTS, edges)
    products = np.einsum("qai,qbj->aibj", g, g)
    dots = np.einsum("qad,qbd,ij->aibj", g, g, np.eye(3))
    K = lmbda * products + mu * products.transpose(0, 3, 2, 1) + mu * dots
    return (edges.prod() / 8 * K).reshape(24, 24)
