"""Outline -> tet mesh whose boundary lies on the part and knows its faces.

Source: fTetWild (Hu et al. 2020, "Fast Tetrahedral Meshing in the Wild", doi:10.1145/3386569.3392385) through
pytetwild. fTetWild keeps the surface only within an envelope, so three steps follow it:

1. every boundary triangle gets the face of the part that is nearest to it and points the same way;
2. boundary vertices move back: to a corner of the part where three faces meet, to an edge where two meet, else to the
   surface; a move that would flatten a tet is taken back;
3. the mesh is checked: one connected solid with a manifold boundary, all tets positive, the volume right within 1 %. If
   a check fails, the envelope is halved and the mesher runs again.

fTetWild orders its work by a hardware random source that cannot be seeded, so two runs on one part give slightly
different meshes of equal quality. Whoever needs the very same mesh twice saves it, and gives the saved file as part.
"""

import logging
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from michell_cad.domain.outline import Outline, Part, Surface
from michell_cad.errors import GeometryKernelError, InvalidInputError
from michell_cad.tet_mesh import TetMesh

TETS_PER_CUBE = 8.5
"""Tets per cube of the mesh size, measured on parts meshed by fTetWild (5.4 on a sphere, 10 on a box)."""

IDEAL_EDGE_RATIO = 1.2
"""fTetWild's ideal edge over the median edge that it delivers (measured: 1.0 on thin plates, 1.3 on boxes)."""

FEWEST_TETS, MOST_DEFAULT_TETS = 18_000, 60_000
"""The default mesh size gives between these numbers of tets, as the paper's problems have: fewer leave the stress too
coarse, more only cost time. In between, the part is `DEFAULT_CELLS` edges long."""

DEFAULT_CELLS = 24
"""Cells along the part at the default resolution; a tet edge should not be longer than a cell."""

LAYERS_IN_A_WALL = 2
"""Tets that a thin wall should have across, if `MOST_DEFAULT_TETS` allows it."""

MOST_TETS = 1_500_000
"""More are refused: the elasticity factor of a million tets takes 4.5 GB."""

ENVELOPE = 1 / 30
"""fTetWild's envelope over its ideal edge: its envelope test samples at this distance, so the cost grows with the
inverse square (a box took 1 s with 1/45 and 34 s with 1/450)."""

LARGEST_ENVELOPE = 2e-3
"""The envelope over the diagonal is at most this, so that coarse meshes of round parts keep their volume (relative)."""

WALL_ENVELOPE, THIN_QUANTILE = 0.1, 0.05
"""The envelope is at most this fraction of the thickness that all but the thinnest 5 % of the surface exceed, so that
two sides of a wall stay apart (relative)."""

SMALLEST_ENVELOPE = 1 / 120
"""The envelope over the ideal edge is at least this, for the sake of time; wedges have walls of no thickness at all."""

VOLUME_TOLERANCE = 0.01
"""Largest difference between the volumes of mesh and part (relative)."""

ATTEMPTS = 3
"""Runs of the mesher, each with half the envelope of the one before, until all checks pass."""

EDGE_REACH = 0.25
"""A vertex where faces meet moves to their edge if that is nearer than this fraction of the mesh size; sharp edges lie
within the envelope, smooth ones (fillets) anywhere, and long moves would spoil the tets."""

LEAST_QUALITY = 0.1
"""A move is taken back if it leaves a tet of lower quality than this (see `tet_quality`, 1 for a regular tet), unless
the tet was hardly better before."""

logger = logging.getLogger(__name__)

Progress = Callable[[str], None]


def default_mesh_size(outline: Outline) -> float:
    """Choose a mesh size (median tet edge, mm) from the part's volume, length and thinnest walls."""
    volume = outline.volume
    coarsest = (TETS_PER_CUBE * volume / FEWEST_TETS) ** (1 / 3)
    finest = (TETS_PER_CUBE * volume / MOST_DEFAULT_TETS) ** (1 / 3)
    length = float(np.ptp(outline.surface.vertices, axis=0).max())
    wanted = min(length / DEFAULT_CELLS, wall_thickness(outline.surface) / LAYERS_IN_A_WALL)
    return float(np.clip(wanted, finest, coarsest))


