"""3MF files: closed bodies for each family and for the nodes, as named and coloured objects of one truss.

Source: 3MF Consortium, Core Specification 1.3 (namespace 2015/02). A 3MF object has to be closed, so tubes and nodes
are closed by plane polygons where they touch (`mesh_groups.closed_bodies`).
"""

import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import TextIOWrapper
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from michell_cad.arrays import require
from michell_cad.cad.mesh_groups import closed_bodies, own_vertices
from michell_cad.cad.solid import TrussSolid
from michell_cad.files import path_with_suffix, writing
from michell_cad.palette import group_colour

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"

CHUNK = 20000
"""Rows that are turned to text at once."""

_EPOCH = (1980, 1, 1, 0, 0, 0)
"""The date of the files in the archive: always the same, so that the same truss gives the same bytes."""

_TYPES = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
    '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>\n'
)
_RELATIONS = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
    '<Relationship Target="/3D/3dmodel.model" Id="rel0" '
    'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>\n'
)

VERTEX = '<vertex x="%.7g" y="%.7g" z="%.7g"/>\n'
TRIANGLE = '<triangle v1="%d" v2="%d" v3="%d"/>\n'


def export_3mf(solid: TrussSolid, path: str | Path, progress: Callable[[float], None] | None = None) -> None:
    """Write the mesh as 3MF, in mm; the file is there whole or not at all, and the same bytes for the same truss.

    Raises
    ------
    InvalidInputError
        For another extension than .3mf, if the mesh is not watertight, and if the file cannot be written.
    """
    path = path_with_suffix(path, ".3mf")
    require(
        solid.mesh.is_watertight,
        f"a 3MF file needs a watertight mesh, this one has {len(solid.mesh.open_triangles)} triangles with open edges",
    )
    bodies = closed_bodies(solid)
    with writing(path) as partial, model_file(partial, {"xmlns": CORE}) as file:
        file.write("<resources>\n")
        write_materials(file, 1, list(bodies))
        for k, (name, triangles) in enumerate(bodies.items()):
            used, local = own_vertices(solid.mesh.vertices, triangles)
            file.write(f'<object id="{k + 2}" type="model" name={quoteattr(name)} pid="1" pindex="{k}"><mesh>\n')
            write_rows(file, "vertices", VERTEX, solid.mesh.vertices[used])
            write_rows(file, "triangles", TRIANGLE, local)
            file.write("</mesh></object>\n")
            if progress is not None:
                progress((k + 1) / len(bodies))
        whole = len(bodies) + 2
        parts = "".join(f'<component objectid="{k + 2}"/>' for k in range(len(bodies)))
        file.write(f'<object id="{whole}" type="model" name="truss"><components>{parts}</components></object>\n')
        file.write(f'</resources>\n<build><item objectid="{whole}"/></build>\n')


@contextmanager
def model_file(path: Path, attributes: dict[str, str]) -> Iterator[TextIOWrapper]:
    """Yield the model of a 3MF archive to write to, between its first and its last tag."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive:
        for name, text in (("[Content_Types].xml", _TYPES), ("_rels/.rels", _RELATIONS)):
            archive.writestr(_entry(name), text)
        raw = archive.open(_entry("3D/3dmodel.model"), "w", force_zip64=True)
        with TextIOWrapper(raw, encoding="utf-8", newline="\n") as file:
            listed = " ".join(f"{key}={quoteattr(value)}" for key, value in attributes.items())
            file.write(f'<?xml version="1.0" encoding="UTF-8"?>\n<model unit="millimeter" xml:lang="en-US" {listed}>\n')
            file.write('<metadata name="Application">michell_cad</metadata>\n')
            yield file
            file.write("</model>\n")


def write_materials(file: TextIOWrapper, number: int, groups: list[str]) -> None:
    """Write the resource of this number: a material for each group, named and coloured like it."""
    file.write(f'<basematerials id="{number}">')
    for group in groups:
        red, green, blue = (round(255 * c) for c in group_colour(group))
        file.write(f'<base name={quoteattr(group)} displaycolor="#{red:02X}{green:02X}{blue:02X}"/>')
    file.write("</basematerials>\n")


def write_rows(file: TextIOWrapper, tag: str, row: str, values: np.ndarray) -> None:
    """Write an element with one child for each row of values."""
    file.write(f"<{tag}>\n")
    for first in range(0, len(values), CHUNK):
        part = values[first : first + CHUNK]
        file.write(row * len(part) % tuple(part.ravel().tolist()))
    file.write(f"</{tag}>\n")


def _entry(name: str) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name, _EPOCH)
    entry.compress_type = zipfile.ZIP_DEFLATED
    return entry
