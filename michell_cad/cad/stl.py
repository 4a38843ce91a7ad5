"""Binary STL files of the direct mesh."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from jaxtyping import Float

from michell_cad.arrays import require
from michell_cad.cad.built import BuiltSolid
from michell_cad.files import path_with_suffix, writing

HEADER = b"michell_cad, mm"

_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def export_stl(solid: BuiltSolid, path: str | Path, progress: Callable[[float], None] | None = None) -> None:
    """Write the mesh as binary STL, coordinates in mm; the file is there whole or not at all.

    Raises
    ------
    InvalidInputError
        For another extension than .stl, if the mesh is not watertight, and if the file cannot be written.
    """
    path, mesh = path_with_suffix(path, ".stl"), solid.mesh
    require(
        mesh.is_watertight,
        f"an STL file needs a watertight mesh, this one has {len(mesh.open_triangles)} triangles with open edges",
    )
    write_stl(path, mesh.vertices[mesh.triangles])
    if progress is not None:
        progress(1.0)


def write_stl(path: Path, corners: Float[np.ndarray, "n 3 3"]) -> None:
    """Write triangles as binary STL, coordinates in mm.

    Raises
    ------
    InvalidInputError
        If the file cannot be written.
    """
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    records = np.zeros(len(corners), _RECORD)
    records["normal"] = np.divide(normals, size, out=np.zeros_like(normals), where=size > 0)
    records["corners"] = corners
    with writing(path) as partial, partial.open("wb") as file:
        file.write(HEADER.ljust(80, b" "))
        file.write(np.uint32(len(records)).tobytes())
        file.write(records.tobytes())