def forecast_tets(volume: float, mesh_size: float) -> int:
    """Forecast the number of tets for a volume (mm^3) and a mesh size (mm); small features come on top."""
    return round(TETS_PER_CUBE * volume / mesh_size**3)


def wall_thickness(surface: Surface, quantile: float = 0.1, samples: int = 400) -> float:
    """Thickness (mm) that all but the fraction `quantile` of the surface exceed.

    Measured by rays straight into the part from a sample of its triangles.
    """
    areas, normals = surface.areas, surface.area_vectors / np.maximum(surface.areas, np.finfo(float).tiny)[:, None]
    # Systematic sampling by area: deterministic, and large triangles are sampled in proportion.
    position = (np.arange(samples) + 0.5) / samples * areas.sum()
    chosen = np.searchsorted(np.cumsum(areas), position).clip(max=len(areas) - 1)
    origins, directions = surface.centroids[chosen], -normals[chosen]
    a, b, c = surface.vertices[surface.triangles].transpose(1, 0, 2)
    nearest = np.full(samples, np.inf)
    for k in range(samples):
        # Moeller-Trumbore, one ray against all triangles.
        p = np.cross(directions[k], c - a)
        det = np.einsum("bd,bd->b", b - a, p)
        inverse = np.divide(1.0, det, out=np.zeros_like(det), where=np.abs(det) > np.finfo(float).tiny)
        s = origins[k] - a
        u = np.einsum("bd,bd->b", s, p) * inverse
        q = np.cross(s, b - a)
        v = q @ directions[k] * inverse
        t = np.einsum("bd,bd->b", c - a, q) * inverse
        hit = (inverse != 0) & (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-6 * surface.diagonal)
        if hit.any():
            nearest[k] = t[hit].min()
    return float(np.quantile(nearest[np.isfinite(nearest)], quantile)) if np.isfinite(nearest).any() else np.inf


def check_mesh_size(outline: Outline, mesh_size: float | None) -> float:
    """Return the mesh size to use (mm), the default if none is given; refuse one that cannot be meshed."""
    if mesh_size is None:
        return default_mesh_size(outline)
    length = float(np.ptp(outline.surface.vertices, axis=0).max())
    if not (np.isfinite(mesh_size) and 0 < mesh_size <= length):
        raise InvalidInputError(
            f"[mesh] size: expected a length in mm above 0 and at most the part's {length:.4g} mm, "
            f"found {mesh_size:g}; a good size is {default_mesh_size(outline):.3g} mm"
        )
    tets = forecast_tets(outline.volume, mesh_size)
    if tets > MOST_TETS:
        least = (TETS_PER_CUBE * outline.volume / MOST_TETS) ** (1 / 3)
        raise InvalidInputError(
            f"[mesh] size: {mesh_size:g} mm would make about {tets:,} tets, more than the {MOST_TETS:,} allowed; "
            f"use at least {least:.3g} mm (the default is {default_mesh_size(outline):.3g} mm)"
        )
    return float(mesh_size)


