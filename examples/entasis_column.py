"""The entasis of a Greek column on the compression family of a pillar (Arora et al. 2019, Figure 20).

Constants for the CadQuery editor and `cadquery.cqgi`; as a plain script it draws `entasis_column.png`. Give the design
file of a pillar of your own, or have the hollow one below designed.
"""

import build123d as bd

import michell_cad as mc
from michell_cad.edits import Entasis, Family, Radius
from michell_cad.job import Setup
from michell_cad.stage_cache import StageCache

entasis = 0.9  # the members of the compression family are thicker by this fraction in the middle of each curve
others = 0.6  # radius of the other families over the default
design_file = ""

if design_file:
    design, knobs = mc.load_design(design_file)
else:
    pillar = bd.Cylinder(30, 140) - bd.Cylinder(14, 140)
    setup = Setup.model_validate(
        {
            "support": [{"faces": "<Z"}],
            "load": [{"faces": ">Z", "force": [0.0, 0.0, -2000.0]}],
        }
    )
    problem = mc.build_problem(setup, mc.part_from_cad(pillar, mesh_size=8.0))
    design, knobs = mc.design(problem, mc.DesignOptions(spacing=18.0), cache=StageCache.usual()), mc.Knobs()

edits = mc.EditList(
    (
        Radius(where=~Family("compression"), times=others),
        Entasis(where=Family("compression"), to=entasis),
    )
)
structure = edits.replay(design, knobs)
solid = mc.build_solid(mc.size_structure(structure), knobs)

if __name__ == "__main__":
    mc.render_truss("entasis_column.png", structure.whole_mesh, solid.sized)
    print(f"{solid.report.solids} solid, {solid.report.volume_mm3:.0f} mm3, see entasis_column.png")
else:
    show_object(solid.cadquery, name="column")  # pyright: ignore[reportUndefinedVariable]
