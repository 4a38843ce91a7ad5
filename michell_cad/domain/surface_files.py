"""Surface files (.stl, .obj, .3mf) -> an outline whose faces are the patches between sharp edges.

The readers are trimesh's. STL and OBJ have no unit: their numbers are in `units` (default mm). A 3MF file states its
unit; as with STEP, a `units` other than mm overrules it.
"""

from pathlib import Path

import numpy as np

from michell_cad.domain.outline import Outline, Surface, unit_length
from michell_cad.domain.patches import describe_patches, number_patches
from michell_cad.domain.surface_checks import check_surface, crossing_triangles, merge_vertices
from michell_cad.errors import InvalidInputError

_UNITS_OF_3MF = {"micron": 1e-3, "millimeter": 1.0, "centimeter": 10.0, "inch": 25.4, "foot": 304.8, "meter": 1000.0}
"""Length of the units of the 3MF core specification, mm."""

_STL_HEADER, _STL_RECORD = 84, 50
"""Bytes of the head of a binary STL (80 of text, 4 for the count) and of each of its triangles."""


def read_surface_file(path: Path, units: str | None) -> Outline:
    """Read a closed surface as an outline in mm.

    Raises
    ------
    InvalidInputError
        For a file that is not what its name says, that is open, crosses itself, or holds several bodies.
    """
    points, triangles, stated = _load(path)
    scale = stated if stated is not None and units in (None, "mm") else unit_length(units or "mm")
    if not len(triangles):
        raise InvalidInputError(f"{path.name}: the file holds no triangles")
    if not np.isfinite(points).all():
        raise InvalidInputError(f"{path.name}: {(~np.isfinite(points).all(1)).sum()} vertices are not finite numbers")
    outline = outline_from_triangles(points * scale, triangles, path.name)
    return Outline(outline.name, outline.surface, outline.faces, outline.volume, unit_mm=unit_length(units or "mm"))


def outline_from_triangles(points: np.ndarray, triangles: np.ndarray, name: str = "part") -> Outline:
    """Make an outline of triangles in mm; points that coincide are merged."""
    V, F = merge_vertices(np.asarray(points, float), np.asarray(triangles, np.int64))
    proper = (F[:, 0] != F[:, 1]) & (F[:, 1] != F[:, 2]) & (F[:, 2] != F[:, 0])
    V, F = check_surface(V, F[proper], name)
    crossing = crossing_triangles(V, F)
    if len(crossing):
        first = V[F[crossing[0, 0]]].mean(0)
        raise InvalidInputError(
            f"{name}: the surface crosses itself: {len(crossing)} pairs of triangles intersect, first near "
            f"({first[0]:.6g}, {first[1]:.6g}, {first[2]:.6g}); repair it, for example by a mesh union"
        )
    surface = Surface(V, F, number_patches(V, F))
    if surface.volume <= 0:
        raise InvalidInputError(f"{name}: the surface encloses no volume ({surface.volume:g} mm3)")
    return Outline(name, surface, describe_patches(surface), surface.volume)


def _load(path: Path) -> tuple[np.ndarray, np.ndarray, float | None]:
    """Points, triangles, and the length of the unit that the file states (mm), if it states one."""
    import trimesh

    kind = path.suffix.lower()[1:]
    data = path.read_bytes()
    _check_signature(path.name, kind, data)
    try:
        with path.open("rb") as stream:
            scene = trimesh.load_scene(stream, file_type=kind, process=False)
            mesh = scene.to_mesh()
    except Exception as error:
        # trimesh lets whatever its parsers raise through (KeyError, struct.error, lxml errors, ...).
        raise InvalidInputError(
            f"{path.name}: cannot be read as {kind.upper()} ({type(error).__name__}: {error}); export it again"
        ) from error
    stated = None
    if kind == "3mf":
        named = str(mesh.units or "millimeter").lower()
        named = {"millimeters": "millimeter", "inches": "inch", "meters": "meter", "microns": "micron"}.get(
            named, named
        )
        stated = _UNITS_OF_3MF.get(named.rstrip("s"), _UNITS_OF_3MF.get(named, 1.0))
    return np.array(mesh.vertices, float), np.array(mesh.faces, np.int64), stated


def _check_signature(name: str, kind: str, data: bytes) -> None:
    """Refuse a file that is not what its name says before a tolerant parser makes something of it."""
    if not data:
        raise InvalidInputError(f"{name}: the file is empty")
    if kind == "3mf" and data[:2] != b"PK":
        raise InvalidInputError(f"{name}: not a 3MF file: it is not a ZIP archive")
    if kind == "stl":
        count = int.from_bytes(data[80:84], "little") if len(data) >= _STL_HEADER else -1
        binary = len(data) >= _STL_HEADER + _STL_RECORD * count and count > 0
        ascii_text = data.lstrip()[:5].lower() == b"solid" and b"facet" in data[:4096].lower()
        if not (binary or ascii_text):
            raise InvalidInputError(
                f"{name}: not an STL file, or cut short: neither 'solid ... facet' nor a binary head whose count "
                f"fits the {len(data)} bytes"
            )
    if kind == "obj" and not any(line.startswith(b"v ") for line in data.splitlines()):
        raise InvalidInputError(f"{name}: not an OBJ file: it has no line 'v x y z'")
