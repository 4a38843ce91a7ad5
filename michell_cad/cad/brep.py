"""BREP files, the CAD kernel's own format: nothing is converted, so reading one is quick; it holds no names.

For programs with the same kernel the family of every face is given beside it.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from jaxtyping import Int

from michell_cad.cad.built import BuiltSolid
from michell_cad.cad.shell_plan import FaceRole
from michell_cad.files import path_with_suffix, writing

NODES, KEPT = "node", "kept"
"""What the faces of nodes and of kept solids belong to instead of a family."""


def export_brep(
    solid: BuiltSolid, path: str | Path, binary: bool = False, progress: Callable[[float], None] | None = None
) -> None:
    """Write the solids as BREP, in mm, as text or binary; the file is there whole or not at all.

    Raises
    ------
    InvalidInputError
        For another extension than .brep or .brp, and if the file cannot be written.
    """
    from michell_cad.cad import kernel_files

    with writing(path_with_suffix(path, ".brep", ".brp")) as partial:
        kernel_files.write_brep_file(partial, solid.solids, binary)
    if progress is not None:
        progress(1.0)


def face_order(solid: BuiltSolid) -> Int[np.ndarray, " n_f"]:
    """Numbers of the faces in the order in which the kernel, and every program built on it, counts them."""
    return np.argsort(solid.face_component, kind="stable")


def face_families(solid: BuiltSolid) -> tuple[tuple[str, ...], Int[np.ndarray, " n_f"]]:
    """Names of the families, and for every face, in the kernel's order, the number of its family among them."""
    family = np.array([*(curve.family for curve in solid.sized.truss.curves), NODES])
    of_face = np.where(solid.face_role == FaceRole.KEPT, KEPT, family[solid.face_curve])
    names, numbers = np.unique(of_face[face_order(solid)], return_inverse=True)
    return tuple(names.tolist()), numbers


def export_family_breps(solid: BuiltSolid, folder: Path) -> dict[str, str]:
    """Write the faces of every family as ``FAMILY.brep``; returns the names of the files by family."""
    from michell_cad.cad import kernel_files

    names, numbers = face_families(solid)
    order, files = face_order(solid), {name: f"{name}.brep" for name in names}
    for k, name in enumerate(names):
        with writing(folder / files[name]) as partial:
            kernel_files.write_brep_file(partial, [solid.faces[f] for f in order[numbers == k].tolist()])
    return files
