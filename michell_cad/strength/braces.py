"""Diagonals where a truss needs them: in cells whose shear its three families cannot carry by axial forces.

A lattice of three families without diagonals carries what is left of the stress, rho = sigma - P sigma with P the
projection on the span of b_i b_i' (see `metrics.uncarried_stress`), by bending only. A cell face is a quadrilateral of
four members; the diagonal with the direction e takes the part e' rho e of it. Braces are straight members of a family
of their own, `brace`, each a curve with a label of its own.
"""

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float, Int

from michell_cad.arrays import require
from michell_cad.curves import Curve, CurveKind
from michell_cad.deviator import deviator
from michell_cad.metrics import project_on_bars
from michell_cad.strength.loads import locate
from michell_cad.tet_mesh import TetMesh
from michell_cad.truss import Truss

SHEAR_LIMIT = 0.12
"""Shear relative to the rms of |dev sigma| over the part, above which a lattice without diagonals loses to a braced
grid of equal volume: its members bend, with a penalty that grows like shear^2 (length / radius)^2."""

SMALLEST_ANGLE = np.deg2rad(20.0)
"""Braces that would enclose less with a member of their face are left out: their tubes overlap far along, radians."""

INSIDE = -0.05
"""Least barycentric coordinate of a point that counts as inside the part: chords of curved faces leave it a little."""


def cell_faces(truss: Truss) -> Int[np.ndarray, "n_q 4"]:
    """Quadrilaterals of four members, as rings of nodes a, b, c, d; each once, and none with a member as diagonal.

    Opposite corners a and c are pairs of nodes with exactly two common neighbours, from the square of the adjacency.
    """
    n_n = len(truss.nodes)
    brace = np.array([curve.family == "brace" for curve in truss.curves])[truss.curve_of_member]
    i, j = truss.members[~brace].T
    A = sp.csr_matrix((np.ones(2 * len(i)), (np.r_[i, j], np.r_[j, i])), shape=(n_n, n_n))
    number = np.arange(n_n, dtype=float)
    two_steps = sp.csr_matrix(A @ A)
    pairs = sp.triu(two_steps, k=1).tocoo()
    twice = pairs.data == 2
    a, c = pairs.row[twice], pairs.col[twice]
    if not len(a):
        return np.zeros((0, 4), np.int64)
    # Two numbers from their sum and the sum of their squares.
    total, squares = (np.asarray(sp.csr_matrix(A @ sp.diags(w) @ A)[a, c]).ravel() for w in (number, number**2))
    gap = np.sqrt(2 * squares - total**2)
    b, d = np.rint((total - gap) / 2).astype(int), np.rint((total + gap) / 2).astype(int)
    mutual = np.asarray(two_steps[b, d]).ravel() == 2
    ring = np.stack([a, b, c, d], axis=1)[mutual & (a < b)]
    joined = truss.members @ [n_n, 1]
    crossed = [np.isin(np.sort(ring[:, pair], axis=1) @ [n_n, 1], joined) for pair in ([0, 2], [1, 3])]
    return ring[~(crossed[0] | crossed[1])]


def choose_braces(
    truss: Truss,
    mesh: TetMesh,
    stress: Float[np.ndarray, "n_t 3 3"],
    directions: Float[np.ndarray, "n_t 3 3"],
    limit: float = SHEAR_LIMIT,
) -> Int[np.ndarray, "n_b 2"]:
    """Pairs of nodes to join: in every face whose uncarried shear exceeds the limit, by the diagonal that takes more.

    Parameters
    ----------
    truss, mesh, stress : the truss, and the stress of its part, MPa.
    directions : (n_t, 3, 3), of the three families in each tet (columns).
    limit : of 2^(1/2) |e' rho e| over the rms of |dev sigma|; for pure shear in the face that is the shear's share.
    """
    require(limit >= 0, f"limit must not be negative, found {limit}")
    ring = cell_faces(truss)
    if not len(ring):
        return np.zeros((0, 2), np.int64)
    X = truss.nodes[ring]
    tets, inside = locate(mesh, X.mean(1))
    rho = stress[tets] - project_on_bars(stress[tets], directions[tets])
    dev = (deviator(stress) ** 2).sum((1, 2))
    scale = np.sqrt(mesh.volumes @ dev / mesh.volumes.sum())
    e = np.stack([X[:, 2] - X[:, 0], X[:, 3] - X[:, 1]], axis=1)
    e /= np.linalg.norm(e, axis=2, keepdims=True)
    taken = np.sqrt(2) * np.abs(np.einsum("qkd,qde,qke->qk", e, rho, e))
    fits = _room_for_diagonals(X) & (inside.min(1) > INSIDE)[:, None]
    taken = np.where(fits, taken, 0)
    best = taken.argmax(1)
    chosen = taken.max(1) > limit * scale
    ends = np.where(best[:, None] == 0, ring[:, [0, 2]], ring[:, [1, 3]])[chosen]
    return np.unique(np.sort(ends, axis=1), axis=0)


def add_braces(truss: Truss, pairs: Int[np.ndarray, "n_b 2"]) -> Truss:
    """The truss with a straight member between each pair of nodes, behind the others; each is a curve `brace`."""
    pairs = np.sort(pairs, axis=1)
    n_m = len(truss.members)
    first = sum(curve.family == "brace" for curve in truss.curves)
    curves = tuple(
        Curve(CurveKind.INTERIOR, "brace", -1, (None, None, None), first + k, pair, np.array([n_m + k]), closed=False)
        for k, pair in enumerate(pairs)
    )
    offsets = np.asarray(truss.waypoint_offsets)
    return replace(
        truss,
        members=np.concatenate([truss.members, pairs]),
        curves=(*truss.curves, *curves),
        waypoint_offsets=np.concatenate([offsets, np.full(len(pairs), offsets[-1])]),
    )


def alternating_diagonals(truss: Truss, mesh: TetMesh, levels: Float[np.ndarray, "n_v 3"]) -> Int[np.ndarray, "n_b 2"]:
    """One diagonal of every cell face, which joins even nodes: in neighbouring faces it runs the other way.

    Parameters
    ----------
    truss, mesh : the truss, and its part.
    levels : coordinates of the vertices in cells; even is a node where the sum of the three, rounded, is.
    """
    ring = cell_faces(truss)
    tets, barycentric = locate(mesh, truss.nodes)
    even = np.rint(np.einsum("na,nai->ni", barycentric, levels[mesh.tets[tets]])).sum(1) % 2 == 0
    chosen = np.where(even[ring[:, :1]], ring[:, [0, 2]], ring[:, [1, 3]])
    return np.unique(np.sort(chosen, axis=1), axis=0)


def _room_for_diagonals(X: Float[np.ndarray, "n_q 4 3"]) -> Bool[np.ndarray, "n_q 2"]:
    """Whether a-c and b-d enclose at least `SMALLEST_ANGLE` with the sides of the ring."""
    room = np.ones((len(X), 2), bool)
    for k in range(4):
        sides = np.stack([X[:, (k + 1) % 4] - X[:, k], X[:, (k - 1) % 4] - X[:, k]], axis=1)
        diagonal = X[:, (k + 2) % 4] - X[:, k]
        cosine = np.einsum("qsd,qd->qs", sides, diagonal)
        cosine /= np.linalg.norm(sides, axis=2) * np.linalg.norm(diagonal, axis=1)[:, None]
        room[:, k % 2] &= cosine.max(1) < np.cos(SMALLEST_ANGLE)
    return room
