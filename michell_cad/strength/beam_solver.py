"""Displacements of a frame of beams: stiffness by exact integration of the flexibility, and one sparse solve.

Linear Timoshenko beams with rigid joints, 6 degrees of freedom (displacement, rotation) at each node, in global axes.
A beam between nodes a and b is a cantilever held at a: the force P and moment M on its end b make the force P and the
moment M + r x P on the section at distance r from b, whatever its shape. Hence (virtual forces) its flexibility at b is

    F = integral of H' [A 0; 0 B] H ds,   H = [I 0; [r]_x I],
    A = t t'/(E A) + (I - t t')/(kappa G A),   B = t t'/(G J) + (I - t t')/(E I),

and its stiffness G' F^-1 G, where G takes the displacements of both ends to those of b relative to a rigid motion with
a (Spillers, Introduction to Structures, 2003, Chapter 6). So one element is exact for any taper and any curve, up to
the quadrature. The curvature of a curved beam changes its path, not its section's stiffness (r much less than the
radius of curvature).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float, Int

from michell_cad.arrays import require
from michell_cad.compiled import compiled
from michell_cad.linear_solver import Factor, factorise
from michell_cad.strength.beam_model import BeamModel
from michell_cad.strength.beam_solution import BeamSolution
from michell_cad.strength.loads import TrussLoading
from michell_cad.strength.mechanism import require_no_loose_part


@dataclass(frozen=True, eq=False)
class BeamSystem:
    """The factorised stiffness of a beam model, for as many loads as one likes.

    Parameters
    ----------
    model : BeamModel
    flexibility : (n_e, 6, 6), F.
    end_force : (n_e, 6, 12), F^-1 G: force and moment on the second end of every element, from its displacements.
    free : numbers of the degrees of freedom that can move.
    stiffness, factor : of these.
    """

    model: BeamModel
    flexibility: Float[np.ndarray, "n_e 6 6"]
    end_force: Float[np.ndarray, "n_e 6 12"]
    free: Int[np.ndarray, " n_f"]
    stiffness: sp.csr_matrix
    factor: Factor

    def displacements(self, forces: Float[np.ndarray, "n_c n_n 6"]) -> Float[np.ndarray, "n_c n_n 6"]:
        """Displacements and rotations of the nodes under some cases of forces and moments on them."""
        right = np.ascontiguousarray(forces.reshape(len(forces), -1)[:, self.free].T)
        x = self.factor.solve(right)
        # Frames are ill-conditioned, (length / radius)^2 and more: one step of refinement returns the digits lost.
        x = x + self.factor.solve(np.ascontiguousarray(right - self.stiffness @ x))
        u = np.zeros((len(forces), 6 * len(self.model.nodes)))
        u[:, self.free] = x.T
        return u.reshape(forces.shape)

    def of_elements(self, displacements: Float[np.ndarray, "n_c n_n 6"]) -> Float[np.ndarray, "n_c n_e 12"]:
        """Displacements of the two ends of every element."""
        return displacements[:, self.model.elements].reshape(len(displacements), -1, 12)


def factorise_beams(model: BeamModel, held: Bool[np.ndarray, "n_t 6"]) -> BeamSystem:
    """Assemble and factorise the stiffness of a beam model whose truss has these displacements held."""
    n_n = len(model.nodes)
    can = np.zeros((n_n, 6), bool)
    can[model.elements] = True
    can[: len(held)] &= ~held
    free = np.flatnonzero(can.ravel())
    G = end_displacements(model)
    F = element_flexibility(model)
    end_force = np.linalg.solve(F, G)
    K = assemble(model, G.swapaxes(1, 2) @ end_force)[free][:, free]
    return BeamSystem(model, F, end_force, free, K, factorise(K))


def solve_beams(model: BeamModel, loading: TrussLoading) -> BeamSolution:
    """Solve K u = f for every load case.

    Raises
    ------
    InvalidInputError
        If the loading is of another truss, a load acts on a node without members, or a part of the truss is loose.
    """
    require_solvable(model, loading)
    return solve_system(factorise_beams(model, loading.held), loading)


def solve_system(system: BeamSystem, loading: TrussLoading) -> BeamSolution:
    """The solution of a factorised system for every load case."""
    model = system.model
    f = np.zeros((len(loading.forces), len(model.nodes), 6))
    f[:, : len(model.truss.nodes)] = loading.forces
    u = system.displacements(f)
    second = np.einsum("eij,cej->cei", system.end_force, system.of_elements(u))
    # In balance: the first end carries the opposite force, and the moment of the second end's force about it.
    a, b = model.nodes[model.elements].transpose(1, 0, 2)
    first = -second
    first[..., 3:] -= np.cross(b - a, second[..., :3])
    return BeamSolution(model, u, np.stack([first, second], axis=2), np.einsum("cnd,cnd->c", f, u))


def require_solvable(model: BeamModel, loading: TrussLoading) -> None:
    """Refuse a loading of another truss, loads on nodes without members, and loose parts."""
    n_t = len(model.truss.nodes)
    require(
        loading.held.shape == (n_t, 6),
        f"the loading is for {len(loading.held)} nodes, the truss has {n_t}: carry the loads over to this truss",
    )
    used = np.zeros(n_t, bool)
    used[model.truss.members] = True
    lost = (loading.forces != 0).any((0, 2)) & ~used
    require(not lost.any(), f"a load acts on {lost.sum()} nodes without members, first node {np.argmax(lost)}")
    require_no_loose_part(model.truss, loading.held)


def end_displacements(model: BeamModel) -> Float[np.ndarray, "n_e 6 12"]:
    """G: displacement and rotation of the second end relative to a rigid motion with the first, from both ends'."""
    a, b = model.nodes[model.elements].transpose(1, 0, 2)
    G = np.zeros((len(a), 6, 12))
    G[:, range(6), range(6)] = -1
    G[:, range(6), range(6, 12)] = 1
    G[:, :3, 3:6] = cross_matrix(b - a)
    return G


