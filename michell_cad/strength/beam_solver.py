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

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float

from michell_cad.arrays import require
from michell_cad.linear_solver import factorise
from michell_cad.strength.beam_model import BeamModel
from michell_cad.strength.beam_solution import BeamSolution
from michell_cad.strength.loads import TrussLoading
from michell_cad.strength.mechanism import require_no_loose_part


def solve_beams(model: BeamModel, loading: TrussLoading) -> BeamSolution:
    """Solve K u = f for every load case.

    Raises
    ------
    InvalidInputError
        If the loading is of another truss, a load acts on a node without members, or a part of the truss is loose.
    """
    n_n, n_t = len(model.nodes), len(model.truss.nodes)
    require(
        loading.held.shape == (n_t, 6),
        f"the loading is for {len(loading.held)} nodes, the truss has {n_t}: carry the loads over to this truss",
    )
    used = np.zeros(n_n, bool)
    used[model.elements] = True
    lost = (loading.forces != 0).any((0, 2)) & ~used[:n_t]
    require(not lost.any(), f"a load acts on {lost.sum()} nodes without members, first node {np.argmax(lost)}")
    held = np.zeros((n_n, 6), bool)
    held[:n_t] = loading.held
    require_no_loose_part(model.truss, loading.held)

    free = np.flatnonzero((used[:, None] & ~held).ravel())
    f = np.zeros((len(loading.forces), n_n, 6))
    f[:, :n_t] = loading.forces
    stiffness = element_stiffness(model)
    K = assemble(model, stiffness)[free][:, free]
    right = f.reshape(len(f), -1)[:, free].T
    factor = factorise(K)
    x = factor.solve(np.ascontiguousarray(right))
    # Frames are ill-conditioned, (length / radius)^2 and more: one step of refinement returns the digits lost.
    x = x + factor.solve(np.ascontiguousarray(right - K @ x))
    u = np.zeros((len(f), n_n * 6))
    u[:, free] = x.T
    u = u.reshape(f.shape)
    ends = np.einsum("eij,cej->cei", stiffness, u[:, model.elements].reshape(len(f), -1, 12))
    return BeamSolution(model, u, ends.reshape(len(f), -1, 2, 6), np.einsum("cnd,cnd->c", f, u))


def element_flexibility(model: BeamModel) -> Float[np.ndarray, "n_e 6 6"]:
    """F: displacement and rotation of the second end for unit forces and moments on it, the first end held."""
    E, nu = model.material.youngs_modulus, model.material.poisson_ratio
    G = E / (2 * (1 + nu))
    area = np.pi * model.radii**2
    second_moment = area * model.radii**2 / 4
    A = _along_and_across(
        model.tangents, model.weights / (E * area), model.weights / (model.shear_coefficient * G * area)
    )
    B = _along_and_across(model.tangents, model.weights / (2 * G * second_moment), model.weights / (E * second_moment))
    arm = cross_matrix(model.nodes[model.elements[:, 1], None] - model.points)
    BS = B @ arm
    F = np.empty((len(model.elements), 6, 6))
    F[:, :3, :3] = (A + arm.swapaxes(-1, -2) @ BS).sum(1)
    F[:, 3:, :3] = BS.sum(1)
    F[:, :3, 3:] = F[:, 3:, :3].swapaxes(-1, -2)
    F[:, 3:, 3:] = B.sum(1)
    return F


def element_stiffness(model: BeamModel) -> Float[np.ndarray, "n_e 12 12"]:
    """G' F^-1 G in global axes; degrees of freedom: displacement and rotation of the first node, then of the second."""
    a, b = model.nodes[model.elements].transpose(1, 0, 2)
    G = np.zeros((len(a), 6, 12))
    G[:, range(6), range(6)] = -1
    G[:, range(6), range(6, 12)] = 1
    G[:, :3, 3:6] = cross_matrix(b - a)
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


def _along_and_across(t: np.ndarray, along: np.ndarray, across: np.ndarray) -> np.ndarray:
    """along t t' + across (I - t t')."""
    return (along - across)[..., None, None] * (t[..., :, None] * t[..., None, :]) + across[..., None, None] * np.eye(3)
