"""What is to be designed: a meshed part, its material, what is held and what pulls.

Everything that names faces, selectors or files is resolved before (`job.py`, `domain.py`); here supports and loads are
plain arrays at the vertices, which is all that the numerical stages need to know.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int

from michell_cad.arrays import freeze, require
from michell_cad.errors import InvalidInputError
from michell_cad.rigid_motions import free_rigid_motions
from michell_cad.tet_mesh import TetMesh

GRAVITY = 9.80665
"""Standard acceleration of gravity, m/s^2 (3rd CGPM, 1901)."""

EXTREME = 1e30
"""Forces (N) and moduli (MPa) above this, or below its inverse, are mistakes; squares and products of those between
stay far from overflow."""

MOST_NAMED = 6
"""A message names this many of the free rigid motions."""


@dataclass(frozen=True)
class Material:
    """A linear elastic, isotropic material.

    Parameters
    ----------
    name : str
    youngs_modulus : MPa.
    poisson_ratio : in (-1, 0.5).
    density : g/mm^3.
    yield_strength : MPa.
    source : where the values come from.
    """

    name: str
    youngs_modulus: float
    poisson_ratio: float
    density: float
    yield_strength: float
    source: str = ""

    def __post_init__(self) -> None:
        for field in ("youngs_modulus", "density", "yield_strength"):
            value = getattr(self, field)
            require(np.isfinite(value) and value > 0, f"material: {field} must be positive, found {value}")
        E, nu = self.youngs_modulus, self.poisson_ratio
        require(1 / EXTREME <= E <= EXTREME, f"material: youngs_modulus must be a value in MPa, found {E:g}")
        require(-1 < nu < 0.5, f"material: poisson_ratio must lie between -1 and 0.5 (both excluded), found {nu}")


@dataclass(frozen=True, eq=False)
class LoadCase:
    """Nodal forces that act together.

    Parameters
    ----------
    name : str
    force : (n_v, 3) float, N.
    weight : factor of this case in the combined stress, see `DesignProblem`.
    """

    name: str
    force: Float[np.ndarray, "n_v 3"]
    weight: float = 1.0

    def __post_init__(self) -> None:
        freeze(self, force=np.float64)
        require(np.isfinite(self.force).all(), f"load case {self.name!r}: forces must be finite numbers")
        largest = float(np.abs(self.force).max(initial=0.0))
        require(
            largest == 0 or 1 / EXTREME <= largest <= EXTREME,
            f"load case {self.name!r}: the largest force must lie between {1 / EXTREME:g} and {EXTREME:g} N, found "
            f"{largest:.3g}; check the unit",
        )
        require(
            np.isfinite(self.weight) and self.weight > 0,
            f"load case {self.name!r}: weight must be positive, found {self.weight}",
        )


@dataclass(frozen=True, eq=False)
class DesignProblem:
    """A meshed part with material, supports and load cases.

    Parameters
    ----------
    mesh : TetMesh
    material : Material
    fixed : (n_v, 3) bool, which displacement components of which vertices are held at zero.
    load_cases : one or more.
    combination : how the stresses sigma_c of the cases with weights w_c make the stress of the design:
        ``"sum"``: sum_c w_c sigma_c, the loads act at once;
        ``"envelope"``: (sum_c w_c sigma_c^2)^(1/2), the symmetric square root of the summed squared tensors: cases that
        act one at a time, either way round. All its principal stresses are positive.

    Raises
    ------
    InvalidInputError
        For shapes that do not fit, forces that vanish at every free component, or supports that leave a rigid motion.
    """

    mesh: TetMesh
    material: Material
    fixed: Bool[np.ndarray, "n_v 3"]
    load_cases: tuple[LoadCase, ...]
    combination: Literal["sum", "envelope"] = "sum"

    def __post_init__(self) -> None:
        freeze(self, fixed=bool)
        shape = (len(self.mesh.vertices), 3)
        require(self.fixed.shape == shape, f"fixed must have shape {shape}, found {self.fixed.shape}")
        require(self.combination in ("sum", "envelope"), f"unknown combination {self.combination!r}: sum or envelope")
        require(len(self.load_cases), "no load: give at least one [[load]]")
        for case in self.load_cases:
            require(
                case.force.shape == shape,
                f"load case {case.name!r}: force must have shape {shape}, found {case.force.shape}",
            )
            require(
                (case.force[~self.fixed] != 0).any(),
                f"load case {case.name!r}: the force is zero at every free vertex; "
                "give a load that is not zero, on a face that is not held",
            )
        motions = free_rigid_motions(self.mesh, self.fixed)
        require(
            not motions,
            f"the supports leave the part free to move: {'; '.join(motions[:MOST_NAMED])}"
            f"{f'; and {len(motions) - MOST_NAMED} more' if len(motions) > MOST_NAMED else ''}. "
            "Hold more faces, or more axes of them",
        )

    @cached_property
    def anchored(self) -> Bool[np.ndarray, " n_v"]:
        """Vertices that are held or loaded; a load on every vertex (weight) is on no place in particular."""
        loaded = np.array([(case.force != 0).any(1) for case in self.load_cases])
        return np.logical_or(self.fixed.any(1), loaded[~loaded.all(1)].any(0))


# --- loads on regions of the boundary, as consistent nodal forces --------------------------------------------


def surface_force(
    mesh: TetMesh, triangles: Int[np.ndarray, " k"], force: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "n_v 3"]:
    """Nodal forces of a total force (N) spread evenly over the area of the given boundary triangles."""
    areas = _areas(mesh, triangles)
    return _spread(mesh, triangles, areas[:, None] / areas.sum() * np.asarray(force, float))


def surface_pressure(mesh: TetMesh, triangles: Int[np.ndarray, " k"], pressure: float) -> Float[np.ndarray, "n_v 3"]:
    """Nodal forces of a pressure (MPa, positive pushes into the part) on the given boundary triangles."""
    return _spread(mesh, triangles, -pressure * mesh.boundary_area_vectors[triangles])


def surface_torque(
    mesh: TetMesh,
    triangles: Int[np.ndarray, " k"],
    torque: float,
    axis_point: Float[np.ndarray, " 3"],
    axis_direction: Float[np.ndarray, " 3"],
) -> Float[np.ndarray, "n_v 3"]:
    """Nodal forces of a torque (N mm, right-handed about the axis), with no net force, on boundary triangles.

    The traction field is t = c * d x (x - x0) at the vertices, with x0 chosen on the loaded area so that the net force
    is zero to rounding, and c such that the moment about the axis is `torque` exactly.
    """
    d = np.asarray(axis_direction, float)
    require(np.linalg.norm(d) > 0, "torque: the direction of the axis must not be the zero vector")
    d = d / np.linalg.norm(d)
    weight = _spread(mesh, triangles, np.repeat(_areas(mesh, triangles)[:, None], 3, axis=1))[:, 0]
    x = mesh.vertices - np.asarray(axis_point, float)
    # A couple has no net force, so it is the same about every parallel axis: turn about the centre of the loaded area.
    x = x - (weight @ x) / weight.sum()
    force = weight[:, None] * np.cross(d, x)
    moment = np.einsum("vd,vd->", np.cross(x, force), np.broadcast_to(d, x.shape))
    require(moment > 0, "torque: the loaded faces have no extent around the axis; choose faces away from a line")
    return force * (torque / moment)


def self_weight(mesh: TetMesh, density: float, direction: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "n_v 3"]:
    """Nodal forces of the part's own weight (density in g/mm^3) towards `direction`, N."""
    direction = np.asarray(direction, float)
    require(np.linalg.norm(direction) > 0, "self-weight: the direction must not be the zero vector")
    newtons = mesh.vertex_volumes * density * 1e-3 * GRAVITY
    return newtons[:, None] * direction / np.linalg.norm(direction)


def _areas(mesh: TetMesh, triangles: np.ndarray) -> np.ndarray:
    if not len(triangles):
        raise InvalidInputError("a load needs at least one boundary triangle; the region is empty")
    return np.linalg.norm(mesh.boundary_area_vectors[triangles], axis=1)


def _spread(mesh: TetMesh, triangles: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Share the force on each triangle equally among its corners (exact for a constant traction)."""
    nodal = np.zeros_like(mesh.vertices)
    np.add.at(nodal, mesh.boundary_triangles[triangles], np.repeat(forces[:, None] / 3, 3, axis=1))
    return nodal
