"""What a solved frame of beams carries: forces, stresses and energies of every section, by statics from the ends."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from michell_cad.arrays import freeze
from michell_cad.strength.beam_model import BeamModel


@dataclass(frozen=True, eq=False)
class BeamSolution:
    """Displacements and forces of a beam model, for each load case c.

    Parameters
    ----------
    model : BeamModel
    displacements : (n_c, n_n, 6) float: displacement, mm, and rotation, radians, of every node, global axes.
    end_forces : (n_c, n_e, 2, 6) float: force, N, and moment, N mm, of the nodes on both ends of every element, global
        axes.
    compliances : (n_c,) float, N mm: f . u, twice the work of the loads.
    """

    model: BeamModel
    displacements: Float[np.ndarray, "n_c n_n 6"]
    end_forces: Float[np.ndarray, "n_c n_e 2 6"]
    compliances: Float[np.ndarray, " n_c"]

    def __post_init__(self) -> None:
        freeze(self, displacements=np.float64, end_forces=np.float64, compliances=np.float64)

    @cached_property
    def section_forces(self) -> Float[np.ndarray, "n_c n_e k 6"]:
        """Force, N, and moment, N mm, that what lies beyond each section exerts on it, global axes."""
        model = self.model
        P, M = self.end_forces[:, :, 1, None, :3], self.end_forces[:, :, 1, None, 3:]
        arm = model.nodes[model.elements[:, 1], None] - model.points
        moment = M + np.cross(arm, P)
        return np.concatenate([np.broadcast_to(P, moment.shape), moment], axis=-1)

    @cached_property
    def axial_force(self) -> Float[np.ndarray, "n_c n_e k"]:
        """Normal force at every section, N, tension positive."""
        return np.einsum("cekd,ekd->cek", self.section_forces[..., :3], self.model.tangents)

    @cached_property
    def torque(self) -> Float[np.ndarray, "n_c n_e k"]:
        """Torque at every section, N mm, right-handed about the tangent."""
        return np.einsum("cekd,ekd->cek", self.section_forces[..., 3:], self.model.tangents)

    @cached_property
    def shear_force(self) -> Float[np.ndarray, "n_c n_e k"]:
        """Magnitude of the transverse force at every section, N."""
        across = self.section_forces[..., :3] - self.axial_force[..., None] * self.model.tangents
        return np.linalg.norm(across, axis=-1)

    @cached_property
    def bending_moment(self) -> Float[np.ndarray, "n_c n_e k"]:
        """Magnitude of the bending moment at every section, N mm."""
        across = self.section_forces[..., 3:] - self.torque[..., None] * self.model.tangents
        return np.linalg.norm(across, axis=-1)

    @cached_property
    def von_mises(self) -> Float[np.ndarray, "n_c n_e k"]:
        """(sigma^2 + 3 tau^2)^(1/2) at the extreme fibre of every section, MPa.

        sigma = |N| / A + 4 M / (pi r^3), tau = 2 T / (pi r^3). Transverse shear vanishes at that fibre; in its own
        place it is smaller than the bending stress of the same force by about the radius over the length.
        """
        r = self.model.radii
        bending_modulus = np.pi * r**3 / 4
        sigma = np.abs(self.axial_force) / (np.pi * r**2) + self.bending_moment / bending_modulus
        return np.sqrt(sigma**2 + 3 * (self.torque / (2 * bending_modulus)) ** 2)

    @cached_property
    def peak_stress(self) -> Float[np.ndarray, "n_c n_m"]:
        """Largest `von_mises` along each member, MPa."""
        return np.maximum.reduceat(self.von_mises.max(2), self.model.first_elements, axis=1)

    @cached_property
    def energies(self) -> Float[np.ndarray, "n_c n_m 2"]:
        """Twice the strain energy of each member, N mm: by axial and transverse force, and by bending and torsion.

        At given forces the first goes with r^-2, the second with r^-4. Together they add up to the compliance.
        """
        model = self.model
        E, nu, r = model.material.youngs_modulus, model.material.poisson_ratio, model.radii
        G = E / (2 * (1 + nu))
        area = np.pi * r**2
        inertia = area * r**2 / 4
        stretching = self.axial_force**2 / (E * area) + self.shear_force**2 / (model.shear_coefficient * G * area)
        bending = self.bending_moment**2 / (E * inertia) + self.torque**2 / (2 * G * inertia)
        density = np.stack([stretching, bending], axis=-1)
        per_element = np.einsum("cekj,ek->cej", density, model.weights)
        return np.add.reduceat(per_element, model.first_elements, axis=1)

    @cached_property
    def local_axes(self) -> Float[np.ndarray, "n_e 3 3"]:
        """Axes of every element, as rows: x along its chord, y normal to x and to the global axis farthest from x
        (the first of equals), z = x cross y."""
        a, b = self.model.nodes[self.model.elements].transpose(1, 0, 2)
        x = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
        y = np.cross(np.eye(3)[np.abs(x).argmin(1)], x)
        y /= np.linalg.norm(y, axis=1, keepdims=True)
        return np.stack([x, y, np.cross(x, y)], axis=1)

    @cached_property
    def local_end_forces(self) -> Float[np.ndarray, "n_c n_e 2 6"]:
        """`end_forces` in the local axes: axial force, two shear forces, torque, two bending moments."""
        split = self.end_forces.reshape(*self.end_forces.shape[:3], 2, 3)
        return np.einsum("eij,cenqj->cenqi", self.local_axes, split).reshape(self.end_forces.shape)
