"""Linear buckling of a whole frame: the least factors of the loads at which it has another equilibrium.

(K + lambda K_G) v = 0 with the elastic stiffness K and the geometric stiffness K_G of the axial forces of the linear
solution (Przemieniecki, Theory of Matrix Structural Analysis, 1968, Section 15.2): for a beam of length L under the
tension N, cubic shape functions, across each of its two axes

    N / (30 L) [36, 3 L, -36, 3 L; 3 L, 4 L^2, -3 L, -L^2; -36, -3 L, 36, -3 L; 3 L, -L^2, -3 L, 4 L^2].

Largest eigenvalues mu = 1 / lambda of -K_G v = mu K v by Lanczos' method in the product of K, whose sparse factor is
the one that the displacements come from (Ericsson and Ruhe 1980, doi:10.1090/S0025-5718-1980-0583502-2, at the shift
zero of K). Members that bow between their nodes need elements of their own: `pieces` of the beam model.
"""

from typing import Any

import numpy as np
import scipy.sparse.linalg as spla
from jaxtyping import Float

from michell_cad.arrays import require
from michell_cad.errors import ConvergenceError
from michell_cad.linear_solver import factorise
from michell_cad.strength.beam_solution import BeamSolution
from michell_cad.strength.beam_solver import assemble, element_stiffness
from michell_cad.strength.loads import TrussLoading

SMALLEST_INVERSE = 1e-9
"""Values of mu below this (relative to the largest |mu|) are rounding: nothing in the frame is in compression."""


def frame_buckling(
    solution: BeamSolution, loading: TrussLoading, case: int = 0, count: int = 1
) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, "k n_n 6"]]:
    """Least positive buckling factors of one load case, ascending, and their modes.

    Parameters
    ----------
    solution, loading : the linear solution and what it was solved for.
    case : number of the load case.
    count : of factors wanted; fewer return where fewer are positive.

    Returns
    -------
    factors : (k,) float. Empty if no factor of the loads makes the frame buckle.
    modes : (k, n_n, 6) float, displacements and rotations of the nodes; largest displacement 1, first such positive.

    Raises
    ------
    ConvergenceError
        If Lanczos' method does not converge.
    """
    model = solution.model
    free = free_components(solution, loading)
    require(1 <= count < len(free) - 1, f"count must lie between 1 and {len(free) - 2}, found {count}")
    K = assemble(model, element_stiffness(model))[free][:, free]
    load = assemble(model, -geometric_stiffness(solution, case))[free][:, free]
    operator: Any = spla.LinearOperator  # its stubs know the class, not the call that makes one from a function
    inverse = operator(K.shape, matvec=factorise(K).solve, dtype=float)
    # A start that no symmetry of the frame is orthogonal to, and the same in every run.
    start = np.sin(1.0 + np.arange(len(free)))
    try:
        mu, v = spla.eigsh(load, k=count, M=K, Minv=inverse, which="LA", v0=start)
    except spla.ArpackNoConvergence as error:
        raise ConvergenceError(f"the buckling factors of the frame did not converge: {error}") from error
    scale = spla.norm(load) / spla.norm(K)
    order = [k for k in np.argsort(-mu) if mu[k] > SMALLEST_INVERSE * scale]
    modes = np.zeros((len(order), 6 * len(model.nodes)))
    modes[:, free] = v[:, order].T
    modes = modes.reshape(-1, len(model.nodes), 6)
    for mode in modes:
        mode /= mode[:, :3].ravel()[np.abs(mode[:, :3]).argmax()]
    return 1 / mu[order], modes


def free_components(solution: BeamSolution, loading: TrussLoading) -> np.ndarray:
    """Numbers 6 n + d of the components that can move."""
    model = solution.model
    can = np.zeros((len(model.nodes), 6), bool)
    can[model.elements] = True
    can[: len(loading.held)] &= ~loading.held
    return np.flatnonzero(can.ravel())


def geometric_stiffness(solution: BeamSolution, case: int = 0) -> Float[np.ndarray, "n_e 12 12"]:
    """K_G of every element in global axes, of the mean axial force along its chord."""
    model = solution.model
    L = np.linalg.norm(np.diff(model.nodes[model.elements], axis=1)[:, 0], axis=1)
    axes = solution.local_axes
    N = np.einsum("ed,ed->e", solution.end_forces[case, :, 1, :3], axes[:, 0])
    local = np.zeros((len(L), 12, 12))
    # Across y the rotation about z is v', across z the rotation about y is -w'.
    for across, about, sign in ((1, 5, 1.0), (2, 4, -1.0)):
        places = np.array([across, about, across + 6, about + 6])
        t = sign * L
        block = np.array(
            [
                [36 + 0 * L, 3 * t, -36 + 0 * L, 3 * t],
                [3 * t, 4 * L**2, -3 * t, -(L**2)],
                [-36 + 0 * L, -3 * t, 36 + 0 * L, -3 * t],
                [3 * t, -(L**2), -3 * t, 4 * L**2],
            ]
        )
        local[:, places[:, None], places] = (N / (30 * L) * block).transpose(2, 0, 1)
    turn = np.zeros((len(L), 12, 12))
    for k in range(0, 12, 3):
        turn[:, k : k + 3, k : k + 3] = axes
    return turn.swapaxes(1, 2) @ local @ turn
