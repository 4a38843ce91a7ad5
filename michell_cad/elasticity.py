"""Linear elasticity on tets, and the continuous stress field that all later stages follow.

Arora et al. 2019, Section 4.1 (doi:10.1145/3328939.3328999): constant-strain tets, one Cauchy stress per tet, smoothed
by the iteration of Loubignac, Cantin and Touzot 1977 (doi:10.2514/3.60793).

Departures:

1. Loubignac's iteration u <- u + K^-1 (f - A u), A the stiffness that acts through the averaged stress, is a Richardson
   iteration for A u = f preconditioned by K. A is symmetric (averaging commutes with a uniform material), so the same
   system is solved by conjugate gradients on the same factor of K, which needs a tenth of the steps.
2. The stop is relative (the reference's is absolute, so its result depends on the unit of length). A need not be
   regular: averaging hides modes that change sign from tet to tet. The stop is what keeps them out, so a cap on the
   steps is part of the method and no failure.
3. Nodal averages are weighted by volume; unweighted ones turn the directions by 6-10 degrees on coarse meshes.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float

from michell_cad.arrays import freeze, require
from michell_cad.elastic_elements import add_averaged_force, add_stiffness
from michell_cad.linear_solver import Factor, measure_factorisation
from michell_cad.problem import DesignProblem, Material
from michell_cad.rigid_motions import rigid_motions
from michell_cad.tet_mesh import TetMesh


@dataclass(frozen=True)
class ElasticityOptions:
    """Options of `solve_elasticity`.

    Parameters
    ----------
    smoothing_tolerance : relative. Loubignac smoothing stops when the residual of A u = f, in the norm of K^-1, has
        fallen to this fraction of the load's. 1e-2 keeps the principal directions within about a degree of a run to
        1e-4 on the paper's problems, at a fraction of the steps.
    smoothing_steps : largest number of steps.
    """

    smoothing_tolerance: float = 1e-2
    smoothing_steps: int = 40

    def __post_init__(self) -> None:
        require(0 < self.smoothing_tolerance < 1, "smoothing_tolerance must lie between 0 and 1")
        require(self.smoothing_steps >= 0, "smoothing_steps must not be negative")


@dataclass(frozen=True, eq=False)
class StressField:
    """The stress of a design and the displacements that belong to its load cases.

    Parameters
    ----------
    stress : (n_t, 3, 3) float, MPa, tension positive: the combined smoothed stress at the centroid of each tet.
    displacements : (n_c, n_v, 3) float, mm: for each load case, of the plain (unsmoothed) finite-element solution.
    smoothing_steps : steps that the smoothing took, per load case.
    smoothing_residuals : the relative residuals at which it stopped.
    solver_unit : CPU seconds of one factorisation and one solve of the stiffness matrix.
    """

    stress: Float[np.ndarray, "n_t 3 3"]
    displacements: Float[np.ndarray, "n_c n_v 3"]
    smoothing_steps: tuple[int, ...]
    smoothing_residuals: tuple[float, ...]
    solver_unit: float

    def __post_init__(self) -> None:
        freeze(self, stress=np.float64, displacements=np.float64)
        require(np.isfinite(self.stress).all(), "the stress is not finite; the mesh or the material is degenerate")


def solve_elasticity(
    problem: DesignProblem,
    options: ElasticityOptions | None = None,
    progress: Callable[[float], None] = lambda fraction: None,
) -> StressField:
    """Solve -div sigma(u) = f for each load case, smooth the stresses and combine them.

    sigma = lambda tr(eps) I + 2 mu eps with eps the symmetric gradient of u; u = 0 at held components; P1 tets.

    Parameters
    ----------
    problem : DesignProblem
    options : ElasticityOptions
    progress : called with the finished fraction of the work.

    Returns
    -------
    StressField

    Raises
    ------
    ConvergenceError
        If the stiffness matrix is not positive definite to working precision.
    """
    options = options or ElasticityOptions()
    mesh = problem.mesh
    free = np.flatnonzero(~problem.fixed.ravel())
    K = stiffness_matrix(mesh, problem.material)[free][:, free]
    loads = [case.force.ravel()[free] for case in problem.load_cases]
    modes = rigid_motions((mesh.vertices - mesh.vertices.mean(0)) / mesh.size).reshape(-1, 6)[free]
    factor, u, solver_unit = measure_factorisation(K, loads[0], modes)

    stresses, displacements, steps, residuals = [], [], [], []
    for number, f in enumerate(loads):
        u = factor.solve(f) if number else u
        displacements.append(_expand(u, free, problem.fixed.shape))
        u, count, residual = _smooth(problem, factor, free, f, u, options)
        sigma = cauchy_stress(mesh, problem.material, _expand(u, free, problem.fixed.shape))
        stresses.append(_average(mesh, sigma))
        steps.append(count)
        residuals.append(residual)
        progress((number + 1) / len(loads))
    combined = _combine(problem, stresses)
    return StressField(combined, np.array(displacements), tuple(steps), tuple(residuals), solver_unit)


def stiffness_matrix(mesh: TetMesh, material: Material) -> sp.csr_matrix:
    """The P1 stiffness matrix K, (3 n_v, 3 n_v), N/mm; component 3 v + d belongs to axis d of vertex v.

    K_ab = volume (lambda g_a g_b' + mu g_b g_a' + mu (g_a . g_b) I) with the gradients g of the barycentric
    coordinates.
    """
    lmbda, mu = lame_parameters(material)
    indptr, indices, entry = mesh.stencil
    blocks = np.zeros((len(indices), 3, 3))
    add_stiffness(entry, mesh.hat_gradients, mesh.volumes, lmbda, mu, blocks)
    return sp.csr_matrix(sp.bsr_matrix((blocks, indices.copy(), indptr.copy()), shape=(3 * len(mesh.vertices),) * 2))


def cauchy_stress(
    mesh: TetMesh, material: Material, displacement: Float[np.ndarray, "n_v 3"]
) -> Float[np.ndarray, "n_t 3 3"]:
    """sigma = lambda tr(eps) I + 2 mu eps in each tet, MPa, from the displacement in mm."""
    lmbda, mu = lame_parameters(material)
    H = mesh.gradients(displacement)
    sigma = mu * (H + H.swapaxes(1, 2))
    pressure = lmbda * np.einsum("tii->t", H)
    for i in range(3):
        sigma[:, i, i] += pressure
    return sigma


def internal_force(mesh: TetMesh, stress: Float[np.ndarray, "n_t 3 3"]) -> Float[np.ndarray, "n_v 3"]:
    """Nodal forces in equilibrium with a stress that is constant in each tet: sum of volume * sigma g_a, N."""
    return (mesh.gradient_operator.T @ (mesh.volumes[:, None, None] * stress).reshape(-1, 3)).reshape(-1, 3)


def lame_parameters(material: Material) -> tuple[float, float]:
    """Lame's lambda and mu, MPa."""
    E, nu = material.youngs_modulus, material.poisson_ratio
    return E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))


