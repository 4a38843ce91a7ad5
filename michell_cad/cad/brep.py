"""BREP files, the quickest way into another program with the same kernel, and the family of every face."""

from pathlib import Path

import numpy as np
from jaxtyping import Int

from michell_cad.cad.solid import TrussSolid
from michell_cad.files import writing

NODES = "node"
"""What the faces of nodes belong to instead of a family."""


def face_order(solid: TrussSolid) -> Int[np.ndarray, " n_f"]:
    """Numbers of the faces in the order in which the kernel, and every program built on it, counts them."""
    return np.argsort(solid.face_component, kind="stable")


def face_families(solid: TrussSolid) -> tuple[tuple[str, ...], Int[np.ndarray, " n_f"]]:
    """Names of the families, and for every face, in the kernel's order, the number of its family among them."""
    family = np.array([*(curve.family for curve in solid.prepared.sized.truss.curves), NODES])
    names, numbers = np.unique(family[solid.face_curve[face_order(solid)]], return_inverse=True)
    return tuple(names.tolist()), numbers


def export_brep(solid: TrussSolid, path: str | Path) -> None:
    """Write the solids as one BREP, in mm; the file is there whole or not at all."""
    from michell_cad.cad import kernel

    with writing(Path(path)) as partial:
        kernel.write_brep_file(partial, solid.solids)


def export_family_breps(solid: TrussSolid, folder: Path) -> dict[str, str]:
    """Write the faces of every family as ``FAMILY.brep``; returns the names of the files by family."""
    from michell_cad.cad import kernel

    names, numbers = face_families(solid)
    order, files = face_order(solid), {name: f"{name}.brep" for name in names}
    for k, name in enumerate(names):
        with writing(folder / files[name]) as partial:
            kernel.write_brep_file(partial, [solid.faces[f] for f in order[numbers == k].tolist()])
    return files
