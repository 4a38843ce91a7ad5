"""Domain: whatever a designer has (STEP, BREP, CAD objects, surfaces, tets) -> a part with tets and numbered faces."""

from pathlib import Path
from typing import Any

from michell_cad.domain.outline import UNITS_MM, Outline, Part, PartFace, Surface
from michell_cad.domain.surface_files import outline_from_triangles
from michell_cad.domain.tet_files import outline_from_tets
from michell_cad.domain.tet_meshing import Progress, default_mesh_size, forecast_tets, mesh_outline
from michell_cad.errors import InvalidInputError
from michell_cad.tet_mesh import TetMesh

__all__ = [
    "UNITS_MM",
    "Outline",
    "Part",
    "PartFace",
    "Progress",
    "Surface",
    "default_mesh_size",
    "forecast_tets",
    "mesh_outline",
    "outline_from_tets",
    "outline_from_triangles",
    "part_from_cad",
    "part_from_tets",
    "read_outline",
    "read_part",
]

CAD_SUFFIXES = (".step", ".stp", ".brep", ".brp")
SURFACE_SUFFIXES = (".stl", ".obj", ".3mf")
TET_SUFFIXES = (".mesh", ".msh", ".vtu")


def read_part(
    path: str | Path, units: str | None = None, mesh_size: float | None = None, progress: Progress | None = None
) -> Part:
    """Read a part and fill it with tets.

    Parameters
    ----------
    path : .step .stp .brep .brp (CAD), .stl .obj .3mf (closed surface), .mesh .msh .vtu (tets) or .npz (whole problem).
    units : unit of the file's numbers: mm, cm, m or in. Default: mm; m for .npz. STEP and 3MF files state their unit
        themselves, which holds unless `units` names another one than mm.
    mesh_size : median edge of the tets, mm. Default: from the part. Ignored for files that have tets.
    progress : called with a text when meshing begins.

    Raises
    ------
    InvalidInputError
        For a file that is missing, unreadable, not what its name says or not one closed solid, or a bad mesh size.
    GeometryKernelError
        If no valid tet mesh comes out.
    """
    return mesh_outline(read_outline(path, units), mesh_size, progress)


def read_outline(path: str | Path, units: str | None = None) -> Outline:
    """Read a part without meshing it; parameters and errors as for `read_part`."""
    path = Path(path)
    suffix = path.suffix.lower()
    known = (*CAD_SUFFIXES, *SURFACE_SUFFIXES, *TET_SUFFIXES, ".npz")
    if suffix not in known:
        raise InvalidInputError(f"{path}: unknown kind of file {suffix!r}; expected one of {' '.join(known)}")
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "does not exist"
        raise InvalidInputError(f"{path}: the part's file {what}")
    try:
        with path.open("rb") as stream:
            empty = not stream.read(1)
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot be read ({error.strerror})") from error
    if empty:
        raise InvalidInputError(f"{path}: the file is empty")
    if suffix in CAD_SUFFIXES:
        from michell_cad.domain.cad_part import read_cad_file

        return read_cad_file(path, units)
    if suffix in SURFACE_SUFFIXES:
        from michell_cad.domain.surface_files import read_surface_file

        return read_surface_file(path, units)
    from michell_cad.domain.tet_files import read_npz_problem, read_tet_file

    return read_npz_problem(path, units) if suffix == ".npz" else read_tet_file(path, units)


def part_from_cad(
    obj: Any, mesh_size: float | None = None, progress: Progress | None = None, name: str = "part"
) -> Part:
    """Make a part of a CadQuery Workplane or Shape, or a build123d Part, Solid or Compound (all in mm)."""
    from michell_cad.domain.cad_part import outline_from_shape

    return mesh_outline(outline_from_shape(obj, name), mesh_size, progress)


def part_from_tets(mesh: TetMesh, name: str = "part") -> Part:
    """Make a part of a tet mesh in mm; its faces are the patches of its boundary between sharp edges."""
    return mesh_outline(outline_from_tets(mesh, name))
