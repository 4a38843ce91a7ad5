"""Three trusses made into one: the parts of a lander joined at their common faces (Arora et al. 2019, Figure 17).

As a plain script it draws `joined_lander.png`. Each part is designed for itself; the nodes on their common faces then
meet. Give the design files of parts of your own, in the same coordinates, or have the three below designed.
"""

import tempfile
from pathlib import Path

import build123d as bd

import michell_cad as mc
from michell_cad.edits import Join, Radius
from michell_cad.job import Setup
from michell_cad.stage_cache import StageCache

radius = 1.2  # mm, of all members
design_files = ""  # several, separated by commas: the first takes on the others

PARTS = (
    (bd.Box(90, 60, 40), "<Z", ">Z"),
    (bd.Pos(75, 0, 0) * bd.Box(60, 30, 30), "<X", ">X"),
    (bd.Pos(-75, 0, 0) * bd.Box(60, 30, 30), ">X", "<X"),
)
"""Body and two legs: each held at its first face and loaded at its second."""

files = [Path(name.strip()) for name in design_files.split(",") if name.strip()]
if not files:
    folder = Path(tempfile.mkdtemp())
    for number, (part, held, loaded) in enumerate(PARTS):
        setup = Setup.model_validate(
            {"support": [{"faces": held}], "load": [{"faces": loaded, "force": [40.0, 0.0, -500.0]}]}
        )
        problem = mc.build_problem(setup, mc.part_from_cad(part, mesh_size=6.5))
        design = mc.design(problem, mc.DesignOptions(spacing=13.0), cache=StageCache.usual())
        files.append(folder / f"part_{number}.npz")
        mc.save_design(files[-1], design, mc.Knobs())

design, knobs = mc.load_design(files[0])
knobs = mc.change_knobs(knobs, {"radius": radius})
joins = tuple(Join(design=str(file)) for file in files[1:])
structure = mc.EditList(joins).then(Radius(to=radius)).replay(design, knobs)
solid = mc.build_solid(mc.size_structure(structure), knobs)

if __name__ == "__main__":
    mc.render_truss("joined_lander.png", structure.whole_mesh, solid.sized)
    print(f"{solid.report.solids} solid of {len(files)} trusses, {solid.report.members} members, see joined_lander.png")
else:
    show_object(solid.cadquery, name="lander")  # pyright: ignore[reportUndefinedVariable]
