"""The solid under its loads: displacements by quadratic tets, and the stresses."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from michell_cad.arrays import freeze
from michell_cad.linear_solver import factorise
from michell_cad.problem import Material
from michell_cad.rigid_motions import rigid_motions
from michell_cad.strength.solid.quadratic_mesh import QuadraticMesh
from michell_cad.strength.solid.quadratic_tets import gauss_stress, nodal_stress, stiffness_matrix, von_mises
from michell_cad.strength.solid.solid_loading import SolidLoading


@dataclass(frozen=True, eq=False)
class SolidSolution:
    """Displacements of a solid for each load case.

    Parameters
    ----------
    mesh, material, loading : what was solved.
    displacements : (n_c, n_p, 3) float, mm.
    """

    mesh: QuadraticMesh
    material: Material
    loading: SolidLoading
    displacements: Float[np.ndarray, "n_c n_p 3"]

    def __post_init__(self) -> None:
        freeze(self, displacements=np.float64)

    @cached_property
    def compliances(self) -> Float[np.ndarray, " n_c"]:
        """f . u of each case, N mm."""
        return np.einsum("cpd,cpd->c", self.loading.forces, self.displacements)

    @cached_property
    def von_mises(self) -> Float[np.ndarray, "n_c n_p"]:
        """Von Mises stress of the nodal mean stress, MPa."""
        return np.stack([von_mises(self.nodal_stress(case)) for case in range(len(self.displacements))])

    def nodal_stress(self, case: int) -> Float[np.ndarray, "n_p 3 3"]:
        """Cauchy stress at the nodes for one load case, MPa."""
        return nodal_stress(self.mesh, gauss_stress(self.mesh, self.material, self.displacements[case]))

    @cached_property
    def peak_stress(self) -> Float[np.ndarray, " n_c"]:
        """Largest von Mises stress where stresses count, MPa."""
        return self.von_mises[:, self.loading.counted].max(1)


def solve_solid(mesh: QuadraticMesh, material: Material, loading: SolidLoading) -> SolidSolution:
    """Solve K u = f for every load case; forces on fixed components go to the supports.

    Raises
    ------
    ConvergenceError
        If the supports leave the solid free to move, or the mesh is in pieces.
    """
    K = stiffness_matrix(mesh, material, loading.fixed)
    centred = mesh.nodes - mesh.nodes.mean(0)
    modes = rigid_motions(centred / np.abs(centred).max()).reshape(-1, 6) * ~loading.fixed.reshape(-1, 1)
    f = np.where(loading.fixed, 0, loading.forces).reshape(len(loading.forces), -1)
    u = factorise(K, modes=modes).solve(np.ascontiguousarray(f.T)).T
    return SolidSolution(mesh, material, loading, u.reshape(loading.forces.shape))
