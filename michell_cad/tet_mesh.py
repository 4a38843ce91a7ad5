"""The tetrahedral mesh that every stage shares, with its piecewise-linear gradients, boundary and sharp features.

Piecewise-linear (P1) elements on tets as in any finite-element text; the sharp-feature rule is the one of the
reference implementation of Arora et al. 2019 (dihedral angle of the surface above arccos 0.9).
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float, Int
from scipy.sparse.csgraph import connected_components

from michell_cad.arrays import freeze, frozen, require
from michell_cad.compiled import compiled

EXTREME = 1e30
"""Meshes larger than this (mm), or smaller than its inverse, are mistakes; between, no volume over- or underflows."""

FEATURE_COSINE = 0.9
"""A boundary edge is sharp when the normals of its two triangles have a smaller cosine (about 25 degrees)."""

_LOCAL_FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
"""Face k of a positive tet is opposite to its vertex k; its normal by the right-hand rule points outwards."""

_LOCAL_EDGES = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])
_FACE_EDGES = np.array([[3, 5, 4], [2, 5, 1], [0, 4, 2], [1, 3, 0]])
"""Local edges between the vertices 01, 12, 20 of each local face."""


@dataclass(frozen=True, eq=False)
class TetMesh:
    """A tetrahedral mesh with positively oriented tets.

    Parameters
    ----------
    vertices : (n_v, 3) float, mm.
    tets : (n_t, 4) int. Negatively oriented tets are reoriented (their last two vertices are swapped).
    cad_faces : (n_b,) int, optional
        Number of the CAD face on which each boundary triangle lies, in the order of `boundary_triangles`;
        -1 where there is none. Default: all -1.

    Raises
    ------
    InvalidInputError
        For wrong shapes, indices out of range, coordinates that are not finite, tets without volume, vertices that
        no tet uses, or a face shared by more than two tets.
    """

    vertices: Float[np.ndarray, "n_v 3"]
    tets: Int[np.ndarray, "n_t 4"]
    cad_faces: Int[np.ndarray, " n_b"] = field(default_factory=lambda: np.zeros(0, np.int64))

    def __post_init__(self) -> None:
        freeze(self, vertices=np.float64, tets=np.int64)
        V, T = self.vertices, self.tets
        require(V.ndim == 2 and V.shape[1] == 3, f"vertices must have shape (n_v, 3), found {V.shape}")
        require(T.ndim == 2 and T.shape[1] == 4 and len(T), f"tets must have shape (n_t, 4), n_t >= 1, found {T.shape}")
        require(np.isfinite(V).all(), f"vertices must be finite; vertex {_first(~np.isfinite(V).all(1))} is not")
        require(
            T.min() >= 0 and T.max() < len(V),
            f"tets must index the {len(V)} vertices, found indices from {T.min()} to {T.max()}",
        )
        unused = np.ones(len(V), bool)
        unused[T] = False
        require(not unused.any(), f"every vertex must belong to a tet; {unused.sum()} do not, first {_first(unused)}")
        reach = float(np.abs(V).max())
        extent = reach if reach > EXTREME else float(np.ptp(V, axis=0).max())
        require(
            extent == 0 or 1 / EXTREME <= extent <= EXTREME,
            f"the mesh must measure between {1 / EXTREME:g} and {EXTREME:g} mm, found {extent:.3g}; check the unit",
        )
        six_volumes = _six_volumes(V, T)
        flat = six_volumes == 0
        require(
            not flat.any(), f"tets must have volume; {flat.sum()} are flat, first tet {_first(flat)}: {T[flat][:1]}"
        )
        if (six_volumes < 0).any():
            T = T.copy()
            negative = six_volumes < 0
            T[negative, 2], T[negative, 3] = self.tets[negative, 3], self.tets[negative, 2]
            object.__setattr__(self, "tets", frozen(T))
        if not len(self.cad_faces):
            object.__setattr__(self, "cad_faces", -np.ones(len(self.boundary_triangles), np.int64))
        freeze(self, cad_faces=np.int64)
        require(
            len(self.cad_faces) == len(self.boundary_triangles),
            f"cad_faces must give one number for each of the {len(self.boundary_triangles)} boundary triangles, "
            f"found {len(self.cad_faces)}",
        )

    # --- elements -----------------------------------------------------------------------------------------------

    @cached_property
    def volumes(self) -> Float[np.ndarray, " n_t"]:
        """Volumes of the tets, mm^3."""
        return frozen(_six_volumes(self.vertices, self.tets) / 6)

    @cached_property
    def hat_gradients(self) -> Float[np.ndarray, "n_t 4 3"]:
        """Gradients of the four barycentric coordinates in each tet, 1/mm.

        The gradient of lambda_k is minus the area vector of the face opposite to vertex k over three volumes.
        """
        X = self.vertices[self.tets][:, _LOCAL_FACES]
        area_vectors = 0.5 * np.cross(X[:, :, 1] - X[:, :, 0], X[:, :, 2] - X[:, :, 0])
        return frozen(-area_vectors / (3 * self.volumes[:, None, None]))

    def gradients(
        self, values: Float[np.ndarray, "n_v k"], tets: Int[np.ndarray, " n"] | None = None
    ) -> Float[np.ndarray, "n k 3"]:
        """Gradients of `k` piecewise-linear functions given at the vertices (row i: gradient of i).

        In the tets with the given numbers; in all of them by default.
        """
        numbers = np.arange(len(self.tets)) if tets is None else tets
        gradients = np.empty((len(numbers), values.shape[1], 3))
        add_gradients(self.tets, numbers, self.hat_gradients, np.ascontiguousarray(values, np.float64), gradients)
        return gradients

    @cached_property
    def gradient_operator(self) -> sp.csr_matrix:
        """The sparse operator G, (3 n_t, n_v): row 3 t + d is the derivative along axis d in tet t, 1/mm."""
        n_t = len(self.tets)
        indices = np.repeat(self.tets, 3, axis=0).ravel()
        data = self.hat_gradients.transpose(0, 2, 1).ravel()
        return sp.csr_matrix((data, indices, np.arange(0, 12 * n_t + 1, 4)), shape=(3 * n_t, len(self.vertices)))

    @cached_property
    def vertex_volumes(self) -> Float[np.ndarray, " n_v"]:
        """A quarter of the volume of the tets around each vertex (the lumped mass matrix), mm^3."""
        weights = np.repeat(self.volumes / 4, 4)
        return frozen(np.bincount(self.tets.ravel(), weights, len(self.vertices)))

    @cached_property
    def centroids(self) -> Float[np.ndarray, "n_t 3"]:
        """Centroids of the tets, mm."""
        return frozen(self.vertices[self.tets].mean(1))

    @cached_property
    def median_edge(self) -> float:
        """Median length of the edges, mm."""
        a, b = self.vertices[self.edges].transpose(1, 0, 2)
        return float(np.median(np.linalg.norm(a - b, axis=1)))

    # --- connectivity -------------------------------------------------------------------------------------------

    @cached_property
    def _face_numbering(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Faces (sorted vertices, n_f x 3), the faces of each tet (n_t x 4), the two tets of each face (n_f x 2)."""
        n_t = len(self.tets)
        corners = np.sort(self.tets[:, _LOCAL_FACES].reshape(-1, 3), axis=1)
        faces, inverse, counts = _unique_rows(corners, len(self.vertices))
        require(
            counts.max() <= 2,
            f"a face may belong to two tets at most; face {faces[counts.argmax()]} belongs to {counts.max()}. "
            "Remove duplicate or overlapping tets",
        )
        order = np.argsort(inverse, kind="stable")
        owners = order // 4
        starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
        face_tets = -np.ones((len(faces), 2), np.int64)
        face_tets[:, 0] = owners[starts]
        double = counts == 2
        face_tets[double, 1] = owners[starts[double] + 1]
        return frozen(faces), frozen(inverse.reshape(n_t, 4)), frozen(face_tets)

    @property
    def faces(self) -> Int[np.ndarray, "n_f 3"]:
        """Triangles of the mesh, each once, vertices ascending."""
        return self._face_numbering[0]

    @property
    def tet_faces(self) -> Int[np.ndarray, "n_t 4"]:
        """Faces of each tet; entry k is opposite to vertex k."""
        return self._face_numbering[1]

    @property
    def face_tets(self) -> Int[np.ndarray, "n_f 2"]:
        """The one or two tets of each face; -1 where there is no second tet (a boundary face)."""
        return self._face_numbering[2]

    @cached_property
    def boundary_faces(self) -> Int[np.ndarray, " n_b"]:
        """Numbers of the faces that have one tet only, ascending."""
        return frozen(np.flatnonzero(self.face_tets[:, 1] < 0))

    @cached_property
    def boundary_triangles(self) -> Int[np.ndarray, "n_b 3"]:
        """Vertices of the boundary faces, oriented with the normal pointing out of the solid."""
        tets, local = self._boundary_owners
        return frozen(np.take_along_axis(self.tets[tets], _LOCAL_FACES[local], axis=1))

    @cached_property
    def _boundary_owners(self) -> tuple[np.ndarray, np.ndarray]:
        """The tet of each boundary face, and which of its faces that is."""
        tets = self.face_tets[self.boundary_faces, 0]
        return tets, np.argmax(self.tet_faces[tets] == self.boundary_faces[:, None], axis=1)

    @cached_property
    def boundary_area_vectors(self) -> Float[np.ndarray, "n_b 3"]:
        """Outward normals of the boundary triangles times their areas, mm^2."""
        a, b, c = self.vertices[self.boundary_triangles].transpose(1, 0, 2)
        return frozen(0.5 * np.cross(b - a, c - a))

    @cached_property
    def boundary_vertices(self) -> Int[np.ndarray, " n_bv"]:
        """Vertices on the boundary, ascending."""
        return frozen(np.unique(self.boundary_triangles))

    @cached_property
    def _edge_numbering(self) -> tuple[np.ndarray, np.ndarray]:
        """Edges (ascending vertices, n_e x 2) and the six edges of each tet, in the order of `_LOCAL_EDGES`."""
        pairs = np.sort(self.tets[:, _LOCAL_EDGES].reshape(-1, 2), axis=1)
        edges, inverse, _ = _unique_rows(pairs, len(self.vertices))
        return frozen(edges), frozen(inverse.reshape(-1, 6))

    @property
    def edges(self) -> Int[np.ndarray, "n_e 2"]:
        """Edges of the mesh, each once, vertices ascending."""
        return self._edge_numbering[0]

    @property
    def tet_edges(self) -> Int[np.ndarray, "n_t 6"]:
        """Edges of each tet, between its vertices 01, 02, 03, 12, 13, 23."""
        return self._edge_numbering[1]

    # --- assembly -----------------------------------------------------------------------------------------------

    @cached_property
    def stencil(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """CSR pattern (indptr, indices) that all P1 matrices share, and the entry of each local pair (n_t, 4, 4)."""
        n_v, n_e = len(self.vertices), len(self.edges)
        i, j = self.edges.T
        diagonal = np.arange(n_v)
        numbering = np.arange(n_v + 2 * n_e)  # first all (i, i), then all (i, j), then all (j, i) with i < j
        pattern = sp.csr_matrix(
            (numbering + 1, (np.concatenate([diagonal, i, j]), np.concatenate([diagonal, j, i]))), shape=(n_v, n_v)
        )
        pattern.sort_indices()
        position = np.empty_like(numbering)
        position[np.asarray(pattern.data, np.int64) - 1] = numbering
        entry = np.empty((len(self.tets), 4, 4), np.int64)
        entry[:, range(4), range(4)] = position[self.tets]
        ascending = self.tets[:, _LOCAL_EDGES[:, 0]] < self.tets[:, _LOCAL_EDGES[:, 1]]
        a, b = _LOCAL_EDGES.T
        upper, lower = position[n_v + self.tet_edges], position[n_v + n_e + self.tet_edges]
        entry[:, a, b] = np.where(ascending, upper, lower)
        entry[:, b, a] = np.where(ascending, lower, upper)
        return frozen(pattern.indptr), frozen(pattern.indices), frozen(entry)

    def assemble(self, local: Float[np.ndarray, "n_t 4 4"]) -> sp.csr_matrix:
        """Sum element matrices into the sparse (n_v, n_v) matrix; an order faster than through triplets."""
        indptr, indices, entry = self.stencil
        data = np.bincount(entry.ravel(), local.ravel(), len(indices))
        return sp.csr_matrix((data, indices.copy(), indptr.copy()), shape=(len(self.vertices),) * 2)

    def laplacian(self, weights: Float[np.ndarray, " n_t"] | None = None) -> sp.csr_matrix:
        """The matrix of the Dirichlet form: integral over the part of w grad f . grad g; w = 1 by default."""
        w = self.volumes if weights is None else self.volumes * weights
        return self.assemble(np.einsum("t,tad,tbd->tab", w, self.hat_gradients, self.hat_gradients, optimize=True))

    @cached_property
    def _boundary_edge_numbering(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Boundary edges (numbers into `edges`), those of each boundary triangle (n_b x 3), their triangle counts."""
        tets, local = self._boundary_owners
        sides = np.take_along_axis(self.tet_edges[tets], _FACE_EDGES[local], axis=1)
        counts = np.bincount(sides.ravel(), minlength=len(self.edges))
        used = counts > 0
        return frozen(np.flatnonzero(used)), frozen((np.cumsum(used) - 1)[sides]), frozen(counts[used])

    @property
    def boundary_edge_numbers(self) -> Int[np.ndarray, " n_be"]:
        """Numbers of the edges that lie on the boundary, ascending."""
        return self._boundary_edge_numbering[0]

    @cached_property
    def boundary_edges(self) -> Int[np.ndarray, "n_be 2"]:
        """Edges of the boundary triangles, each once, vertices ascending."""
        return frozen(self.edges[self.boundary_edge_numbers])

    @property
    def boundary_triangle_edges(self) -> Int[np.ndarray, "n_b 3"]:
        """Edges of each boundary triangle (numbers into `boundary_edges`), between its vertices 01, 12, 20."""
        return self._boundary_edge_numbering[1]

    @cached_property
    def is_feature_edge(self) -> Bool[np.ndarray, " n_be"]:
        """Whether a boundary edge is sharp: the normals of its triangles differ by more than `FEATURE_COSINE` allows.

        An edge with more than two boundary triangles (a hinge of the solid) is sharp, too.
        """
        edges, triangle_edges, counts = self._boundary_edge_numbering
        normals = self.boundary_area_vectors / np.linalg.norm(self.boundary_area_vectors, axis=1, keepdims=True)
        owners = triangle_edges.ravel()
        summed = np.stack([np.bincount(owners, np.repeat(one, 3), len(edges)) for one in normals.T], axis=1)
        cosine = (np.einsum("ed,ed->e", summed, summed) - 2) / 2
        return frozen((counts != 2) | (cosine < FEATURE_COSINE))

    @property
    def feature_edges(self) -> Int[np.ndarray, "n_fe 2"]:
        """The sharp edges of the boundary, vertices ascending."""
        return self.boundary_edges[self.is_feature_edge]

    @cached_property
    def component_of_vertex(self) -> Int[np.ndarray, " n_v"]:
        """Number of the part (tets connected through shared faces, edges or vertices) to which each vertex belongs."""
        i, j = self.edges.T
        graph = sp.coo_matrix((np.ones(len(i)), (i, j)), shape=(len(self.vertices),) * 2)
        return frozen(connected_components(graph, directed=False)[1].astype(np.int64))

    @cached_property
    def body_of_tet(self) -> Int[np.ndarray, " n_t"]:
        """Number of the body (tets connected through shared faces) to which each tet belongs."""
        i, j = self.face_tets[self.face_tets[:, 1] >= 0].T
        graph = sp.coo_matrix((np.ones(len(i)), (i, j)), shape=(len(self.tets),) * 2)
        return frozen(connected_components(graph, directed=False)[1].astype(np.int64))

    @cached_property
    def size(self) -> float:
        """A length that stands for the part: the cube root of its volume, mm."""
        return float(self.volumes.sum() ** (1 / 3))


def _add_gradients(tets: Any, numbers: Any, hat_gradients: Any, values: Any, gradients: Any) -> None:
    for n in range(len(numbers)):
        t = numbers[n]
        for k in range(values.shape[1]):
            x, y, z = 0.0, 0.0, 0.0
            for a in range(4):
                value = values[tets[t, a], k]
                x += value * hat_gradients[t, a, 0]
                y += value * hat_gradients[t, a, 1]
                z += value * hat_gradients[t, a, 2]
            gradients[n, k, 0], gradients[n, k, 1], gradients[n, k, 2] = x, y, z


add_gradients = compiled(_add_gradients)


def _six_volumes(V: np.ndarray, T: np.ndarray) -> np.ndarray:
    a, b, c, d = V[T].transpose(1, 0, 2)
    return np.einsum("td,td->t", np.cross(b - a, c - a), d - a)


def _unique_rows(rows: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return unique rows of non-negative integers below n, lexicographically, with inverse and counts.

    The rows are packed in one 64-bit key, which sorts an order of magnitude faster than `np.unique(axis=0)`.
    """
    width = rows.shape[1]
    if n**width < 2**63:
        key = rows[:, 0].astype(np.int64)
        for column in range(1, width):
            key = key * n + rows[:, column]
        _, first, inverse, counts = np.unique(key, return_index=True, return_inverse=True, return_counts=True)
        return rows[first], inverse, counts
    unique, inverse, counts = np.unique(rows, axis=0, return_inverse=True, return_counts=True)
    return unique, inverse.ravel(), counts


def _first(mask: Any) -> int:
    return int(np.argmax(mask))