def mesh_outline(outline: Outline, mesh_size: float | None = None, progress: Progress | None = None) -> Part:
    """Fill an outline with tets of a given size (median edge, mm; default: from the part).

    An outline that has its tets already (a tet file) keeps them, whatever the mesh size.

    Raises
    ------
    InvalidInputError
        For a mesh size that is not positive, larger than the part, or too small to compute with.
    GeometryKernelError
        If the mesher delivers no mesh that passes the checks.
    """
    if outline.mesh is not None:
        return Part(outline, outline.mesh)
    size = check_mesh_size(outline, mesh_size)
    ideal = IDEAL_EDGE_RATIO * size
    wall = wall_thickness(outline.surface, THIN_QUANTILE)
    envelope = min(ENVELOPE * ideal, LARGEST_ENVELOPE * outline.surface.diagonal, WALL_ENVELOPE * wall)
    envelope = max(envelope, SMALLEST_ENVELOPE * ideal)
    found = ""
    for attempt in range(ATTEMPTS):
        if progress is not None:
            again = f", attempt {attempt + 1}" if attempt else ""
            progress(f"about {forecast_tets(outline.volume, size):,} tets of {size:.3g} mm{again}")
        V, T = _run_mesher(outline.surface, ideal, envelope / 2**attempt)
        V, T = _tidy(V, T)
        found = _find_fault(V, T)
        if found:
            continue
        labels = classify_triangles(TetMesh(V, T), outline.surface)
        V = _project(V, T, labels, outline.surface, size)
        mesh = TetMesh(V, T)
        error = mesh.volumes.sum() / outline.volume - 1
        if abs(error) <= VOLUME_TOLERANCE:
            return Part(outline, TetMesh(V, T, classify_triangles(mesh, outline.surface)))
        found = f"its volume differs by {100 * error:.2g} % from the part's"
    raise GeometryKernelError(
        f"{outline.name}: no usable tet mesh of size {size:.3g} mm after {ATTEMPTS} attempts: {found}; "
        f"try [mesh] size = {size / 2:.2g}, or give a tet mesh (.msh, .vtu)"
    )


def _run_mesher(surface: Surface, ideal: float, envelope: float) -> tuple[np.ndarray, np.ndarray]:
    """Run fTetWild in a process of its own; no tets if it fails."""
    middle = surface.vertices.mean(0)
    with tempfile.TemporaryDirectory(prefix="michell_cad_") as folder:
        given, made = Path(folder, "in.npz"), Path(folder, "out.npz")
        np.savez(
            given,
            vertices=surface.vertices - middle,
            triangles=surface.triangles,
            ideal_edge=ideal,
            envelope=envelope / surface.diagonal,
        )
        worker = Path(__file__).with_name("tetwild_worker.py")
        run = subprocess.run(
            [sys.executable, str(worker), str(given), str(made)],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
        )
        if run.returncode or not made.is_file():
            logger.warning("fTetWild ended with code %d: %s", run.returncode, run.stderr.strip()[-300:])
            return np.zeros((0, 3)), np.zeros((0, 4), np.int64)
        with np.load(made) as arrays:
            return arrays["vertices"] + middle, arrays["tets"]


