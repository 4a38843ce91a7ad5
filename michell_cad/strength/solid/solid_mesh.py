"""Quadratic tets of the solid of a truss, from its closed surface: size, forecast, mesh and checks."""

from collections.abc import Callable

import numpy as np

from michell_cad.arrays import require
from michell_cad.closed_mesh import ClosedMesh
from michell_cad.errors import ConvergenceError
from michell_cad.linear_solver import free_memory
from michell_cad.strength.solid.quadratic_mesh import QuadraticMesh, quadratic_mesh
from michell_cad.strength.solid.stuffing import stuff_surface
from michell_cad.tet_mesh import TetMesh

COARSEST, FINEST = 1.2, 0.7
"""Sizes of the lattice over the smallest radius. A round bar that bends is 1.7 % too soft with the first, 0.2 % with
0.8; above the first, bars lose their cross-section here and there."""

USUAL_TETS = 300_000
"""The size is chosen for so many, between the bounds above: more take minutes."""

TETS_PER_CUBE = 14.5
"""Tets per cube of the size: 12 in the lattice itself, and those of cut ones (measured: 13.9 to 14.9)."""

BYTES_PER_TET = 28_000
"""Memory of matrix and factor at their peak over the number of tets, measured at 345,000 tets of a truss."""

MEMORY_SHARE = 0.6
"""Of the free memory that a solution may take."""

VOLUME_TOLERANCE = 0.03
"""Largest difference between the volumes of mesh and surface (relative): sharp edges come out blunt."""


def mesh_solid(
    surface: ClosedMesh,
    smallest_radius: float,
    size: float | None = None,
    progress: Callable[[float], None] = lambda fraction: None,
) -> QuadraticMesh:
    """Fill the surface of a truss with quadratic tets, curved along it.

    Parameters
    ----------
    surface : closed.
    smallest_radius : of its members, mm.
    size : edge of the lattice's cubes, mm; default: `lattice_size`.

    Raises
    ------
    InvalidInputError
        If the size is too coarse for the members, or so fine that the solution would not fit in memory.
    ConvergenceError
        If the mesh does not have the volume or the bodies of the surface.
    """
    volume = surface.volume
    size = lattice_size(volume, smallest_radius) if size is None else size
    require(
        np.isfinite(size) and 0 < size <= COARSEST * smallest_radius,
        f"the size of the tets must be above 0 and at most {COARSEST} of the smallest radius of a member, "
        f"{COARSEST * smallest_radius:.3g} mm, found {size:g}",
    )
    tets, memory = forecast(volume, size)
    finest = (TETS_PER_CUBE * volume * BYTES_PER_TET / (MEMORY_SHARE * free_memory())) ** (1 / 3)
    require(
        memory < MEMORY_SHARE * free_memory(),
        f"the solid would take about {tets:,} quadratic tets of {size:.3g} mm and {memory / 1e9:.0f} GB, with "
        f"{free_memory() / 1e9:.0f} GB free: use a size of {finest:.3g} mm or more, with members of at least "
        f"{finest / COARSEST:.3g} mm radius",
    )
    X, T, _ = stuff_surface(surface, size)
    progress(0.7)
    straight = TetMesh(X, T)
    mesh = quadratic_mesh(straight, surface.nearest)
    progress(1.0)
    bodies, expected = int(straight.body_of_tet.max()) + 1, surface.bodies
    found = float(mesh.volumes.sum())
    if bodies != expected or abs(found / volume - 1) > VOLUME_TOLERANCE:
        raise ConvergenceError(
            f"the tets of {size:.3g} mm have {bodies} bodies and {found:.6g} mm^3, the solid {expected} and "
            f"{volume:.6g} mm^3: use a smaller size"
        )
    return mesh


def lattice_size(volume: float, smallest_radius: float) -> float:
    """Edge of the lattice's cubes for about `USUAL_TETS` tets, within what the members allow, mm."""
    usual = (TETS_PER_CUBE * volume / USUAL_TETS) ** (1 / 3)
    return float(np.clip(usual, FINEST * smallest_radius, COARSEST * smallest_radius))


def forecast(volume: float, size: float) -> tuple[int, float]:
    """Number of tets, and the memory in bytes that their solution takes."""
    tets = round(TETS_PER_CUBE * volume / size**3)
    return tets, float(tets * BYTES_PER_TET)
