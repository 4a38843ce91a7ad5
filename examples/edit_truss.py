"""Turn the knobs of a finished truss: the constants below, in the CadQuery editor or through `cadquery.cqgi`.

Run from the project's root. As a plain script (`python examples/edit_truss.py`) it draws `edit_truss.png`.
"""

import michell_cad as mc

radius = 2.0  # mm
entasis = 0.3  # members thicker by this fraction in the middle of each curve
family = "all"  # all, tension, compression or third
every = 1  # keep every n-th curve
design_file = (
    ""  # a design.npz that `michell-cad design` wrote; empty: the cantilever of the examples, with large cells
)

if design_file:
    (design, knobs), edits = mc.load_design(design_file), mc.load_edits(design_file)
else:
    design = mc.design_job("examples/cantilever.toml", mc.DesignOptions(resolution=8))
    knobs, edits = mc.Knobs(), mc.EditList()

knobs = mc.change_knobs(knobs, {"radius": radius, "entasis": entasis, "family": family, "every": every})
structure = edits.replay(design, knobs)
solid = mc.build_solid(mc.size_structure(structure), knobs)

if __name__ == "__main__":
    mc.render_truss("edit_truss.png", structure.whole_mesh, solid.sized)
    print(f"{solid.report.solids} solids, {solid.report.volume_mm3:.0f} mm3, see edit_truss.png")
else:
    show_object(solid.cadquery, name="truss")  # pyright: ignore[reportUndefinedVariable]
