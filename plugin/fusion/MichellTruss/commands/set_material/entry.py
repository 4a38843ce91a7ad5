"""Set Material: give the bodies of the curves on one isosurface of the parametrization a material of Fusion's."""

import adsk.core

from ...host import appearance, events, toolbar
from ...host.document import selected_truss
from ...host.preview import show_preview
from ...logic.isosurface import Isosurface, isosurfaces
from ...logic.layout import LayoutError
from ...logic.plan import Plan, make_plan
from ...logic.selection import apply_knobs

COMMAND = "MichellTrussMaterial"


def start() -> None:
    """Add the button."""
    toolbar.add_button(
        COMMAND, "Set Material", "Give the members on one isosurface of a truss a material.", __file__, _created
    )


def stop() -> None:
    """Take the button away."""
    toolbar.remove_button(COMMAND)


def _created(args: adsk.core.CommandCreatedEventArgs) -> None:
    design = events.active_design()
    truss = selected_truss(design)
    surfaces, names = isosurfaces(truss.layout), list(appearance.materials(design))
    if not surfaces or not names:
        raise LayoutError("This truss has no isosurfaces, or this document no materials.")
    inputs = args.command.commandInputs
    surface_input = _list(inputs, "michell_surface", "Isosurface", [surface.label for surface in surfaces])
    material_input = _list(inputs, "michell_material", "Material", names)

    def preview(_: adsk.core.CommandEventArgs) -> None:
        plan = make_plan(truss.layout, apply_knobs(truss.layout, truss.values))
        surface = surfaces[surface_input.selectedItem.index]
        on_surface = tuple(tube for tube in plan.tubes if surface.holds(truss.layout.curves[tube.curve]))
        show_preview(events.active_design(), Plan(on_surface, ()))

    def execute(_: adsk.core.CommandEventArgs) -> None:
        surface = surfaces[surface_input.selectedItem.index]
        material = material_input.selectedItem.name
        if not appearance.give_material(events.active_design(), truss, surface, material):
            raise LayoutError(f"No drawn curve lies {surface.label}: choose another level, or draw more curves first.")
        truss.remember_materials([*truss.materials, _entry(surface, material)])

    events.on_command(args.command.executePreview, preview)
    events.on_command(args.command.execute, execute)


def _entry(surface: Isosurface, material: str) -> dict[str, int | str]:
    """What the document remembers, so that Edit Truss gives the material again."""
    return {"axis": surface.axis, "value": surface.value, "material": material}


def _list(inputs: adsk.core.CommandInputs, name: str, title: str, choices: list[str]) -> adsk.core.DropDownCommandInput:
    drop_down = inputs.addDropDownCommandInput(name, title, adsk.core.DropDownStyles.TextListDropDownStyle)
    for number, choice in enumerate(choices):
        drop_down.listItems.add(choice, number == 0, "", -1)
    return drop_down
