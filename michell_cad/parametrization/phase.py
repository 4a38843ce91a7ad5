"""Where the integers of a coordinate lie: isosurfaces that keep clear of the boundary they would graze.

Arora et al. 2019 leave the phase of each coordinate to the normalisation (the lowest value becomes an integer), so that
it is luck whether an isosurface runs through the part, along its boundary, or in and out of it. Where a face of the
part is nearly an isosurface of the coordinate itself, a layer just below it is useless: its curves wander over the face
and their members are too short to build. Any shift of a coordinate is as good for the stress, so the one is taken that
keeps the integers away from such faces.
"""

import numpy as np
from jaxtyping import Float

from michell_cad.tet_mesh import TetMesh

_BINS = 64
"""Phases tried."""
_WIDTH = 0.12
"""Standard deviation, in cells, of the zone around a face that is to be kept clear."""
_SHARPNESS = 8
"""Exponent of the cosine between a face's normal and the gradient: only faces that are nearly isosurfaces count."""


def choose_phases(mesh: TetMesh, levels: Float[np.ndarray, "n_v 3"]) -> Float[np.ndarray, " 3"]:
    """For each coordinate (in cells) the shift in [0, 1) that keeps its integers clear of faces it would graze.

    Minimises over s the sum over boundary triangles of area |cos(n, g_i)|^8 k(phi_i + s), k the periodic Gaussian
    around the integers, phi_i taken at the middles of the triangle's edges.
    """
    tets = mesh.face_tets[mesh.boundary_faces, 0]
    gradients = mesh.gradients(levels, tets)
    length = np.linalg.norm(gradients, axis=2) * np.linalg.norm(mesh.boundary_area_vectors, axis=1)[:, None]
    cosine = np.einsum("bid,bd->bi", gradients, mesh.boundary_area_vectors) / np.maximum(length, np.finfo(float).tiny)
    weights = np.linalg.norm(mesh.boundary_area_vectors, axis=1)[:, None] * np.abs(cosine) ** _SHARPNESS
    corners = levels[mesh.boundary_triangles]
    middles = (corners + np.roll(corners, 1, axis=1)) / 2
    phases = np.zeros(3)
    bins = np.arange(_BINS) / _BINS
    # exp(cos) is the periodic bump; its width at the top is that of the Gaussian.
    kernel = np.exp((np.cos(2 * np.pi * bins) - 1) / (2 * np.pi * _WIDTH) ** 2)
    for i in range(3):
        index = np.floor(middles[:, :, i] % 1.0 * _BINS).astype(np.int64) % _BINS
        density = np.bincount(index.ravel(), np.repeat(weights[:, i], 3), _BINS)
        # cost of the shift s: the faces at phase t with t + s = 0 modulo 1
        cost = np.real(np.fft.ifft(np.fft.fft(density) * np.fft.fft(kernel)))[-np.arange(_BINS) % _BINS]
        phases[i] = bins[int(np.argmin(cost))]
    return phases
