"""Frames that the tests share, and their loadings."""

import numpy as np

from michell_cad.curves import Curve, CurveKind
from michell_cad.problem import Material
from michell_cad.strength import TrussLoading
from michell_cad.truss import SizedTruss, Truss

STEEL = Material("steel", youngs_modulus=210000.0, poisson_ratio=0.3, density=7.85e-3, yield_strength=235.0)


def frame(nodes, members, radii=1.0) -> SizedTruss:
    """A truss each of whose members is a curve of its own, with radii (n_m, 3) or one for all."""
    members = np.sort(np.asarray(members), axis=1)
    curves = tuple(
        Curve(CurveKind.FEATURE, "feature", -1, (None, None, None), number, pair, np.array([number]), closed=False)
        for number, pair in enumerate(members)
    )
    nodes = np.asarray(nodes, float)
    truss = Truss(nodes, np.zeros(len(nodes), int), members, curves, spacing=1.0)
    return SizedTruss(truss, np.broadcast_to(radii, (len(members), 3)))


def cube_frame(radius=0.1) -> SizedTruss:
    """A skewed cube with one face diagonal; nodes 0 to 3 below, 4 to 7 above."""
    corners = np.array([[0, 0, 0], [2, 0, 0], [2, 1.5, 0], [0, 1.5, 0.2]], float)
    nodes = np.concatenate([corners, corners * 0.9 + [0.1, 0.3, 2.5]])
    ring = [(0, 1), (1, 2), (2, 3), (3, 0)]
    members = ring + [(a + 4, b + 4) for a, b in ring] + [(a, a + 4) for a in range(4)] + [(0, 5)]
    return frame(nodes, members, radius)


def loading(n_nodes, held, *cases) -> TrussLoading:
    """Nodes held in all six ways (or: node -> tuple of ways), and cases {node: (force and moment)}."""
    fixed = np.zeros((n_nodes, 6), bool)
    for node in held:
        fixed[node, list(held[node]) if isinstance(held, dict) else slice(None)] = True
    forces = np.zeros((len(cases), n_nodes, 6))
    for number, case in enumerate(cases):
        for node, force in case.items():
            forces[number, node] = force
    return TrussLoading(fixed, forces, tuple(f"case {i}" for i in range(len(cases))), np.ones(len(cases)))
