"""Other profiles: a hollow pillar of flat bars whose families meet in faceted nodes, as one would cast or print it.

Constants for the CadQuery editor and `cadquery.cqgi`; as a plain script it draws `hexagonal_pillar.png` and writes
`hexagonal_pillar.step`, a solid for each curve and each node. `profile` may be a name, or points of an outline.
"""

import build123d as bd

import michell_cad as mc
from michell_cad.cad import coloured_triangles
from michell_cad.job import Setup
from michell_cad.palette import group_colour
from michell_cad.picture import ShownMesh
from michell_cad.stage_cache import StageCache

profile = "hexagon"
profile_aspect = 1.6  # over a regular hexagon, along the next family
node_form = "hull"
radius = 1.7  # mm, of the circle of the same area

pillar = bd.Cylinder(30, 140) - bd.Cylinder(14, 140)
setup = Setup.model_validate({"support": [{"faces": "<Z"}], "load": [{"faces": ">Z", "force": [0.0, 0.0, -2000.0]}]})
problem = mc.build_problem(setup, mc.part_from_cad(pillar, mesh_size=8.0))
design = mc.design(problem, mc.DesignOptions(spacing=18.0), cache=StageCache.usual())
knobs = mc.Knobs.model_validate(
    {"profile": profile, "profile_aspect": profile_aspect, "node_form": node_form, "radius": radius}
)
solid = mc.build_solid(mc.apply_knobs(design.truss, knobs), knobs)

if __name__ == "__main__":
    families = coloured_triangles(solid).items()
    shown = [ShownMesh(name, group_colour(name), solid.mesh.vertices, triangles) for name, triangles in families]
    mc.render_truss("hexagonal_pillar.png", problem.mesh, solid.sized, solids=shown)
    mc.export_step(solid, "hexagonal_pillar.step")
    print(f"{len(solid.solids)} solids, {solid.report.volume_mm3:.0f} mm3 united, see hexagonal_pillar.png")
else:
    show_object(solid.cadquery, name="pillar")  # pyright: ignore[reportUndefinedVariable]
