"""FreeCAD runs this at every start with a window: it registers the workbench, whose modules load when it is chosen."""

import FreeCADGui as Gui


class MichellWorkbench(Gui.Workbench):
    """Stress-aligned trusses."""

    def __init__(self):
        # FreeCAD runs this file by `exec`: names of the module are out of reach here, imports are not.
        from michell_workbench.places import icon
        from michell_workbench.texts import translate

        self.__class__.Icon = icon("workbench")
        self.__class__.MenuText = translate("MichellCAD", "Michell trusses")
        self.__class__.ToolTip = translate("MichellCAD", "Stress-aligned trusses of any body, with live knobs")

    def Initialize(self):
        """Called once, when the workbench is first chosen."""
        from michell_workbench.commands import add_commands
        from michell_workbench.texts import translate

        names = add_commands()
        title = translate("MichellCAD", "Michell trusses")
        self.appendToolbar(title, names)
        self.appendMenu(title, names)

    def GetClassName(self):
        """The kind of workbench, as FreeCAD wants it for those written in Python."""
        return "Gui::PythonWorkbench"


def _add_preferences():
    from michell_workbench.places import RESOURCES, TRANSLATIONS

    Gui.addPreferencePage(str(RESOURCES / "preferences.ui"), "Michell")
    Gui.addLanguagePath(str(TRANSLATIONS))
    Gui.updateLocale()  # else the path counts from the next change of the language on


_add_preferences()
Gui.addWorkbench(MichellWorkbench())
