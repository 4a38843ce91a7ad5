"""What else one might build of the same material: the usual rivals of a design."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from michell_cad.errors import MichellError
from michell_cad.problem import DesignProblem
from michell_cad.strength.comparison.compare import Candidate
from michell_cad.strength.comparison.grids import regular_grid, turned_axes
from michell_cad.strength.comparison.ground_structure import optimal_ground_structure
from michell_cad.strength.comparison.hexes import conforming_map, hex_truss
from michell_cad.strength.loads import carry_over_loads
from michell_cad.strength.strengthen import size_for_loads
from michell_cad.strength.strengthen_options import StrengthenOptions
from michell_cad.truss import SizedTruss, Truss

GRID_CELLS = (4, 6, 8)
"""Cells of the grids along the longest side of the part."""


def standard_rivals(
    problem: DesignProblem,
    options: StrengthenOptions,
    sizes: Sequence[int] = GRID_CELLS,
    spacing: float | None = None,
) -> tuple[list[Candidate], list[str]]:
    """Grids of several sizes, plain and braced (diagonals parallel, or in turns), one braced at 45 degrees; cells that
    conform to the boundary, plain and braced; and a ground structure between the nodes of the smallest grid.

    Also returns notes on those that could not be found, or would not fit in memory: the others are still worth seeing.
    With `options.size_by` grids and cells are sized as the design is, at an equal sum of member volumes.

    Parameters
    ----------
    problem, options : as for the design.
    sizes : cells of the grids along the longest side of the part.
    spacing : of the cells that conform to the boundary, mm; default: that of the finest grid.
    """
    mesh = problem.mesh
    extent = np.ptp(mesh.vertices, axis=0)
    trusses: dict[str, Truss] = {}
    for size in sizes:
        cells = _cells(extent, size)
        name = "grid " + "x".join(map(str, cells))
        trusses[name] = regular_grid(mesh, cells)
        trusses[f"{name} braced"] = regular_grid(mesh, cells, diagonals="parallel")
        trusses[f"{name} zigzag"] = regular_grid(mesh, cells, diagonals="zigzag")
    cells = _cells(extent, sizes[-1])
    axes = turned_axes(45.0, int(np.argsort(extent)[1]))
    trusses["grid " + "x".join(map(str, cells)) + " turned"] = regular_grid(mesh, cells, axes, "parallel")
    edge = float(extent.max()) / sizes[-1] if spacing is None else spacing
    notes = []
    try:
        phi = conforming_map(mesh)
        trusses["hexes"] = hex_truss(mesh, edge, coordinates=phi)
        trusses["hexes zigzag"] = hex_truss(mesh, edge, braced=True, coordinates=phi)
    except MichellError as error:
        notes.append(f"hexes are left out: {error}")
    found = [Candidate(name, equal_members(problem, truss)) for name, truss in trusses.items()]
    if options.size_by is not None:
        found = [Candidate(f"{item.name} sized", size_for_loads(problem, item.sized, options)) for item in found]
    try:
        found.append(ground_structure_candidate(problem, sizes[0]))
    except MichellError as error:
        notes.append(f"the ground structure is left out: {error}")
    return found, notes


def ground_structure_candidate(problem: DesignProblem, size: int) -> Candidate:
    """The least-volume truss for the loads as given, between the nodes of a grid of `size` cells."""
    cells = _cells(np.ptp(problem.mesh.vertices, axis=0), size)
    grid = regular_grid(problem.mesh, cells)
    found = optimal_ground_structure(
        grid.nodes, carry_over_loads(problem, grid), problem.material.yield_strength, problem.mesh
    )
    radii: Float[np.ndarray, " n_m"] = np.sqrt(found.areas / np.pi)
    return Candidate(
        "ground s. " + "x".join(map(str, cells)), SizedTruss(found.truss, np.repeat(radii[:, None], 3, axis=1))
    )


def equal_members(problem: DesignProblem, truss: Truss) -> SizedTruss:
    """Equal members, a tenth of the part in all."""
    r = np.sqrt(0.1 * problem.mesh.volumes.sum() / (np.pi * truss.lengths.sum()))
    return SizedTruss(truss, np.full((len(truss.members), 3), r))


def _cells(extent: Float[np.ndarray, " 3"], size: int) -> tuple[int, int, int]:
    a, b, c = np.maximum(np.rint(extent / extent.max() * size), 1).astype(int).tolist()
    return a, b, c