def _tidy(V: np.ndarray, T: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Orient the tets positively as a whole, and drop vertices that none of them uses."""
    if not len(T):
        return V, T
    if _six_volumes(V, T).sum() < 0:
        T = T[:, [0, 1, 3, 2]]
    used, T = np.unique(T, return_inverse=True)
    return V[used], T.reshape(-1, 4)


def _find_fault(V: np.ndarray, T: np.ndarray) -> str:
    """Say what keeps the tets from being one solid with a manifold boundary, or return an empty text."""
    if not len(T):
        return "it has no tets"
    inverted = int((_six_volumes(V, T) <= 0).sum())
    if inverted:
        return f"{inverted} of its tets are flat or inverted"
    mesh = TetMesh(V, T)
    inner = mesh.face_tets[mesh.face_tets[:, 1] >= 0]
    graph = coo_matrix((np.ones(len(inner)), (inner[:, 0], inner[:, 1])), shape=(len(T),) * 2)
    parts = connected_components(graph, directed=False)[0]
    if parts > 1:
        return f"it falls into {parts} parts"
    import igl

    F = np.ascontiguousarray(mesh.boundary_triangles)
    if not (igl.is_edge_manifold(F)[0] and np.asarray(igl.is_vertex_manifold(F))[np.unique(F)].all()):
        return "its boundary touches itself at an edge or a vertex"
    return ""


# --- faces of the boundary -------------------------------------------------------------------------------------------


def classify_triangles(mesh: TetMesh, surface: Surface) -> Int[np.ndarray, " n_b"]:
    """Number of the face of `surface` on which each boundary triangle of the mesh lies.

    Nearest by centroid alone picks the wrong face beside a sharp edge, where a triangle may hang over by the envelope.
    So of the faces near each triangle the one counts that minimises distance^2 + area (1 - cosine of the normals).
    """
    triangles = mesh.boundary_triangles
    centroids = mesh.vertices[triangles].mean(1)
    areas = np.linalg.norm(mesh.boundary_area_vectors, axis=1)
    normals = mesh.boundary_area_vectors / areas[:, None]
    labels = np.full(len(triangles), -1)
    lowest = np.full(len(triangles), np.inf)
    unit = surface.area_vectors / np.maximum(surface.areas, np.finfo(float).tiny)[:, None]
    lo, hi = _face_boxes(surface)
    reach = _distances(centroids, surface.vertices, surface.triangles)[0] ** 0.5 + np.sqrt(areas)
    for number in range(len(lo)):
        near = np.flatnonzero(
            ((centroids >= lo[number] - reach[:, None]) & (centroids <= hi[number] + reach[:, None])).all(1)
        )
        own = np.flatnonzero(surface.face_numbers == number)
        if not len(near) or not len(own):
            continue
        squared, hit, _ = _distances(centroids[near], surface.vertices, surface.triangles[own])
        cost = squared + areas[near] * (1 - np.einsum("bd,bd->b", normals[near], unit[own[hit]]))
        better = cost < lowest[near]
        labels[near[better]] = number
        lowest[near[better]] = cost[better]
    return labels


def _face_boxes(surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    corners = surface.vertices[surface.triangles]
    n = surface.face_numbers.max() + 1
    lo, hi = np.full((n, 3), np.inf), np.full((n, 3), -np.inf)
    np.minimum.at(lo, surface.face_numbers, corners.min(1))
    np.maximum.at(hi, surface.face_numbers, corners.max(1))
    return lo, hi


def _distances(points: np.ndarray, V: np.ndarray, elements: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Squared distance, nearest element and nearest point of triangles, edges or points."""
    import igl

    squared, hit, nearest = igl.point_mesh_squared_distance(
        np.ascontiguousarray(points), np.ascontiguousarray(V), np.ascontiguousarray(elements)
    )
    return np.asarray(squared), np.asarray(hit), np.asarray(nearest)


# --- back to the surface ---------------------------------------------------------------------------------------------


def _project(V: np.ndarray, T: np.ndarray, labels: np.ndarray, surface: Surface, size: float) -> np.ndarray:
    """Move the boundary vertices to the corners, edges and faces of the part to which their triangles belong."""
    mesh = TetMesh(V, T)
    target = _targets(mesh, labels, surface, size)
    quality = tet_quality(V, T)
    least = np.minimum(LEAST_QUALITY, 0.5 * quality)
    moved = (target != V).any(1)
    # A tet that a move would spoil keeps its old vertices; each round frees fewer vertices, so the loop ends.
    while True:
        new = np.where(moved[:, None], target, V)
        bad = T[tet_quality(new, T) < least]
        blocked = np.zeros(len(V), bool)
        blocked[bad] = True
        if not (blocked & moved).any():
            return new
        moved &= ~blocked


def _targets(mesh: TetMesh, labels: np.ndarray, surface: Surface, size: float) -> Float[np.ndarray, "n_v 3"]:
    """Where each vertex of the mesh belongs."""
    V, triangles = mesh.vertices, mesh.boundary_triangles
    target = V.copy()
    pairs = np.unique(np.stack([triangles.ravel(), np.repeat(labels, 3)], axis=1), axis=0)
    vertices, starts, counts = np.unique(pairs[:, 0], return_index=True, return_counts=True)
    edges, edge_faces, corners, corner_faces = _outline_edges(surface)
    # One face: the nearest point of that face.
    single = counts == 1
    for number in np.unique(pairs[starts[single], 1]):
        mine = vertices[single][pairs[starts[single], 1] == number]
        target[mine] = _distances(V[mine], surface.vertices, surface.triangles[surface.face_numbers == number])[2]
    # Several faces: the edge or corner where they meet if it is near, else the nearest point of the surface.
    shared = vertices[~single]
    if len(shared):
        target[shared] = _distances(V[shared], surface.vertices, surface.triangles)[2]
    reach = (EDGE_REACH * size) ** 2
    faces_of = {
        int(v): frozenset(pairs[s : s + c, 1].tolist()) for v, s, c in zip(vertices, starts, counts, strict=True)
    }
    by_faces: dict[frozenset, list[int]] = {}
    for vertex in shared.tolist():
        by_faces.setdefault(faces_of[vertex], []).append(vertex)
    for faces, members in by_faces.items():
        mine = np.array(members)
        if len(faces) >= 3:
            # Two such vertices at one corner would collapse; the nearest alone goes there.
            candidates = [k for k, meeting in enumerate(corner_faces) if faces <= meeting]
            if candidates:
                squared, hit, nearest = _distances(V[mine], surface.vertices, corners[candidates][:, None])
                first = np.lexsort((squared, hit))
                chosen = first[np.unique(hit[first], return_index=True)[1]]
                chosen = chosen[squared[chosen] <= reach]
                target[mine[chosen]] = nearest[chosen]
                mine = np.delete(mine, chosen)
        own = (
            np.array([set(pair) <= faces for pair in edge_faces.tolist()], bool)
            if len(edge_faces)
            else np.zeros(0, bool)
        )
        if own.any() and len(mine):
            squared, _, nearest = _distances(V[mine], surface.vertices, edges[own])
            near = squared <= reach
            target[mine[near]] = nearest[near]
    return target


def _outline_edges(surface: Surface) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[frozenset]]:
    """Edges between two faces of the outline, their two faces, the corners (three or more faces) and their faces."""
    F, numbers = surface.triangles, surface.face_numbers
    sides = np.sort(F[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    order = np.lexsort((sides[:, 1], sides[:, 0]))
    first, second = order[::2], order[1::2]
    faces = np.sort(np.stack([numbers[first // 3], numbers[second // 3]], axis=1), axis=1)
    border = faces[:, 0] != faces[:, 1]
    edges, faces = sides[first][border], faces[border]
    at = np.unique(np.stack([F.ravel(), np.repeat(numbers, 3)], axis=1), axis=0)
    vertices, starts, counts = np.unique(at[:, 0], return_index=True, return_counts=True)
    corner = counts >= 3
    meeting = [frozenset(at[s : s + c, 1].tolist()) for s, c in zip(starts[corner], counts[corner], strict=True)]
    return edges, faces, vertices[corner], meeting


def tet_quality(vertices: Float[np.ndarray, "n_v 3"], tets: Int[np.ndarray, "n_t 4"]) -> Float[np.ndarray, " n_t"]:
    """6 sqrt(2) volume / (rms edge)^3 of each tet: 1 for a regular tet, 0 for a flat one, negative if inverted."""
    X = vertices[tets]
    squares = sum(((X[:, i] - X[:, j]) ** 2).sum(1) for i in range(4) for j in range(i))
    return np.sqrt(2) * _six_volumes(vertices, tets) / (squares / 6) ** 1.5


def _six_volumes(V: np.ndarray, T: np.ndarray) -> np.ndarray:
    a, b, c, d = V[T].transpose(1, 0, 2)
    return np.einsum("td,td->t", np.cross(b - a, c - a), d - a)
