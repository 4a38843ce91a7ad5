"""Faces for parts that have no CAD model: patches of the surface, bounded by sharp edges.

Source: the sharp-feature rule of the tet mesh (`tet_mesh.FEATURE_COSINE`), applied between neighbouring triangles.
"""

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int
from scipy.sparse.csgraph import connected_components

from michell_cad.domain.outline import PartFace, Surface
from michell_cad.tet_mesh import FEATURE_COSINE

FLATNESS = 1e-4
"""A patch is a plane if its normals differ by less than this (1 - cosine, about 0.8 degrees)."""


def number_patches(
    vertices: Float[np.ndarray, "n_v 3"], triangles: Int[np.ndarray, "n_b 3"]
) -> Int[np.ndarray, " n_b"]:
    """Number the patches of a surface: triangles connected over edges that are not sharp."""
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
    pairs = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    key = pairs[:, 0] * len(vertices) + pairs[:, 1]
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(key[order][1:] == key[order][:-1])
    first, second = order[same] // 3, order[same + 1] // 3
    smooth = np.einsum("ed,ed->e", normals[first], normals[second]) >= FEATURE_COSINE
    n = len(triangles)
    graph = sp.coo_matrix((np.ones(smooth.sum()), (first[smooth], second[smooth])), shape=(n, n))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def describe_patches(surface: Surface) -> tuple[PartFace, ...]:
    """Describe each numbered patch of a surface by area, centre and, if it is flat, its normal."""
    faces = []
    order = np.argsort(surface.face_numbers, kind="stable")
    starts = np.flatnonzero(np.diff(surface.face_numbers[order], prepend=-1))
    for number, members in enumerate(np.split(order, starts[1:])):
        areas = surface.areas[members]
        total = surface.area_vectors[members].sum(0)
        flat = np.linalg.norm(total) > (1 - FLATNESS) * areas.sum()
        centre = areas @ surface.centroids[members] / areas.sum()
        faces.append(
            PartFace(
                number=number,
                kind="PLANE" if flat else "PATCH",
                area=float(areas.sum()),
                centre=tuple(centre.tolist()),
                direction=tuple((total / np.linalg.norm(total)).tolist()) if flat else None,
            )
        )
    return tuple(faces)
