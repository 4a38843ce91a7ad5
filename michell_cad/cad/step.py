"""STEP files, with every curve by its name, the colour of its family, and a layer for each family.

In the form ``solid`` there is one solid per connected component, whose faces have names, colours and layers. In the
form ``assembly`` every curve is a solid (a bar) and every node is one, in a sub-assembly for each family and one for
the nodes; see `bars` for what belongs to which. Bars run through their nodes, so the parts overlap there: united they
are the solid of the other form. Members of other profiles than round ones have only this form.
"""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from michell_cad.arrays import require
from michell_cad.cad.built import BuiltSolid
from michell_cad.cad.shell_plan import FaceRole
from michell_cad.cad.step_forecast import forecast_bytes, forecast_kernel_bytes
from michell_cad.cad.step_text import AP214, AP242, Schema, StepText, Tag
from michell_cad.cad.swept_solid import SweptSolid
from michell_cad.files import path_with_suffix, writing
from michell_cad.palette import COLOURS, GROUPS, KEPT, NODES, group_colour

if TYPE_CHECKING:
    from michell_cad.cad.kernel_files import StepDocument, StepSummary

SCHEMAS = {"AP214": AP214, "AP242": AP242}

FORMS = ("solid", "assembly")

StepForm = Literal["solid", "assembly"]
StepSchema = Literal["AP214", "AP242"]


def export_step(
    solid: BuiltSolid,
    path: str | Path,
    form: str | None = None,
    schema: str = "AP214",
    pcurves: bool = False,
    progress: Callable[[float], None] | None = None,
) -> None:
    """Write the truss as STEP, in mm, with names, colours and layers; the file is there whole or not at all.

    Parameters
    ----------
    solid : BuiltSolid
    path : ends in .step or .stp.
    form : one of `FORMS`, see the module; default: the solid, or the assembly where there is no other form.
    schema : one of `SCHEMAS`.
    pcurves : also write the edges in the parameters of their faces; the file becomes three times as large.
    progress : told the fraction of the work done.

    Raises
    ------
    InvalidInputError
        For an unknown form, schema or extension, or a form that the profile does not have; if the file cannot be
        written, or would not fit on the disk.
    GeometryKernelError
        If a part of an assembly is not valid.
    """
    path = path_with_suffix(path, ".step", ".stp")
    require(schema in SCHEMAS, f"schema must be one of {', '.join(SCHEMAS)}, found {schema!r}")
    form = _known_form(solid, form)
    tell = progress or (lambda fraction: None)
    with writing(path) as partial:
        text = _own_text(solid, form, pcurves, SCHEMAS[schema], lambda fraction: tell(0.9 * fraction))
        _require_space(path, _forecast_kernel(solid, form, pcurves) if text is None else text.size)
        if text is None:
            _write_by_kernel(solid, partial, path.name, form, pcurves, SCHEMAS[schema])
        else:
            with partial.open("w", encoding="ascii") as stream:
                stream.writelines(text.lines(path.name, SCHEMAS[schema]))
    tell(1.0)


def forecast_step(solid: BuiltSolid, form: str | None = None, pcurves: bool = False) -> int:
    """Size in bytes that `export_step` will write, see `step_forecast` for its accuracy.

    Raises
    ------
    InvalidInputError
        As for `export_step`.
    """
    form = _known_form(solid, form)
    if form == "assembly" or pcurves:
        return _forecast_kernel(solid, form, pcurves)
    return forecast_bytes(solid.solids, [tag.name for tag in _face_tags(solid)])


def read_step_summary(path: str | Path) -> "StepSummary":
    """Solids, validity, volume and faces of a STEP file, as the kernel reads it."""
    from michell_cad.cad import kernel_files

    return kernel_files.read_step_file(Path(path))


def _own_text(
    solid: BuiltSolid, form: str, pcurves: bool, schema: Schema, progress: Callable[[float], None]
) -> StepText | None:
    """The records of one solid per component; None for what the kernel has to write."""
    if form != "solid" or pcurves:
        return None
    from michell_cad.cad.kernel_step import solid_text

    return solid_text(solid.solids, _solid_names(solid), solid.faces, _face_tags(solid), schema, progress)


def _write_by_kernel(solid: BuiltSolid, path: Path, name: str, form: str, pcurves: bool, schema: Schema) -> None:
    from michell_cad.cad.kernel_files import StepDocument, StepSettings

    document = StepDocument()
    (_fill_solid if form == "solid" else _fill_assembly)(document, solid)
    document.write(path, name, StepSettings(schema.kernel_name, pcurves))


def _forecast_kernel(solid: BuiltSolid, form: str, pcurves: bool) -> int:
    if form == "assembly":
        parts = solid.assembly
        return forecast_kernel_bytes([part.solid for part in parts], [part.name for part in parts], True, pcurves)
    return forecast_kernel_bytes(solid.solids, [tag.name for tag in _face_tags(solid)], False, pcurves)


def _solid_names(solid: BuiltSolid) -> list[str]:
    n = len(solid.solids)
    return ["truss"] if n == 1 else [f"truss {i + 1}" for i in range(n)]


def _fill_solid(document: "StepDocument", solid: BuiltSolid) -> None:
    labels = [document.add_solid(*pair) for pair in zip(solid.solids, _solid_names(solid), strict=True)]
    for face, component, tag in zip(solid.faces, solid.face_component.tolist(), _face_tags(solid), strict=True):
        document.tag_face(labels[component], face, tag)


def _fill_assembly(document: "StepDocument", solid: BuiltSolid) -> None:
    whole = document.add_assembly("truss")
    groups = {part.group for part in solid.assembly}
    labels = {group: document.add_assembly(group, whole) for group in GROUPS if group in groups}
    for part in solid.assembly:
        document.add_part(labels[part.group], part.solid, Tag(part.name, group_colour(part.group), part.group))


def face_tags(solid: BuiltSolid) -> list[tuple[str, tuple[float, float, float], str]]:
    """Name, colour and layer of each face: of its curve, of its node, or of the kept solid that it belongs to."""
    of_curve = [(curve.name, COLOURS[curve.family], curve.family) for curve in solid.sized.truss.curves]
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


def _face_tags(solid: BuiltSolid) -> list[Tag]:
    return [Tag(*tag) for tag in face_tags(solid)]


def _known_form(solid: BuiltSolid, form: str | None) -> str:
    """The form that is meant."""
    if form is None:
        return "assembly" if isinstance(solid, SweptSolid) else "solid"
    require(form in FORMS, f"form must be one of {', '.join(FORMS)}, found {form!r}")
    require(
        form == "assembly" or not isinstance(solid, SweptSolid),
        "STEP as one solid is for round members with spheres: for other profiles take the form 'assembly', which has a "
        "solid for each curve and each node, or an STL or 3MF file, whose mesh is united",
    )
    return form


def _require_space(path: Path, size: int) -> None:
    free = shutil.disk_usage(path.parent).free
    require(
        free > size,
        f"{path} would take about {size / 1e6:.3g} MB, but {free / 1e6:.3g} MB are free: "
        "free space, choose another folder, or build fewer curves",
    )
