"""Runs inside FreeCAD: opens the walk's document and asks for members thicker than their cells."""

import os

import FreeCAD as App
from michell_workbench import headless


def main() -> None:
    """Turn a knob too far."""
    from michell_workbench.trusses import update

    document = App.openDocument(os.environ["WALK_FOLDER"] + "/walk.FCStd")
    truss = document.getObject("MichellTruss")
    truss.setExpression("Entasis", None)
    truss.Radius = 500
    update(document)


headless.run(main)
