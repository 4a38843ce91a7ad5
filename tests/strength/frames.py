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


def tower(storeys=3) -> SizedTruss:
    """A twisted, leaning tower of triangles with one diagonal on each side, radii that differ from bar to bar."""
    turn = 2 * np.pi * np.arange(3) / 3
    nodes, members = [], []
    for k in range(storeys + 1):
        nodes += [[np.cos(a + 0.2 * k) + 0.1 * k, np.sin(a + 0.2 * k), 1.2 * k] for a in turn]
    for k in range(storeys):
        low, high = 3 * k, 3 * k + 3
        for i in range(3):
            members += [(low + i, high + i), (low + i, high + (i + 1) % 3), (high + i, high + (i + 1) % 3)]
    sized = frame(nodes, members, 0.05)
    return SizedTruss(sized.truss, sized.radii * (1 + np.arange(len(members)) % 3)[:, None])


def in_proportion(members, ratios):
    """Balls of fixed ratios to the largest radius at their nodes, as sizing asks for them."""

    def balls(radii):
        widest, count = np.zeros(len(ratios)), np.zeros(len(ratios))
        np.maximum.at(widest, members, radii)
        leads = radii >= widest[members]
        np.add.at(count, members, leads)
        return ratios * widest, leads / count[members]

    return balls


def box_grid(cells=(3, 2, 2)) -> SizedTruss:
    """A regular grid of unit cells with a diagonal across the cells of one face."""
    number = np.arange(np.prod(np.array(cells) + 1)).reshape(np.array(cells) + 1)
    nodes = np.argwhere(number >= 0).astype(float)
    members = [
        pair
        for axis in range(3)
        for pair in zip(
            number.take(range(cells[axis]), axis).ravel(),
            number.take(range(1, cells[axis] + 1), axis).ravel(),
            strict=True,
        )
    ]
    members += list(zip(number[:-1, 0, :-1].ravel(), number[1:, 0, 1:].ravel(), strict=True))
    return frame(nodes, members, 0.04)


THREE_FRAMES = {
    "cube": (cube_frame(0.2), loading(8, range(4), {6: (100.0, 0, -70.0, 0, 15.0, 0)})),
    "tower": (tower(), loading(12, range(3), {10: (3.0, -2.0, -9.0, 0, 0, 0), 11: (0, 5.0, 0, 0, 0, 1.0)})),
    "grid": (box_grid(), loading(36, range(9), {35: (0, 2.0, -5.0, 0, 0, 0)}, {31: (0, 0, 0, 0, 3.0, 0)})),
}
"""Frames with loads for the comparisons with independent programs."""
