"""Where the integers of a coordinate lie: isosurfaces that keep clear of the boundary they would graze.

Arora et al. 2019 leave the phase of each coordinate to the normalisation (the lowest value becomes an integer), so that
it is luck whether an isosurface runs through the part, along its boundary, or in and out of it. Where a face of the
part is nearly an isosurface of the coordinate itself, a layer just below it is useless: its curves wander over the face
and their members are too short to build. Any shift of a coordinate is as good for the stress, so the one is taken that
keeps the integers away from such faces.

The opposite can be wanted, too: a truss whose layers hug the part, with skins of members along its faces and whole
cells between them. Then the integers are drawn to just inside such faces, and a stretch of the coordinate by a few per
cent lets both of two opposite faces have one.
"""

from typing import Any

import numpy as np
from jaxtyping import Float

from michell_cad.compiled import compiled
from michell_cad.tet_mesh import TetMesh

_BINS = 64
"""Phases tried."""
_WIDTH = 0.12
"""Standard deviation, in cells, of the zone around a face that is to be kept clear."""
CLEARANCE = 0.1
"""Cells between a face and the layer that hugs it: far enough for its curves to stay inside where the face is nearly an
isosurface, and so near that cleaning, which collapses members below 0.4 cells, lays its members on the face."""
HUG_WIDTH = 0.05
"""Standard deviation, in cells, of the zone around its place in which a layer counts as hugging: half the clearance."""
MOST_STRETCH = 0.05
"""Largest relative change of the spacing of a coordinate; enough to fit whole cells into any length above ten."""
_STRETCHES = 40
"""Stretches tried on either side of one."""
_STRETCH_COST = 0.2
"""A stretch of 5 per cent has to gain 1 per cent: between stretches that do about as well the least one is taken."""
_SHARPNESS = 8
"""Exponent of the cosine between a face's normal and the gradient: only faces that are nearly isosurfaces count."""


def choose_phases(mesh: TetMesh, levels: Float[np.ndarray, "n_v 3"]) -> Float[np.ndarray, " 3"]:
    """For each coordinate (in cells) the shift in [0, 1) that keeps its integers clear of faces it would graze.

    Minimises over s the sum over boundary triangles of area |cos(n, g_i)|^8 k(phi_i + s), k the periodic Gaussian
    around the integers, phi_i taken at the middles of the triangle's edges.
    """
    weights, middles, _ = _grazed_faces(mesh, levels)
    kernel = _periodic_bump(_WIDTH)
    costs = [_correlate(middles[:, :, i].ravel(), np.repeat(weights[:, i], 3), kernel) for i in range(3)]
    return np.argmin(costs, axis=1) / _BINS


def hug_faces(
    mesh: TetMesh, levels: Float[np.ndarray, "n_v 3"]
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """For each coordinate the stretch f and the shift s that lay isosurfaces just inside the faces they run along.

    Maximises over f in 1 +- `MOST_STRETCH` and s in [0, 1) the sum over boundary triangles of area |cos(n, g_i)|^8
    k(f phi_i -+ `CLEARANCE` + s), k the periodic Gaussian around the integers: an integer lies `CLEARANCE` cells inside
    the face, below it where the outward normal points up the gradient g_i, else above it. One shift can suit one face;
    the stretch is what suits the opposite one, too. Between about equals the least stretch is taken.
    """
    weights, middles, outward = _grazed_faces(mesh, levels)
    kernel = _periodic_bump(HUG_WIDTH)
    stretches, shifts = np.ones(3), np.zeros(3)
    tried = 1 + MOST_STRETCH * np.linspace(-1, 1, 2 * _STRETCHES + 1)
    for i in range(3):
        inside = -CLEARANCE * np.repeat(np.sign(outward[:, i]), 3)
        gains = np.array(
            [_correlate(f * middles[:, :, i].ravel() + inside, np.repeat(weights[:, i], 3), kernel) for f in tried]
        )
        gains -= _STRETCH_COST * gains.max() * np.abs(tried - 1)[:, None]
        best = np.unravel_index(int(np.argmax(gains)), gains.shape)
        stretches[i], shifts[i] = tried[best[0]], best[1] / _BINS
    return stretches, shifts


def _grazed_faces(mesh: TetMesh, levels: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of each boundary triangle: weights (n_b, 3), levels at the middles of its edges (n_b, 3 middles, 3), and the
    cosines (n_b, 3) between the outward normal and the gradients.
    """
    gradients = mesh.gradients(levels, mesh.face_tets[mesh.boundary_faces, 0])
    n = len(gradients)
    weights, middles, cosines = np.empty((n, 3)), np.empty((n, 3, 3)), np.empty((n, 3))
    values = np.ascontiguousarray(levels, np.float64)
    weigh_faces(mesh.boundary_triangles, mesh.boundary_area_vectors, values, gradients, weights, middles, cosines)
    return weights, middles, cosines


def _weigh_faces(
    triangles: Any, area_vectors: Any, levels: Any, gradients: Any, weights: Any, middles: Any, cosines: Any
) -> None:
    for t in range(len(triangles)):
        N = area_vectors[t]
        area = np.sqrt(N[0] ** 2 + N[1] ** 2 + N[2] ** 2)
        for i in range(3):
            g = gradients[t, i]
            size = np.sqrt(g[0] ** 2 + g[1] ** 2 + g[2] ** 2)
            cosine = (g[0] * N[0] + g[1] * N[1] + g[2] * N[2]) / (size * area) if size > 0 else 0.0
            cosines[t, i], weights[t, i] = cosine, area * abs(cosine) ** _SHARPNESS
            for side in range(3):
                middles[t, side, i] = (levels[triangles[t, side], i] + levels[triangles[t, side - 1], i]) / 2


weigh_faces = compiled(_weigh_faces)


def _periodic_bump(width: float) -> np.ndarray:
    """The bump exp((cos 2 pi x - 1)/(2 pi width)^2) at the bins; its width at the top is that of the Gaussian."""
    return np.exp((np.cos(2 * np.pi * np.arange(_BINS) / _BINS) - 1) / (2 * np.pi * width) ** 2)


def _correlate(values: np.ndarray, weights: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    """For each shift s (a bin) the sum of weight k(value + s): values at phase t meet an integer where t + s = 0."""
    density = np.zeros(_BINS)
    fill_bins(values, weights, density)
    return np.real(np.fft.ifft(np.fft.fft(density) * np.fft.fft(kernel)))[-np.arange(_BINS) % _BINS]


def _fill_bins(values: Any, weights: Any, density: Any) -> None:
    for n in range(len(values)):
        density[int((values[n] - np.floor(values[n])) * _BINS) % _BINS] += weights[n]


fill_bins = compiled(_fill_bins)
