"""The direct mesh by groups: the families of curves, and the nodes."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from michell_cad.cad.prepared import PreparedTruss
from michell_cad.cad.shell_plan import FaceRole
from michell_cad.cad.solid import TrussSolid, curve_of_part
from michell_cad.palette import GROUPS, KEPT, NODES


def coloured_triangles(solid: TrussSolid) -> dict[str, Int[np.ndarray, "t 3"]]:
    """Triangles by colour, as the faces of the solid have it: fillets go with the family of their member."""
    group = _group_numbers(solid.prepared, solid.mesh.role, solid.mesh.owner)
    return _split(solid.mesh.triangles, group)


def closed_bodies(solid: TrussSolid) -> dict[str, Int[np.ndarray, "t 3"]]:
    """Triangles of closed bodies: the tubes of each family, and the nodes with their fillets.

    Between a tube and a node both get the same plane polygon, so that the bodies touch, do not overlap, and have the
    volume of the whole between them. A truss that is united with kept solids is one body, in their group.
    """
    mesh = solid.mesh
    if solid.report.kept is not None:
        return {KEPT: mesh.triangles}
    is_tube = mesh.role == FaceRole.MEMBER
    tubes = mesh.triangles[is_tube]
    group = _group_numbers(solid.prepared, mesh.role[is_tube], mesh.owner[is_tube])
    lid, triangle = _lids(tubes, len(mesh.vertices))
    node = GROUPS.index(NODES)
    triangles = np.concatenate([tubes, mesh.triangles[~is_tube], lid, lid[:, ::-1]])
    numbers = np.concatenate([group, np.full((~is_tube).sum(), node), group[triangle], np.full(len(lid), node)])
    return _split(triangles, numbers)


def own_vertices(
    vertices: Float[np.ndarray, "n 3"], triangles: Int[np.ndarray, "t 3"]
) -> tuple[Int[np.ndarray, " k"], Int[np.ndarray, "t 3"]]:
    """Numbers of the vertices that triangles use, and the triangles over these."""
    used = np.zeros(len(vertices), bool)
    used[triangles] = True
    number = np.cumsum(used) - 1
    return np.flatnonzero(used), number[triangles]


def _group_numbers(prepared: PreparedTruss, role: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """Index into `GROUPS` of each triangle."""
    families = np.array([GROUPS.index(curve.family) for curve in prepared.sized.truss.curves] + [GROUPS.index(NODES)])
    return np.where(role == FaceRole.KEPT, GROUPS.index(KEPT), families[curve_of_part(prepared, role, owner)])


def _split(triangles: np.ndarray, group: np.ndarray) -> dict[str, np.ndarray]:
    parts: Mapping[str, np.ndarray] = {name: triangles[group == k] for k, name in enumerate(GROUPS)}
    return {name: part for name, part in parts.items() if len(part)}


def _lids(triangles: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Triangles that close open triangles, fans from a vertex of each loop, and the triangle that each continues."""
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    code, back = start * n + end, end * n + start
    ranked = np.sort(code)
    place = np.minimum(np.searchsorted(ranked, back), len(ranked) - 1)
    at = np.flatnonzero(ranked[place] != back)
    a, b = start[at], end[at]
    size = (n, n)
    _, loop = connected_components(coo_matrix((np.ones(len(at)), (a, b)), shape=size), directed=False)
    tip = np.full(n, n)
    np.minimum.at(tip, loop[a], a)
    c = tip[loop[a]]
    kept = (a != c) & (b != c)
    return np.stack([b, a, c], axis=1)[kept], at[kept] // 3