def element_flexibility(model: BeamModel) -> Float[np.ndarray, "n_e 6 6"]:
    """F: displacement and rotation of the second end for unit forces and moments on it, the first end held."""
    E, nu = model.material.youngs_modulus, model.material.poisson_ratio
    G = E / (2 * (1 + nu))
    F = np.zeros((len(model.elements), 6, 6))
    second = model.nodes[model.elements[:, 1]]
    add_flexibility(second, model.points, model.tangents, model.radii, model.weights, E, G, model.shear_coefficient, F)
    return F


def element_stiffness(model: BeamModel) -> Float[np.ndarray, "n_e 12 12"]:
    """G' F^-1 G in global axes; degrees of freedom: displacement and rotation of the first node, then of the second."""
    G = end_displacements(model)
    return G.swapaxes(1, 2) @ np.linalg.solve(element_flexibility(model), G)


def assemble(model: BeamModel, stiffness: Float[np.ndarray, "n_e 12 12"]) -> sp.csr_matrix:
    """Sum the element matrices; degree of freedom d of node n has the number 6 n + d."""
    n_n = len(model.nodes)
    rows = np.repeat(model.elements, 2, axis=1).ravel()
    columns = np.tile(model.elements, 2).ravel()
    blocks = stiffness.reshape(-1, 2, 6, 2, 6).transpose(0, 1, 3, 2, 4).reshape(-1, 36)
    keys, place = np.unique(rows * n_n + columns, return_inverse=True)
    summed = sp.csr_matrix((np.ones(len(place)), (place, np.arange(len(place)))), (len(keys), len(place))) @ blocks
    starts = np.searchsorted(keys, np.arange(n_n + 1) * n_n)
    return sp.csr_matrix(sp.bsr_matrix((summed.reshape(-1, 6, 6), keys % n_n, starts), shape=(6 * n_n, 6 * n_n)))


def cross_matrix(r: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3 3"]:
    """[r]_x, the matrix of the cross product: [r]_x v = r x v."""
    x, y, z = np.moveaxis(r, -1, 0)
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*x.shape, 3, 3)


def _add_flexibility(
    second: Any, points: Any, tangents: Any, radii: Any, weights: Any, E: float, G: float, kappa: float, F: Any
) -> None:
    """Add the integrals of H' [A 0; 0 B] H; column j of [r]_x is r x e_j."""
    lever, turned = np.zeros((3, 3)), np.zeros((3, 3))
    for e in range(len(F)):
        for k in range(radii.shape[1]):
            t, w = tangents[e, k], weights[e, k]
            x, y, z = second[e] - points[e, k]
            lever[0, 1], lever[0, 2], lever[1, 0], lever[1, 2], lever[2, 0], lever[2, 1] = -z, y, z, -x, -y, x
            area = np.pi * radii[e, k] ** 2
            inertia = area * radii[e, k] ** 2 / 4
            along, across = w / (E * area), w / (kappa * G * area)
            twist, bend = w / (2 * G * inertia), w / (E * inertia)
            for j in range(3):
                dot = t[0] * lever[0, j] + t[1] * lever[1, j] + t[2] * lever[2, j]
                for i in range(3):
                    turned[i, j] = (twist - bend) * t[i] * dot + bend * lever[i, j]
            for i in range(3):
                for j in range(3):
                    both = lever[0, i] * turned[0, j] + lever[1, i] * turned[1, j] + lever[2, i] * turned[2, j]
                    same = 1.0 if i == j else 0.0
                    F[e, i, j] += (along - across) * t[i] * t[j] + across * same + both
                    F[e, 3 + i, j] += turned[i, j]
                    F[e, j, 3 + i] += turned[i, j]
                    F[e, 3 + i, 3 + j] += (twist - bend) * t[i] * t[j] + bend * same


add_flexibility = compiled(_add_flexibility)
