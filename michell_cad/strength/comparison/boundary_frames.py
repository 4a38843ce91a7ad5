"""Smooth frames that know the boundary of a part and nothing of its stress.

At the boundary one axis, whichever, is to be the normal n, as meshers of hexahedra ask (Huang, Tong, Wei and Bao 2011,
doi:10.1145/2024156.2024177, whose spherical harmonics are this quartic):

    minimise  -1/|S| sum_b a_b sum_i (r_i . n_b)^4  +  alpha / (2 |V|) integral of l^2 |grad w|^2,   l = |V|^(1/3),

over the boundary triangles b of area a_b, for falling alpha; the first term is -1 where all are aligned. Frames are
those of `frame_field`: R = R0 exp [w]_x with a rotation vector w at every vertex, the mean of its corners on a triangle
or in a tet. A sharp edge has two normals, and both are heard: those of its two triangles.

Departure: axes do not change places around singular curves, since the coordinates of this package are one chart. On a
round part the frames turn with the normal over a quarter of it, and back across a strip as narrow as the mesh allows,
as on a round peg in a square hole.
"""

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from michell_cad.constant_frames import rotation_grid
from michell_cad.minimize import minimize
from michell_cad.part_axes import part_axes
from michell_cad.rotations import rotate_back, rotation_matrix
from michell_cad.tet_mesh import TetMesh

SMOOTHNESS = (1.0, 1e-1, 1e-2, 1e-3)
"""Weights alpha, one round each (relative to an alignment of order one). At 1e-3 the normals of most of the paper's
parts are met within a few degrees, and strips where frames turn back are still wider than a tet."""

ITERATIONS, TOLERANCE = 200, 1e-6
"""Of each round; an evaluation visits the boundary only, and costs little."""

CONSTANT_ITERATIONS, CONSTANT_TOLERANCE = 60, 1e-12
"""For one frame for all of the boundary: three unknowns, found to rounding, so that turning the part turns them."""


def fit_boundary_frames(mesh: TetMesh) -> tuple[Float[np.ndarray, "n_t 3 3"], Float[np.ndarray, "n_b 3 3"]]:
    """Right-handed orthonormal frames (columns) in the tets and on the boundary triangles."""
    areas, normals = boundary_normals(mesh)
    R0 = best_constant_frame(mesh)
    local, corners = normals @ R0, mesh.boundary_triangles
    laplacian = mesh.size**2 * mesh.laplacian() / mesh.volumes.sum()
    # The second derivative of the alignment is of order one per triangle; a corner takes part with a third.
    alignment_diagonal = np.bincount(corners.ravel(), np.repeat(areas / 3, 3), len(mesh.vertices))
    w = np.zeros((len(mesh.vertices), 3))
    for alpha in SMOOTHNESS:
        H = sp.csr_matrix(alpha * laplacian)
        diagonal = (H.diagonal() + alignment_diagonal)[:, None]

        def energy(w: np.ndarray, H: sp.csr_matrix = H) -> tuple[float, np.ndarray]:
            gradient = H @ w
            smooth = 0.5 * float(np.vdot(w, gradient))
            value, on_triangles = boundary_alignment(areas, local, w[corners].mean(1))
            np.add.at(gradient, corners, on_triangles[:, None] / 3)
            return smooth + value, gradient

        w, _ = minimize(energy, w, lambda g, d=diagonal: g / d, iterations=ITERATIONS, tolerance=TOLERANCE)
    return R0 @ rotation_matrix(w[mesh.tets].mean(1)), R0 @ rotation_matrix(w[corners].mean(1))


def best_constant_frame(mesh: TetMesh) -> Float[np.ndarray, "3 3"]:
    """The one frame that is aligned best with all of the boundary; found from a grid of rotations of the part's axes,
    so that turning the part turns the result.

    For one frame the sum over the triangles is a polynomial, T_ijkl r_i r_j r_k r_l for each axis r with the moments
    T_ijkl = sum_b a_b n_i n_j n_k n_l.
    """
    areas, normals = boundary_normals(mesh)
    axes = part_axes(mesh)
    squares = np.einsum("bi,bj->bij", normals @ axes, normals @ axes).reshape(-1, 9)
    T = (squares.T @ (areas[:, None] * squares)).reshape(3, 3, 3, 3)

    def energy(w: np.ndarray) -> tuple[float, np.ndarray]:
        R = rotation_matrix(w)[0]
        along = np.einsum(
            "ijkl,im,ja,ka,la->am", T, R, R, R, R, optimize=True
        )  # a quarter of the gradients at the axes, along these
        return -float(np.trace(along)), rotate_back(w, -4 * np.cross(np.eye(3), along).sum(0, keepdims=True))

    starts = Rotation.from_matrix(rotation_grid()).as_rotvec()
    found = [
        minimize(energy, w[None], lambda g: g, iterations=CONSTANT_ITERATIONS, tolerance=CONSTANT_TOLERANCE)
        for w in starts
    ]
    w, _ = min(found, key=lambda pair: pair[1].value)
    return axes @ rotation_matrix(w[0])


def boundary_normals(mesh: TetMesh) -> tuple[Float[np.ndarray, " n_b"], Float[np.ndarray, "n_b 3"]]:
    """Areas of the boundary triangles over that of all of them, and their outward unit normals."""
    areas = np.linalg.norm(mesh.boundary_area_vectors, axis=1)
    return areas / areas.sum(), mesh.boundary_area_vectors / areas[:, None]


def boundary_alignment(
    areas: Float[np.ndarray, " n_b"], normals: Float[np.ndarray, "n_b 3"], w: Float[np.ndarray, "n_b 3"]
) -> tuple[float, Float[np.ndarray, "n_b 3"]]:
    """-sum_b a_b sum_i c_i^4 with c = R' n, R = exp [w]_x, and its gradient by w.

    Under R -> R exp [d]_x the components change by dc = c x d, and the value by d . (4 a c x c^3).
    """
    c = np.einsum("bdi,bd->bi", rotation_matrix(w), normals)
    return -float(areas @ (c**4).sum(1)), areas[:, None] * rotate_back(w, 4 * np.cross(c, c**3))
