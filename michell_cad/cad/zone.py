"""What is kept and what stays free around it, as cells that share faces, and as meshes to measure distances from."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from michell_cad.cad.keep import KeptSolid
from michell_cad.cad.mesh_unite import manifold_of_corners, unite_bodies
from michell_cad.cad.solid import TrussSolid

if TYPE_CHECKING:
    from manifold3d import Manifold

MESH_DISTANCE = 0.02
"""Distance of the triangles of kept solids from their surface (relative to the largest radius of the truss)."""

MESH_ANGLE = 0.1
"""Largest angle between such triangles, radians: 63 sides of a round hole err by 0.17 % of its area."""


@dataclass(frozen=True, eq=False)
class Zone:
    """Kept solids and clearances as cells that share faces, each also as a mesh, in groups that do not touch."""

    names: tuple[str, ...]
    cells: list[Any]
    bodies: list["Manifold"]
    owner: np.ndarray
    is_kept: np.ndarray
    group: np.ndarray
    tolerance: float

    def union(self, chosen: np.ndarray) -> "Manifold":
        """Mesh of the chosen cells together."""
        return unite_bodies([self.bodies[c] for c in np.flatnonzero(chosen).tolist()])


def lay_zone(solid: TrussSolid, kept: Sequence[KeptSolid]) -> Zone:
    """Split kept solids and clearances by each other; where both overlap, material is kept."""
    from michell_cad.cad import kernel_booleans as booleans

    arguments = [(one, owner, True) for owner, keep in enumerate(kept) for one in keep.solids]
    arguments += [(one, owner, False) for owner, keep in enumerate(kept) for one in keep.clearance]
    cells = booleans.split([one for one, *_ in arguments])
    owner, is_kept = np.full(len(cells.solids), -1), np.zeros(len(cells.solids), bool)
    # Kept material wins over clearance, and the first owner over later ones.
    for (_, who, material), mine in reversed(list(zip(arguments, cells.of, strict=True))):
        owner[mine] = who
        is_kept[mine] = material
    distance = MESH_DISTANCE * float(solid.prepared.sized.radii.max())
    corners = booleans.mesh_solids(cells.solids, distance, MESH_ANGLE)
    bodies = [manifold_of_corners(one) for one in corners]
    names = tuple(keep.name for keep in kept)
    return Zone(names, cells.solids, bodies, owner, is_kept, _touching(cells.solids), 2 * distance)


def _touching(cells: Sequence[Any]) -> np.ndarray:
    """Number of the group of each cell: cells that share a face are in the same."""
    from michell_cad.cad.kernel_booleans import FaceTable, faces_of

    first, links = FaceTable(), []
    for c, cell in enumerate(cells):
        for face in faces_of(cell):
            other = first.get(face)
            links.append((c, c if other is None else other))
            first.put(face, c)
    return components(len(cells), np.array(links))


def components(n: int, links: np.ndarray) -> np.ndarray:
    """Number of the connected component of each of n things that links (k, 2) join."""
    graph = coo_matrix((np.ones(len(links)), links.T), shape=(n, n))
    return connected_components(graph, directed=False)[1]
