"""Tet meshes (.mesh, .msh, .vtu through meshio) and whole problems (.npz) -> an outline that has its tets already.

An `.npz` problem holds `vertices` (n_v, 3), `tets` (n_t, 4) and, optionally, `fixed` (n_v,) bool (all three axes held)
and `force` (n_v, 3), N. Its lengths are metres unless `units` says otherwise; the other files are in mm. The axis that
points up in pictures is y for `.npz`, as in the authors' problems, else z.
"""

import zipfile
from pathlib import Path

import numpy as np

from michell_cad.domain.outline import Outline, Surface, unit_length
from michell_cad.domain.patches import describe_patches, number_patches
from michell_cad.errors import InvalidInputError
from michell_cad.tet_mesh import TetMesh


def read_npz_problem(path: Path, units: str | None) -> Outline:
    """Read an `.npz` problem; see the module for its arrays."""
    name, scale = path.name, unit_length(units or "m")
    try:
        # Opened here, because NumPy leaves the file open when the archive turns out to be damaged.
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            arrays = {key: archive[key] for key in ("vertices", "tets", "fixed", "force") if key in archive.files}
            found = archive.files
    except (ValueError, OSError, EOFError, zipfile.BadZipFile, AttributeError) as error:
        raise InvalidInputError(f"{name}: cannot be read as an .npz archive ({error})") from error
    missing = [key for key in ("vertices", "tets") if key not in arrays]
    if missing:
        raise InvalidInputError(f"{name}: expected arrays vertices and tets, found {', '.join(found) or 'none'}")
    n_v = len(arrays["vertices"])
    fixed, force = arrays.get("fixed"), arrays.get("force")
    if fixed is not None and fixed.shape != (n_v,):
        raise InvalidInputError(f"{name}: fixed must have shape ({n_v},), found {fixed.shape}")
    if force is not None and force.shape != (n_v, 3):
        raise InvalidInputError(f"{name}: force must have shape ({n_v}, 3), found {force.shape}")
    if force is not None and not np.isfinite(force).all():
        raise InvalidInputError(f"{name}: {(~np.isfinite(force).all(1)).sum()} forces are not finite numbers")
    mesh, used = _tet_mesh(arrays["vertices"] * scale, arrays["tets"], name)
    return outline_from_tets(
        mesh,
        name,
        unit_mm=scale,
        up=1,
        fixed=None if fixed is None else fixed.astype(bool)[used],
        force=None if force is None else force.astype(float)[used],
    )


def read_tet_file(path: Path, units: str | None) -> Outline:
    """Read the tets of a Medit (.mesh), Gmsh (.msh) or VTK (.vtu) file."""
    import meshio

    name, scale = path.name, unit_length(units or "mm")
    suffix = path.suffix.lower()
    if suffix == ".msh":
        # Two programs share this ending; a Gmsh file says so in its first line.
        with path.open("rb") as stream:
            suffix = ".msh" if stream.read(11) == b"$MeshFormat" else ".msh (Ansys)"
    readers = {
        ".mesh": meshio.medit.read,
        ".msh": meshio.gmsh.read,
        ".msh (Ansys)": meshio.ansys.read,
        ".vtu": meshio.vtu.read,
    }
    try:
        content = readers[suffix](str(path))
    except Exception as error:
        # meshio lets whatever its parsers raise through (ReadError, ValueError, KeyError, XML errors, ...).
        raise InvalidInputError(
            f"{name}: cannot be read as {suffix} ({type(error).__name__}: {error}); export it again"
        ) from error
    blocks = [block.data[:, :4] for block in content.cells if block.type in ("tetra", "tetra10")]
    if not blocks or not sum(len(block) for block in blocks):
        kinds = ", ".join(sorted({block.type for block in content.cells})) or "none"
        raise InvalidInputError(f"{name}: the file has no tets (cells found: {kinds}); save the volume mesh as well")
    mesh, _ = _tet_mesh(np.asarray(content.points, float)[:, :3] * scale, np.concatenate(blocks), name)
    return outline_from_tets(mesh, name, unit_mm=scale)


def outline_from_tets(mesh: TetMesh, name: str = "part", **extra) -> Outline:
    """Make an outline of a tet mesh; its faces are the patches of its boundary between sharp edges."""
    triangles = mesh.boundary_triangles
    surface = Surface(mesh.vertices, triangles, number_patches(mesh.vertices, triangles))
    mesh = TetMesh(mesh.vertices, mesh.tets, surface.face_numbers)
    return Outline(name, surface, describe_patches(surface), float(mesh.volumes.sum()), mesh=mesh, **extra)


def _tet_mesh(vertices: np.ndarray, tets: np.ndarray, name: str) -> tuple[TetMesh, np.ndarray]:
    """Make the tet mesh without unused vertices, and say which vertices are used."""
    if vertices.ndim != 2 or vertices.shape[1] != 3 or tets.ndim != 2 or tets.shape[1] != 4 or not len(tets):
        raise InvalidInputError(
            f"{name}: expected vertices (n_v, 3) and tets (n_t, 4), found {vertices.shape} and {tets.shape}"
        )
    if tets.dtype.kind not in "iu" or tets.min() < 0 or tets.max() >= len(vertices):
        raise InvalidInputError(f"{name}: tets must be indices from 0 to {len(vertices) - 1}")
    used = np.unique(tets)
    renumber = np.zeros(len(vertices), np.int64)
    renumber[used] = np.arange(len(used))
    try:
        mesh = TetMesh(vertices[used], renumber[tets])
        len(mesh.boundary_faces)
    except InvalidInputError as error:
        raise InvalidInputError(f"{name}: {error}") from error
    return mesh, used