def _average(mesh: TetMesh, stress: Float[np.ndarray, "n_t 3 3"]) -> Float[np.ndarray, "n_t 3 3"]:
    """To the vertices, weighted by volume, and back to the centroids."""
    n_t = len(mesh.tets)
    corners = (np.full(4 * n_t, 0.25), mesh.tets.ravel(), np.arange(0, 4 * n_t + 1, 4))
    back = sp.csr_matrix(corners, shape=(n_t, len(mesh.vertices)))
    nodal = back.T @ (mesh.volumes[:, None] * stress.reshape(-1, 9)) / mesh.vertex_volumes[:, None]
    return (back @ nodal).reshape(-1, 3, 3)


def _smooth(
    problem: DesignProblem,
    factor: Factor,
    free: np.ndarray,
    f: np.ndarray,
    u: np.ndarray,
    options: ElasticityOptions,
) -> tuple[np.ndarray, int, float]:
    """Conjugate gradients for A u = f preconditioned by K, from u = K^-1 f: displacement, steps, relative residual."""
    mesh, shape = problem.mesh, problem.fixed.shape
    lmbda, mu = lame_parameters(problem.material)

    def A(x: np.ndarray) -> np.ndarray:
        nodal, force = np.zeros((len(mesh.vertices), 6)), np.zeros(shape)
        u = _expand(x, free, shape)
        add_averaged_force(mesh.tets, mesh.hat_gradients, mesh.volumes, mesh.vertex_volumes, lmbda, mu, u, nodal, force)
        return force.ravel()[free]

    scale = np.sqrt(f @ u)  # the load in the norm of K^-1
    r = f - A(u)
    z = factor.solve(r)
    rho = r @ z
    p = z
    for step in range(options.smoothing_steps):
        residual = float(np.sqrt(max(rho, 0.0)) / scale)
        if residual <= options.smoothing_tolerance:
            return u, step, residual
        Ap = A(p)
        curvature = p @ Ap
        if curvature <= 0:  # p is one of the modes that averaging hides: nothing more to smooth
            return u, step, residual
        step_length = rho / curvature
        u = u + step_length * p
        r = r - step_length * Ap
        z = factor.solve(r)
        rho, previous = r @ z, rho
        p = z + (rho / previous) * p
    return u, options.smoothing_steps, float(np.sqrt(max(rho, 0.0)) / scale)


def _combine(problem: DesignProblem, stresses: list[np.ndarray]) -> np.ndarray:
    weights = [case.weight for case in problem.load_cases]
    if problem.combination == "sum":
        return sum((w * s for w, s in zip(weights, stresses, strict=True)), np.zeros_like(stresses[0]))
    squares = sum((w * s @ s for w, s in zip(weights, stresses, strict=True)), np.zeros_like(stresses[0]))
    values, vectors = np.linalg.eigh(squares)
    return np.einsum("tik,tk,tjk->tij", vectors, np.sqrt(np.maximum(values, 0)), vectors)


def _expand(u: np.ndarray, free: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    full = np.zeros(int(np.prod(shape)))
    full[free] = u
    return full.reshape(shape)
