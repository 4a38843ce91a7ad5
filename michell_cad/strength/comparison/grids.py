"""Regular grids in the same part: what one would build without knowing the stress.

A grid is the truss of straight coordinates, traced and cleaned exactly as that of a design: it is cut by the surface of
the part, has members along the surface and the sharp edges, and is held and loaded on the same regions.
"""

from typing import Literal

import numpy as np
from jaxtyping import Float

from michell_cad.arrays import require
from michell_cad.isocurves import trace_isocurves
from michell_cad.strength.braces import add_braces, alternating_diagonals, cell_faces
from michell_cad.tet_mesh import TetMesh
from michell_cad.truss import Truss, clean_network
from michell_cad.truss.inside import keep_inside

Diagonals = Literal["parallel", "zigzag"]
"""Which way the diagonals of a grid run."""

INSET = 1e-3
"""How far inside the part's faces the outermost layers of a grid lie, in cells: cleaning lays their members on them."""


def regular_grid(
    mesh: TetMesh,
    cells: tuple[int, int, int],
    axes: Float[np.ndarray, "3 3"] | None = None,
    diagonals: Diagonals | None = None,
) -> Truss:
    """A grid of straight cells in a part.

    Parameters
    ----------
    mesh : TetMesh
    cells : numbers of cells along the three axes, over the extent of the part.
    axes : columns, orthonormal. Default: the global axes.
    diagonals : of the faces of cells, one in each: "parallel" to those of neighbours, or "zigzag", so that they meet at
        every second node; on the paper's cantilever that is 16 to 33 per cent stiffer at equal volume. Default: none.

    Raises
    ------
    InvalidInputError
        For numbers of cells below one.
    """
    require(min(cells) >= 1, f"a grid needs at least one cell along each axis, found {cells}")
    x = mesh.vertices @ (np.eye(3) if axes is None else axes)
    low, extent = x.min(0), np.ptp(x, axis=0)
    # Layers lie on the outermost points; a part that is a box along the axes has them on its faces.
    levels = (x - low) / extent * (np.array(cells) - 2 * INSET) + INSET
    spacing = float(np.median(extent / cells))
    truss, _ = clean_network(trace_isocurves(mesh, levels), spacing)
    truss = keep_inside(truss, mesh)
    if diagonals == "zigzag":
        return add_braces(truss, alternating_diagonals(truss, mesh, levels))
    if diagonals is None:
        return truss
    ring = cell_faces(truss)
    first = (np.rint(truss.nodes[ring].mean(1) @ np.ones(3) / spacing * 2).astype(int) % 2 == 0)[:, None]
    return add_braces(truss, np.unique(np.sort(np.where(first, ring[:, [0, 2]], ring[:, [1, 3]]), axis=1), axis=0))


def turned_axes(degrees: float, axis: int = 1) -> Float[np.ndarray, "3 3"]:
    """Orthonormal axes turned by an angle about a global axis."""
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    turn = np.eye(3)
    i, j = [k for k in range(3) if k != axis]
    turn[[i, i, j, j], [i, j, i, j]] = c, -s, s, c
    return turn
