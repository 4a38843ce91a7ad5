"""GLB files (binary glTF 2.0) for viewing: one mesh for each family and one for the nodes, named and coloured.

glTF wants metres, the y axis up, linear colours and single precision (Khronos Group: glTF 2.0 specification, sections
3.4, 3.9.2 and 3.6.2). A point (x, y, z) in mm becomes (x, z, -y) / 1000.
"""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from michell_cad.cad.mesh import TrussMesh
from michell_cad.cad.mesh_groups import coloured_triangles, own_vertices
from michell_cad.cad.solid import TrussSolid
from michell_cad.files import path_with_suffix, writing
from michell_cad.palette import group_colour

METRES = 1e-3
"""Metres in a millimetre."""

FLOATS, WHOLE_NUMBERS = 5126, 5125
"""glTF's numbers of single precision and of unsigned whole numbers of four bytes."""

ARRAY_BUFFER, ELEMENT_BUFFER = 34962, 34963
"""glTF's numbers of buffers of vertices and of triangles."""

METALLIC, ROUGHNESS = 0.1, 0.6
"""The look of the surface; from 0 to 1."""


def export_glb(solid: TrussSolid, path: str | Path, progress: Callable[[float], None] | None = None) -> None:
    """Write the mesh as GLB; the file is there whole or not at all, and the same bytes for the same truss.

    Raises
    ------
    InvalidInputError
        For another extension than .glb, and if the file cannot be written.
    """
    path = path_with_suffix(path, ".glb")
    mesh, buffers = solid.mesh, _Buffers()
    points = _turned(mesh.vertices) * METRES
    normals = _turned(vertex_normals(mesh))
    meshes, materials = [], []
    for name, triangles in coloured_triangles(solid).items():
        used, local = own_vertices(mesh.vertices, triangles)
        attributes = {
            "POSITION": buffers.add(points[used].astype("<f4"), FLOATS, "VEC3", ARRAY_BUFFER, bounds=True),
            "NORMAL": buffers.add(normals[used].astype("<f4"), FLOATS, "VEC3", ARRAY_BUFFER),
        }
        indices = buffers.add(local.ravel().astype("<u4"), WHOLE_NUMBERS, "SCALAR", ELEMENT_BUFFER)
        primitive = {"attributes": attributes, "indices": indices, "material": len(materials)}
        meshes.append({"name": name, "primitives": [primitive]})
        materials.append(_material(name))
    blob = b"".join(buffers.parts)
    nodes = [{"name": one["name"], "mesh": k} for k, one in enumerate(meshes)]
    content = {
        "asset": {"version": "2.0", "generator": "michell_cad"},
        "scene": 0,
        "scenes": [{"name": "truss", "nodes": [len(nodes)]}],
        "nodes": [*nodes, {"name": "truss", "children": list(range(len(nodes)))}],
        "meshes": meshes,
        "materials": materials,
        "accessors": buffers.accessors,
        "bufferViews": buffers.views,
        "buffers": [{"byteLength": len(blob)}],
    }
    text = json.dumps(content, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    with writing(path) as partial, partial.open("wb") as file:
        file.write(b"glTF" + np.array([2, 28 + len(text) + len(blob)], "<u4").tobytes())
        file.write(np.uint32(len(text)).tobytes() + b"JSON" + text)
        file.write(np.uint32(len(blob)).tobytes() + b"BIN\0" + blob)
    if progress is not None:
        progress(1.0)


def vertex_normals(mesh: TrussMesh) -> Float[np.ndarray, "n 3"]:
    """Unit normals of the vertices: means over their triangles, weighted by area."""
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    across = np.cross(b - a, c - a)
    corners = mesh.triangles.ravel()
    n = len(mesh.vertices)
    sums = np.stack([np.bincount(corners, np.repeat(across[:, k], 3), n) for k in range(3)], axis=1)
    size = np.linalg.norm(sums, axis=1, keepdims=True)
    return np.divide(sums, size, out=np.tile([0.0, 0.0, 1.0], (n, 1)), where=size > 0)


def linear_colour(colour: tuple[float, float, float]) -> list[float]:
    """Linear intensities of an sRGB colour (IEC 61966-2-1)."""
    return [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colour]


def _turned(vectors: np.ndarray) -> np.ndarray:
    return np.stack([vectors[:, 0], vectors[:, 2], -vectors[:, 1]], axis=1)


def _material(name: str) -> dict[str, Any]:
    look = {
        "baseColorFactor": [*linear_colour(group_colour(name)), 1.0],
        "metallicFactor": METALLIC,
        "roughnessFactor": ROUGHNESS,
    }
    return {"name": name, "pbrMetallicRoughness": look}


class _Buffers:
    """The binary part of the file while it grows."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []
        self.size = 0
        self.views: list[dict[str, int]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, values: np.ndarray, component: int, kind: str, target: int, bounds: bool = False) -> int:
        """Append an array of four-byte values; returns the number of its accessor."""
        self.views.append({"buffer": 0, "byteOffset": self.size, "byteLength": values.nbytes, "target": target})
        accessor = {
            "bufferView": len(self.views) - 1,
            "componentType": component,
            "count": len(values),
            "type": kind,
        }
        if bounds:
            accessor |= {"min": values.min(0).tolist(), "max": values.max(0).tolist()}
        self.accessors.append(accessor)
        self.parts.append(values.tobytes())
        self.size += values.nbytes
        return len(self.accessors) - 1
