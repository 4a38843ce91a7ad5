"""STEP files, with every curve by its name, the colour of its family, and a layer for each family.

In the form ``solid`` there is one solid per connected component, whose faces have names, colours and layers. In the
form ``assembly`` every curve is a solid (a bar) and every node is one, in a sub-assembly for each family and one for
the nodes; see `bars` for what belongs to which. Bars run through their nodes, so the parts overlap there: united they
are the solid of the other form.
"""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from michell_cad.arrays import require
from michell_cad.cad.shell_plan import FaceRole
from michell_cad.cad.solid import TrussSolid
from michell_cad.cad.step_forecast import forecast_bytes
from michell_cad.files import path_with_suffix, writing
from michell_cad.palette import COLOURS, GROUPS, KEPT, NODES, group_colour

if TYPE_CHECKING:
    from michell_cad.cad.kernel_files import StepDocument, StepSummary, Tag

SCHEMAS = {"AP214": "AP214IS", "AP242": "AP242DIS"}
"""The kernel's names of the STEP schemas."""

FORMS = ("solid", "assembly")

StepForm = Literal["solid", "assembly"]
StepSchema = Literal["AP214", "AP242"]


def export_step(
    solid: TrussSolid,
    path: str | Path,
    form: str = "solid",
    schema: str = "AP214",
    pcurves: bool = False,
    progress: Callable[[float], None] | None = None,
) -> None:
    """Write the truss as STEP, in mm, with names, colours and layers; the file is there whole or not at all.

    Parameters
    ----------
    solid : TrussSolid
    path : ends in .step or .stp.
    form : one of `FORMS`, see the module.
    schema : one of `SCHEMAS`.
    pcurves : also write the edges in the parameters of their faces; the file becomes larger by half and no better.
    progress : told the fraction of the work done.

    Raises
    ------
    InvalidInputError
        For an unknown form, schema or extension; and if the file cannot be written, or would not fit on the disk.
    GeometryKernelError
        If a part of an assembly is not valid.
    """
    from michell_cad.cad.kernel_files import StepDocument, StepSettings

    path = path_with_suffix(path, ".step", ".stp")
    _require_known(form, schema)
    tell = progress or (lambda fraction: None)
    with writing(path) as partial:
        _require_space(path, forecast_step(solid, form, pcurves))
        document = StepDocument()
        (_fill_solid if form == "solid" else _fill_assembly)(document, solid)
        tell(0.3)
        document.write(partial, path.name, StepSettings(SCHEMAS[schema], pcurves))
    tell(1.0)


def forecast_step(solid: TrussSolid, form: str = "solid", pcurves: bool = False) -> int:
    """Size in bytes that `export_step` will write, see `step_forecast` for its accuracy.

    Raises
    ------
    InvalidInputError
        For an unknown form.
    """
    _require_known(form, "AP214")
    if form == "assembly":
        parts = solid.assembly
        return forecast_bytes([part.solid for part in parts], [part.name for part in parts], True, pcurves)
    return forecast_bytes(solid.solids, [tag.name for tag in _face_tags(solid)], False, pcurves)


def read_step_summary(path: str | Path) -> "StepSummary":
    """Solids, validity, volume and faces of a STEP file, as the kernel reads it."""
    from michell_cad.cad import kernel_files

    return kernel_files.read_step_file(Path(path))


def _fill_solid(document: "StepDocument", solid: TrussSolid) -> None:
    names = ["truss"] if len(solid.solids) == 1 else [f"truss {i + 1}" for i in range(len(solid.solids))]
    labels = [document.add_solid(one, name) for one, name in zip(solid.solids, names, strict=True)]
    for face, component, tag in zip(solid.faces, solid.face_component.tolist(), _face_tags(solid), strict=True):
        document.tag_face(labels[component], face, tag)


def _fill_assembly(document: "StepDocument", solid: TrussSolid) -> None:
    from michell_cad.cad.kernel_files import Tag

    whole = document.add_assembly("truss")
    groups = {part.group for part in solid.assembly}
    labels = {group: document.add_assembly(group, whole) for group in GROUPS if group in groups}
    for part in solid.assembly:
        document.add_part(labels[part.group], part.solid, Tag(part.name, group_colour(part.group), part.group))


def face_tags(solid: TrussSolid) -> list[tuple[str, tuple[float, float, float], str]]:
    """Name, colour and layer of each face: of its curve, of its node, or of the kept solid that it belongs to."""
    of_curve = [(curve.name, COLOURS[curve.family], curve.family) for curve in solid.prepared.sized.truss.curves]
    of_kept = [(name, COLOURS[KEPT], KEPT) for name in solid.kept_names]
    tags = []
    for curve, role, owner in zip(
        solid.face_curve.tolist(), solid.face_role.tolist(), solid.face_owner.tolist(), strict=True
    ):
        if role == FaceRole.KEPT:
            tags.append(of_kept[owner])
        else:
            tags.append(of_curve[curve] if curve >= 0 else (f"node {owner}", COLOURS["node"], NODES))
    return tags


def _face_tags(solid: TrussSolid) -> "list[Tag]":
    from michell_cad.cad.kernel_files import Tag

    return [Tag(*tag) for tag in face_tags(solid)]


def _require_known(form: str, schema: str) -> None:
    require(form in FORMS, f"form must be one of {', '.join(FORMS)}, found {form!r}")
    require(schema in SCHEMAS, f"schema must be one of {', '.join(SCHEMAS)}, found {schema!r}")


def _require_space(path: Path, size: int) -> None:
    free = shutil.disk_usage(path.parent).free
    require(
        free > size,
        f"{path} would take about {size / 1e6:.3g} MB, but {free / 1e6:.3g} MB are free: "
        "free space, choose another folder, or build fewer curves",
    )
