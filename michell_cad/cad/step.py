"""STEP files: one solid per connected component, every face named after its curve and coloured by its family."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from michell_cad.arrays import require
from michell_cad.cad.solid import TrussSolid
from michell_cad.files import writing

if TYPE_CHECKING:
    from michell_cad.cad.kernel import StepSummary

COLOURS = {
    "tension": (0.84, 0.37, 0.0),
    "compression": (0.0, 0.45, 0.70),
    "third": (0.0, 0.62, 0.45),
    "feature": (0.6, 0.6, 0.6),
    "brace": (0.80, 0.47, 0.65),
    "node": (0.8, 0.8, 0.8),
}
"""sRGB colours of the families and of the nodes; from the palette of Okabe and Ito, made for colour-blind eyes."""

SCHEMAS = {"AP214": "AP214IS", "AP242": "AP242DIS"}
"""The kernel's names of the STEP schemas."""


def export_step(
    solid: TrussSolid, path: str | Path, schema: str = "AP214", progress: Callable[[float], None] | None = None
) -> None:
    """Write the solids as STEP, in mm, with names and colours; the file is there whole or not at all.

    Raises
    ------
    InvalidInputError
        If the schema is not one of `SCHEMAS`.
    GeometryKernelError
        If the kernel cannot write the file.
    """
    from michell_cad.cad import kernel

    require(schema in SCHEMAS, f"schema must be one of {', '.join(SCHEMAS)}, found {schema!r}")
    curves = solid.prepared.sized.truss.curves
    labels = [(curve.name, COLOURS[curve.family]) for curve in curves]
    faces = []
    for face, component, curve, owner in zip(
        solid.faces, solid.face_component.tolist(), solid.face_curve.tolist(), solid.face_owner.tolist(), strict=True
    ):
        name, colour = labels[curve] if curve >= 0 else (f"node {owner}", COLOURS["node"])
        faces.append((face, component, name, colour))
    names = ["truss"] if len(solid.solids) == 1 else [f"truss {i + 1}" for i in range(len(solid.solids))]
    with writing(Path(path)) as partial:
        kernel.write_step_file(partial, list(zip(solid.solids, names, strict=True)), faces, SCHEMAS[schema], progress)


def read_step_summary(path: str | Path) -> "StepSummary":
    """Solids, validity, volume and faces of a STEP file, as the kernel reads it."""
    from michell_cad.cad import kernel

    return kernel.read_step_file(Path(path))
