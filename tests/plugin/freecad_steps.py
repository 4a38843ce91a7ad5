"""Steps that the scripts inside FreeCAD share."""

import os
from pathlib import Path

FOLDER = Path(os.environ["WALK_FOLDER"])


def state(truss, file=None):
    """What a truss shows; its shape goes to a file, to be measured by more than FreeCAD's plain rule."""
    from michell_workbench.trusses import read_knobs

    if file is not None:
        truss.Shape.exportBrep(str(FOLDER / file))
    return {
        "file": file,
        "volume": truss.Shape.Volume,
        "valid": truss.Shape.isValid(),
        "told_volume": truss.SolidVolume,
        "told_mass": truss.SolidMass,
        "knobs": read_knobs(truss),
        "state": list(truss.State),
        "status": truss.Status,
        "faces": len(truss.Shape.Faces),
        "families": sorted({truss.FamilyNames[k] for k in truss.FaceFamilies}),
        "coloured": len(truss.FaceFamilies),
    }


def turn(document, truss, changes, file):
    """Turn knobs and recompute."""
    from michell_workbench.trusses import update

    for name, value in changes.items():
        setattr(truss, name, value)
    update(document)
    return state(truss, file)


def describe(truss):
    """The properties that are knobs: type, tooltip, value, and bounds as the property enforces them."""
    rows = {}
    for name in truss.PropertiesList:
        if truss.getGroupOfProperty(name) != "Knobs":
            continue
        kind, value = truss.getTypeIdOfProperty(name), getattr(truss, name)
        row = {"kind": kind, "help": truss.getDocumentationOfProperty(name), "value": getattr(value, "Value", value)}
        if kind.endswith("Constraint"):
            row["bounds"] = clamps(truss, name)
        if kind.endswith("Enumeration"):
            row["choices"] = truss.getEnumerationsOfProperty(name)
        rows[name] = row
    return rows


def clamps(truss, name):
    """What a property makes of a value far too small and one far too large."""
    before, found = getattr(truss, name), []
    for far in (-1000000, 1000000):
        setattr(truss, name, far)
        found.append(getattr(truss, name))
    setattr(truss, name, before)
    return found
