"""Optimal ground structures: the least volume of pin-jointed bars between given nodes, by linear programming.

    minimise sum L a   subject to   A q_c = f_c,   |q_c| <= sigma a   for every load case c,

over the areas a and the forces q_c (Dorn, Gomory and Greenberg 1964). Bars between all pairs of nodes that see each
other inside the part are possible, but few are in the program at first: those whose virtual strains, summed over the
cases, sum_c |d' (u_c(b) - u_c(a))| exceed L / sigma in the dual solution u are added until none does (Gilbert and Tyas
2003, doi:10.1108/02644400310503017), and then the optimum is that over all bars. HiGHS solves the programs.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int
from scipy.optimize import linprog

from michell_cad.arrays import require
from michell_cad.curves import Curve, CurveKind
from michell_cad.errors import ConvergenceError
from michell_cad.linear_solver import free_memory
from michell_cad.strength.loads import TrussLoading, locate
from michell_cad.strength.pin_joints import equilibrium_matrix
from michell_cad.tet_mesh import TetMesh
from michell_cad.truss import Truss

BYTES_PER_PAIR = 250
"""Memory for a possible bar while pairs are made and looked at: numbers, coordinates of the places looked at."""

BYTES_PER_ENTRY = 400
"""Memory of HiGHS for a non-zero entry of its program; measured, with its factors."""

MEMORY_SHARE = 0.5
"""Of the free memory that a ground structure may take."""

LOOKED_AT = np.array([0.1, 0.3, 0.5, 0.7, 0.9])
"""Where along a bar it must be inside the part."""

INSIDE = -0.05
"""Least barycentric coordinate of a point that counts as inside."""

INFEASIBLE = 2
"""Status of SciPy's `linprog` for a program without a solution."""

UNSOLVED = 4
"""Status of `linprog` where a method runs into numerical difficulties."""

METHODS = ("highs", "highs-ipm")
"""The simplex method gives up on some programs of bars that are all alike; the interior point method then does not."""

FEASIBLE = 1e-4
"""Virtual strains may exceed the limit by this (relative): the volume is then within this of the optimum."""

THINNEST = 1e-3
"""Bars of less than this share of the largest area are rounding of the program and left out."""


@dataclass(frozen=True)
class GroundStructureOptions:
    """Options of `optimal_ground_structure`.

    Parameters
    ----------
    reach : bars up to this length (relative to the shortest distance between nodes) are in the first program.
    rounds : of adding bars, at most.
    """

    reach: float = 1.8
    rounds: int = 30


@dataclass(frozen=True, eq=False)
class GroundStructure:
    """An optimal pin-jointed truss.

    Parameters
    ----------
    truss : its bars, each a curve `brace`.
    areas : (n_m,) float, mm^2.
    volume : sum L a of the program, mm^3, also of the bars too thin to keep.
    """

    truss: Truss
    areas: Float[np.ndarray, " n_m"]
    volume: float


