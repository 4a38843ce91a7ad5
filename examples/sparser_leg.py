"""Sparser variations of one truss: the same curves, chosen by their labels (Arora et al. 2019, Figure 17).

Constants for the CadQuery editor and `cadquery.cqgi`; as a plain script it draws `sparser_leg_1.png`, `_2` and `_3`.
Give the design file of a leg of your own, or have the tapered one below designed.
"""

import build123d as bd

import michell_cad as mc
from michell_cad.job import Setup
from michell_cad.stage_cache import StageCache

every = 2  # keep every n-th curve of all families
offset = 0
volume_fraction = 0.06  # the radius follows from it
design_file = ""

if design_file:
    design, knobs = mc.load_design(design_file)
else:
    leg = bd.loft([bd.Plane.YZ * bd.Rectangle(44, 44), bd.Plane.YZ.offset(150) * bd.Rectangle(28, 28)])
    setup = Setup.model_validate(
        {
            "support": [{"faces": "<X"}],
            "load": [{"faces": ">X", "force": [-300.0, 0.0, 120.0]}],
        }
    )
    problem = mc.build_problem(setup, mc.part_from_cad(leg, mesh_size=7.0))
    design, knobs = mc.design(problem, mc.DesignOptions(spacing=10.0), cache=StageCache.usual()), mc.Knobs()


def build(every: int) -> mc.BuiltSolid:
    """Return the solid of every n-th curve, at the same volume."""
    wanted = mc.change_knobs(knobs, {"every": every, "offset": offset, "volume_fraction": volume_fraction})
    structure = mc.EditList().replay(design, wanted)
    mesh, density = structure.whole_mesh, design.problem.material.density
    found = mc.resolve_radius(
        wanted, lambda k: mc.size_structure(structure, k), design.truss.spacing, float(mesh.volumes.sum()), density
    )
    return mc.build_solid(mc.size_structure(structure, found), found)


if __name__ == "__main__":
    for n in (1, 2, 3):
        solid = build(n)
        mc.render_truss(f"sparser_leg_{n}.png", design.problem.mesh, solid.sized)
        print(f"every {n}: {solid.report.members} members, {solid.report.volume_mm3:.0f} mm3, see sparser_leg_{n}.png")
else:
    show_object(build(every).cadquery, name="leg")  # pyright: ignore[reportUndefinedVariable]
