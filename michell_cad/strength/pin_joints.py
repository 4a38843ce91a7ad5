"""How much of the loads a truss could carry with pins for joints: by axial forces alone, without bending.

The equilibrium matrix A (free components of the nodes by members) takes the axial forces q to the forces that they hold
up; a pin-jointed truss carries f exactly where A q = f has a solution. The ridge solution

    q = A' (A A' + e)^-1 f,   f - A q = e (A A' + e)^-1 f,

comes from one sparse factorisation, and e bounds the forces: what could be carried only by forces more than e^-1/2
times the loads counts as not carried.
"""

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int

from michell_cad.linear_solver import factorise
from michell_cad.strength.loads import TrussLoading
from michell_cad.truss import Truss

RIDGE = 1e-6
"""e above, relative (the columns of A have the length of two unit vectors): forces up to a thousand times the loads."""


def equilibrium_matrix(nodes: Float[np.ndarray, "n_n 3"], members: Int[np.ndarray, "n_m 2"]) -> sp.csr_matrix:
    """A: (3 n_n, n_m), the loads on the nodes that unit tensions of the members hold up, along the chords.

    Positive q pulls the two nodes of a member together, so that column m holds -d on its first and +d on its second
    node, with d the unit vector from first to second: the loads that pull the nodes apart.
    """
    a, b = nodes[members].transpose(1, 0, 2)
    d = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
    rows = 3 * members[:, :, None] + np.arange(3)
    columns = np.broadcast_to(np.arange(len(d))[:, None, None], rows.shape)
    values = np.stack([-d, d], axis=1)
    shape = (3 * len(nodes), len(d))
    return sp.csr_matrix(sp.coo_matrix((values.ravel(), (rows.ravel(), columns.ravel())), shape=shape))


def pin_joint_residual(truss: Truss, loading: TrussLoading) -> Float[np.ndarray, " n_c"]:
    """|f - A q| / |f| for every load case, f the forces (without moments) on what is free to move; 0: a pure truss."""
    used = np.zeros(len(truss.nodes), bool)
    used[truss.members] = True
    free = np.flatnonzero((~loading.held[:, :3] & used[:, None]).ravel())
    A = equilibrium_matrix(truss.nodes, truss.members)[free]
    f = loading.forces[:, :, :3].reshape(len(loading.names), -1)[:, free].T
    normal = sp.csr_matrix(A @ A.T + RIDGE * sp.identity(len(free)))
    left = RIDGE * factorise(normal).solve(np.ascontiguousarray(f))
    size = np.linalg.norm(f, axis=0)
    return np.divide(np.linalg.norm(left, axis=0), size, out=np.zeros_like(size), where=size > 0)
