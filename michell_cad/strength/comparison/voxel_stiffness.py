"""Displacements of voxels, each with a modulus of its own."""

from functools import cached_property

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float

from michell_cad.arrays import require
from michell_cad.elasticity import lame_parameters
from michell_cad.linear_solver import factorise, free_memory
from michell_cad.problem import Material
from michell_cad.rigid_motions import rigid_motions
from michell_cad.strength.comparison.voxel_elements import FINE_POINTS, brick_stiffness, shape_gradients
from michell_cad.strength.comparison.voxel_model import VoxelModel

BYTES_PER_VOXEL = 576 * 32
"""Of the matrix and its assembly: numbers, values and copies of the 24 x 24 entries of a voxel."""

BYTES_OF_FACTOR, VOXELS_OF_FACTOR, FACTOR_POWER = 0.56e9, 21_300, 4 / 3
"""Memory of a factor of a block of voxels, measured, and the power of their number with which it grows (nested
dissection in space); parts that are thin take less."""

MEMORY_SHARE = 0.5
"""Of the free memory that the voxels may take."""


class VoxelStiffness:
    """The stiffness of a voxel model, assembled and factorised anew for every distribution of moduli.

    Parameters
    ----------
    model : VoxelModel
    material : of a voxel whose modulus has the factor one.

    Raises
    ------
    InvalidInputError
        If the matrices would not fit in memory.
    """

    def __init__(self, model: VoxelModel, material: Material) -> None:
        require_voxel_memory(len(model.corners))
        self.model, self._material = model, material
        self._K = brick_stiffness(model.edges, material)
        self._free = np.flatnonzero(~model.held.ravel())
        n = len(self._free)
        number = np.full(model.held.size, n)
        number[self._free] = np.arange(n)
        unknowns = number[(3 * model.corners[:, :, None] + np.arange(3)).reshape(-1, 24)]
        # Held components are row and column n, whose entries are left out of the matrix.
        keys, self._entry = np.unique(unknowns[:, :, None] * (n + 1) + unknowns[:, None], return_inverse=True)
        rows, columns = np.divmod(keys, n + 1)
        self._kept = (rows < n) & (columns < n)
        self._columns = columns[self._kept]
        self._row_starts = np.searchsorted(rows[self._kept], np.arange(n + 1))
        self._ordering: np.ndarray | None = None

    def solve(self, moduli: Float[np.ndarray, " n_e"]) -> Float[np.ndarray, "n_c n_n 3"]:
        """Displacements, mm, in every load case; `moduli` are positive factors of Young's modulus.

        Raises
        ------
        ConvergenceError
            If the matrix is not positive definite to working precision.
        """
        n = len(self._free)
        values = np.bincount(self._entry.ravel(), (moduli[:, None, None] * self._K).ravel())[self._kept]
        K = sp.csr_matrix((values, self._columns, self._row_starts), shape=(n, n))
        factor = factorise(K, self._ordering, self._modes)
        self._ordering = factor.ordering
        f = self.model.forces.reshape(len(self.model.names), -1)
        u = np.zeros_like(f)
        u[:, self._free] = factor.solve(np.ascontiguousarray(f[:, self._free].T)).T
        return u.reshape(self.model.forces.shape)

    def energies(self, u: Float[np.ndarray, "n_c n_n 3"]) -> Float[np.ndarray, " n_e"]:
        """sum_c w_c u_c' K_e u_c of every voxel with the modulus of the material, N mm."""
        at_corners = u[:, self.model.corners].reshape(len(u), -1, 24)
        return np.einsum("c,cei,ij,cej->e", self.model.weights, at_corners, self._K, at_corners, optimize=True)

    def point_energies(self, u: Float[np.ndarray, "n_c n_n 3"]) -> Float[np.ndarray, "64 n_e"]:
        """The same at `FINE_POINTS`, each for a 64th of its voxel: lambda tr(eps)^2 + 2 mu |eps|^2 times its volume."""
        lmbda, mu = lame_parameters(self._material)
        at_corners = u[:, self.model.corners]
        found = np.empty((len(FINE_POINTS), len(self.model.corners)))
        for k, gradients in enumerate(shape_gradients(FINE_POINTS, self.model.edges)):
            H = np.einsum("cead,ab->cedb", at_corners, gradients, optimize=True)
            strain = (H + H.swapaxes(2, 3)) / 2
            density = lmbda * np.trace(strain, axis1=2, axis2=3) ** 2 + 2 * mu * (strain**2).sum((2, 3))
            found[k] = self.model.weights @ density
        return found * (self.model.edges.prod() / len(FINE_POINTS))

    def work(self, u: Float[np.ndarray, "n_c n_n 3"]) -> float:
        """sum_c w_c f_c . u_c, N mm: the compliance, if u are the displacements of the forces."""
        return float(np.einsum("c,cnd,cnd->", self.model.weights, self.model.forces, u, optimize=True))

    @cached_property
    def _modes(self) -> np.ndarray:
        """Rigid motions of the free components, for the multigrid of matrices whose factor would not fit."""
        x = self.model.nodes - self.model.nodes.mean(0)
        return rigid_motions(x / np.ptp(x, axis=0).max()).reshape(-1, 6)[self._free]


def require_voxel_memory(count: int) -> None:
    """Refuse so many voxels that their matrices would not fit in memory.

    Raises
    ------
    InvalidInputError
        With the number that would.
    """
    need, room = voxel_memory(count), MEMORY_SHARE * free_memory()
    # All grows with the number at least, and with this power of it at most.
    fits = int(count * (room / need) if room < need else count)
    require(
        need <= room,
        f"{count:,} voxels would take about {need / 1e9:.1f} GB of the {free_memory() / 1e9:.1f} GB that are free: use "
        f"at most {fits:,}",
    )


def voxel_memory(count: int) -> float:
    """Bytes that the matrices of so many voxels take, about."""
    return count * BYTES_PER_VOXEL + BYTES_OF_FACTOR * (count / VOXELS_OF_FACTOR) ** FACTOR_POWER
