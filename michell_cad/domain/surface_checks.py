"""What makes triangles the surface of one solid: closed, oriented, not crossing itself, one outer shell.

Sources: the crossing test is the textbook one (an edge of one triangle pierces the other), on the pairs whose boxes
overlap in a bounding-volume tree over the Morton order; both are vectorised over pairs. CGAL's exact tests are avoided
because of their licence, so contacts without crossing (touching, coplanar overlap) pass.
"""

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int
from scipy.sparse.csgraph import connected_components

from michell_cad.errors import InvalidInputError

MERGE_TOLERANCE = 1e-7
"""Points closer than this fraction of the diagonal are one vertex: kernels and STL (float32) differ by that much."""

CROSSING_TOLERANCE = 1e-6
"""An edge crosses a triangle if it passes its plane and enters its inside by more than this fraction of its size
(barycentric, relative), so that contacts within rounding do not count."""

_MORTON_BITS = 20


def merge_vertices(
    points: Float[np.ndarray, "n 3"], triangles: Int[np.ndarray, "n_b 3"], tolerance: float = MERGE_TOLERANCE
) -> tuple[Float[np.ndarray, "n_v 3"], Int[np.ndarray, "n_b 3"]]:
    """Merge points that coincide within `tolerance` (relative to the diagonal); return vertices and triangles."""
    from scipy.spatial import KDTree

    distance = tolerance * max(np.linalg.norm(np.ptp(points, axis=0)), np.finfo(float).tiny)
    pairs = KDTree(points).query_pairs(distance, output_type="ndarray")
    n = len(points)
    graph = sp.coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    labels = connected_components(graph, directed=False)[1]
    _, first = np.unique(labels, return_index=True)
    return points[first], labels[triangles]


def check_surface(
    vertices: Float[np.ndarray, "n_v 3"], triangles: Int[np.ndarray, "n_b 3"], name: str
) -> tuple[Float[np.ndarray, "n_v 3"], Int[np.ndarray, "n_b 3"]]:
    """Return the surface with consistent outward orientation, or say why it does not enclose one solid.

    Raises
    ------
    InvalidInputError
        For open edges, edges with more than two triangles, or several solids; `name` begins the message.
    """
    if not np.isfinite(vertices).all():
        raise InvalidInputError(f"{name}: {(~np.isfinite(vertices).all(1)).sum()} vertices are not finite numbers")
    if not len(triangles):
        raise InvalidInputError(f"{name}: the surface has no triangles")
    pairs = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    key = pairs[:, 0] * len(vertices) + pairs[:, 1]
    _, inverse, counts = np.unique(key, return_inverse=True, return_counts=True)
    if (counts != 2).any():
        open_edges, crowded = int((counts == 1).sum()), int((counts > 2).sum())
        first = vertices[pairs[np.argmax(counts[inverse] != 2)]].mean(0)
        raise InvalidInputError(
            f"{name}: the surface is not closed: {open_edges} edges have only one triangle and {crowded} have more "
            f"than two, first near ({first[0]:.6g}, {first[1]:.6g}, {first[2]:.6g}); close the holes, "
            "remove inner walls"
        )
    triangles = _orient(vertices, triangles, inverse, name)
    used = np.unique(triangles)
    renumber = np.zeros(len(vertices), np.int64)
    renumber[used] = np.arange(len(used))
    return vertices[used], renumber[triangles]