def optimal_ground_structure(
    nodes: Float[np.ndarray, "n_n 3"],
    loading: TrussLoading,
    strength: float,
    mesh: TetMesh | None = None,
    options: GroundStructureOptions = GroundStructureOptions(),
) -> GroundStructure:
    """The least volume of bars between nodes that carries all load cases at a stress, in tension and compression.

    Parameters
    ----------
    nodes : (n_n, 3) float, mm.
    loading : forces (moments do not count) and held displacements of these nodes.
    strength : sigma, MPa.
    mesh : part inside which bars must stay; default: anywhere.
    options : GroundStructureOptions

    Raises
    ------
    InvalidInputError
        If the strength is not positive, the bars between so many nodes would not fit in memory, or no truss between the
        nodes carries the loads.
    ConvergenceError
        If bars are still missing after all rounds.
    """
    require(np.isfinite(strength) and strength > 0, f"strength must be positive, in MPa, found {strength}")
    _require_memory(len(nodes), len(loading.names))
    pairs = _visible_pairs(nodes, mesh)
    d = nodes[pairs[:, 1]] - nodes[pairs[:, 0]]
    L = np.linalg.norm(d, axis=1)
    free = np.flatnonzero(~loading.held[:, :3].ravel())
    A = sp.csc_matrix(equilibrium_matrix(nodes, pairs)[free])
    f = loading.forces[:, :, :3].reshape(len(loading.names), -1)[:, free]
    chosen = L <= options.reach * L.min()
    for _ in range(options.rounds):
        found = _solve_program(A[:, chosen], L[chosen], f, strength)
        if found is None:
            # The bars of the first program alone may be a mechanism: all between the nodes are not, or none helps.
            require(
                not chosen.all(),
                "no pin-jointed truss between the nodes carries the loads: use more nodes, or hold more of them",
            )
            chosen |= L <= 2 * L[chosen].max()
            continue
        a, u, volume = found
        strain = np.abs(u @ A).sum(0) * strength / L
        missing = ~chosen & (strain > 1 + FEASIBLE)
        if not missing.any():
            break
        worst = max(int(chosen.sum()) // 2, 100)
        chosen[np.argsort(-np.where(missing, strain, 0), kind="stable")[: min(worst, int(missing.sum()))]] = True
    else:
        raise ConvergenceError(f"bars of the ground structure are still missing after {options.rounds} rounds")
    kept = a > THINNEST * a.max()
    return GroundStructure(_bars(nodes, pairs[chosen][kept], float(L.min())), a[kept], volume)


def _require_memory(n_n: int, n_c: int) -> None:
    pairs = n_n * (n_n - 1) // 2
    # Of the program a fifth of the pairs is in at the end, each with 6 + 4 entries for each case.
    need = pairs * BYTES_PER_PAIR + pairs // 5 * 10 * n_c * BYTES_PER_ENTRY
    require(
        need <= MEMORY_SHARE * free_memory(),
        f"a ground structure of {n_n} nodes has {pairs:,} possible bars and would take about {need / 1e9:.1f} GB for "
        f"{n_c} load cases, of {free_memory() / 1e9:.1f} GB free: use fewer cells or fewer load cases",
    )


def _visible_pairs(nodes: np.ndarray, mesh: TetMesh | None) -> Int[np.ndarray, "k 2"]:
    """Pairs of nodes between which a bar stays in the part."""
    i, j = np.triu_indices(len(nodes), k=1)
    if mesh is not None and len(i):
        x = nodes[i][:, None] + LOOKED_AT[:, None] * (nodes[j] - nodes[i])[:, None]
        inside = locate(mesh, x.reshape(-1, 3))[1].min(1).reshape(len(i), -1).min(1) > INSIDE
        i, j = i[inside], j[inside]
    return np.stack([i, j], axis=1)


def _solve_program(
    A: sp.csc_matrix, L: np.ndarray, f: np.ndarray, strength: float
) -> tuple[np.ndarray, np.ndarray, float] | None:
    """Areas, virtual displacements (n_c, n_free) and volume; None if nothing carries the loads.

    Variables: a, then q_c case by case, all near one.
    """
    (_, n), n_c = A.get_shape(), len(f)
    force, length = np.abs(f).max(), L.mean()
    one, zero = sp.identity(n), sp.csr_matrix((n, n))
    bounds = []
    for c in range(n_c):
        q = [one if k == c else zero for k in range(n_c)]
        bounds += [sp.hstack([-one, *q]), sp.hstack([-one, *(-block for block in q)])]
    equilibrium = sp.hstack([sp.csr_matrix((A.get_shape()[0] * n_c, n)), sp.block_diag([A] * n_c)])
    program = {
        "c": np.concatenate([L / length, np.zeros(n * n_c)]),
        "A_ub": sp.csr_matrix(sp.vstack(bounds)),
        "b_ub": np.zeros(2 * n * n_c),
        "A_eq": sp.csr_matrix(equilibrium),
        "b_eq": (f / force).ravel(),
        "bounds": [(0, None)] * n + [(None, None)] * (n * n_c),
    }
    for method in METHODS:
        found = linprog(**program, method=method)
        if found.status != UNSOLVED:
            break
    if found.status == INFEASIBLE:
        return None
    if found.status != 0:
        raise ConvergenceError(f"the program of the ground structure was not solved: {found.message.strip()}")
    u = found.eqlin.marginals.reshape(n_c, -1) * length / strength
    return found.x[:n] * force / strength, u, float(found.fun * force * length / strength)


def _bars(nodes: np.ndarray, pairs: np.ndarray, spacing: float) -> Truss:
    curves = tuple(
        Curve(CurveKind.INTERIOR, "brace", -1, (None, None, None), k, pair, np.array([k]), closed=False)
        for k, pair in enumerate(pairs)
    )
    return Truss(nodes, np.zeros(len(nodes), np.int64), pairs, curves, spacing)
