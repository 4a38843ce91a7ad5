"""How a truss looks: every face in the colour of its family, an icon in the tree, a double click opens its form."""

from typing import Any

from michell_workbench.places import icon

PLAIN = (0.8, 0.8, 0.8)
"""Colour of a whole shape, for faces that have none."""


class TrussView:
    """What FreeCAD asks of the view of a truss."""

    def __init__(self, view: Any) -> None:
        view.Proxy = self
        view.LineWidth = 1.0
        view.DisplayMode = "Shaded"
        view.SelectionStyle = "BoundBox"  # the colours stay in sight while knobs are turned
        paint(view)

    def updateData(self, obj: Any, name: str) -> None:
        """Colour the faces of a new shape: when `Built` is set after it, as FreeCAD first has to make its triangles."""
        if name == "Built" and obj.ViewObject is not None:
            paint(obj.ViewObject)

    def getIcon(self) -> str:
        """For the tree."""
        return icon("truss")

    def doubleClicked(self, view: Any) -> bool:
        """Open the form with the supports and loads, or say why it cannot be."""
        from michell_workbench.commands import tell
        from michell_workbench.panel import open_panel

        try:
            open_panel(view.Object)
        except ValueError as error:
            tell(str(error))
        return True

    def dumps(self) -> None:
        """Everything is in the object."""

    def loads(self, state: None) -> None:
        """Everything is in the object."""

    __getstate__, __setstate__ = dumps, loads  # their names before FreeCAD 0.22


def paint(view: Any) -> None:
    """Colour the faces after their families."""
    obj = view.Object
    colours, families = getattr(obj, "FamilyColours", []), getattr(obj, "FaceFamilies", [])
    if len(families) == len(obj.Shape.Faces) and families:
        view.ShapeColor = PLAIN
        view.DiffuseColor = [(*colours[family][:3], 0.0) for family in families]