def _orient(V: np.ndarray, F: np.ndarray, edge_of_side: np.ndarray, name: str) -> np.ndarray:
    """Turn the triangles of each shell alike, outer shells outwards and the walls of cavities inwards."""
    import igl

    order = np.argsort(edge_of_side, kind="stable").reshape(-1, 2)
    graph = sp.coo_matrix((np.ones(len(order)), (order[:, 0] // 3, order[:, 1] // 3)), shape=(len(F),) * 2)
    n_shells, shell = connected_components(graph, directed=False)
    F = np.ascontiguousarray(igl.bfs_orient(np.ascontiguousarray(F))[0])
    middle = V.mean(0)
    a, b, c = (V[F] - middle).transpose(1, 0, 2)
    volumes = np.bincount(shell, np.einsum("fd,fd->f", a, np.cross(b, c)) / 6, n_shells)
    flip = volumes < 0
    F = np.where(flip[shell][:, None], F[:, [0, 2, 1]], F)
    if n_shells == 1:
        return F
    # A shell inside an odd number of others is the wall of a cavity.
    depth = np.zeros(n_shells, int)
    for outer in range(n_shells):
        points = np.stack([V[F[np.argmax(shell == s)]].mean(0) for s in range(n_shells)])
        winding = np.asarray(igl.winding_number(V, np.ascontiguousarray(F[shell == outer]), points))
        inside = winding > 0.5
        inside[outer] = False
        depth += inside
    solids = int((depth % 2 == 0).sum())
    if solids > 1:
        sizes = ", ".join(f"{v:.4g}" for v in np.abs(volumes[depth % 2 == 0])[:6])
        raise InvalidInputError(
            f"{name}: expected the surface of one solid, found {solids} separate or overlapping bodies "
            f"(volumes {sizes}); unite them, or give one file per body"
        )
    return np.where((depth % 2 == 1)[shell][:, None], F[:, [0, 2, 1]], F)


# --- crossing triangles ----------------------------------------------------------------------------------------------


def crossing_triangles(
    vertices: Float[np.ndarray, "n_v 3"], triangles: Int[np.ndarray, "n_b 3"]
) -> Int[np.ndarray, "k 2"]:
    """Return the pairs of triangles that cross each other (an edge of one pierces the inside of the other)."""
    pairs = _overlapping_boxes(vertices[triangles])
    corners = triangles[pairs]
    shared = (corners[:, 0, :, None] == corners[:, 1, None, :]).sum((1, 2))
    pairs = pairs[shared < 2]
    crossing = np.zeros(len(pairs), bool)
    for first, second in ((0, 1), (1, 0)):
        F, G = triangles[pairs[:, first]], triangles[pairs[:, second]]
        for side in ((0, 1), (1, 2), (2, 0)):
            ends = F[:, side]
            # An edge from a shared corner only touches the other triangle there.
            apart = ~(ends[:, :, None] == G[:, None, :]).any((1, 2))
            crossing[apart] |= _pierces(vertices[ends[apart]], vertices[G[apart]])
    return pairs[crossing]


def _pierces(segments: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Whether each segment (n, 2, 3) passes through the inside of its triangle (n, 3, 3)."""
    p, q = segments[:, 0], segments[:, 1]
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    normal = np.cross(b - a, c - a)
    scale = np.linalg.norm(normal, axis=1)
    unit = normal / np.maximum(scale, np.finfo(float).tiny)[:, None]
    size = np.sqrt(scale) + np.linalg.norm(q - p, axis=1)
    above, below = np.einsum("nd,nd->n", p - a, unit), np.einsum("nd,nd->n", q - a, unit)
    slack = CROSSING_TOLERANCE * size
    passes = ((above > slack) & (below < -slack)) | ((above < -slack) & (below > slack))
    t = above / np.where(passes, above - below, 1.0)
    x = p + t[:, None] * (q - p)
    areas = np.stack([np.einsum("nd,nd->n", np.cross(v - u, x - u), unit) for u, v in ((a, b), (b, c), (c, a))])
    return passes & (areas > CROSSING_TOLERANCE * scale).all(0)


def _overlapping_boxes(corners: np.ndarray) -> np.ndarray:
    """Pairs (i < j) of triangles whose bounding boxes overlap, by descending a binary tree of boxes level by level."""
    low, high = corners.min(1), corners.max(1)
    n = len(corners)
    order = np.argsort(_morton((low + high) / 2), kind="stable")
    levels = [(low[order], high[order])]
    while len(levels[-1][0]) > 1:
        lo, hi = levels[-1]
        if len(lo) % 2:
            lo, hi = np.concatenate([lo, np.full((1, 3), np.inf)]), np.concatenate([hi, np.full((1, 3), -np.inf)])
            levels[-1] = (lo, hi)
        levels.append((np.minimum(lo[::2], lo[1::2]), np.maximum(hi[::2], hi[1::2])))
    i = j = np.zeros(1, np.int64)
    for lo, hi in reversed(levels[:-1]):
        same = i == j
        i, j = (
            np.concatenate([2 * i, 2 * i + 1, 2 * i, 2 * i[~same] + 1]),
            np.concatenate([2 * j, 2 * j + 1, 2 * j + 1, 2 * j[~same]]),
        )
        overlap = (lo[i] <= hi[j]).all(1) & (lo[j] <= hi[i]).all(1)
        i, j = i[overlap], j[overlap]
    i, j = i[i != j], j[i != j]
    inside = (i < n) & (j < n)
    return np.sort(np.stack([order[i[inside]], order[j[inside]]], axis=1), axis=1)


def _morton(points: np.ndarray) -> np.ndarray:
    """Interleave the bits of the coordinates, so that near points get near numbers."""
    lowest = points.min(0)
    extent = max(np.ptp(points, axis=0).max(), np.finfo(float).tiny)
    grid = ((points - lowest) / extent * (2**_MORTON_BITS - 1)).astype(np.int64)
    code = np.zeros(len(points), np.int64)
    for bit in range(_MORTON_BITS):
        for axis in range(3):
            code |= ((grid[:, axis] >> bit) & 1) << (3 * bit + axis)
    return code
