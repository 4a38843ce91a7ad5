"""An arched bridge with lamps along its arches and sheets across them (Arora et al. 2019, Figures 18 and 19).

Constants for the CadQuery editor and `cadquery.cqgi`; as a plain script it draws `arched_bridge.png`. Give the design
file of a bridge of your own (y up), or have the one below designed.
"""

import build123d as bd
import numpy as np

import michell_cad as mc
from michell_cad.cad.plates import place_copies, solid_of_plate
from michell_cad.edits import AddSheet, Attach, Family, Where, attachment_frames, build_sheets
from michell_cad.job import Setup
from michell_cad.picture import ShownMesh
from michell_cad.stage_cache import StageCache

lamp_spacing = 30.0  # mm along the curves
sheet_thickness = 1.0  # mm
sheet_family = "third"  # the sheets run across this family
sheets_every = 3  # every n-th isosurface
design_file = ""

if design_file:
    design, knobs = mc.load_design(design_file)
else:
    arch = bd.Cylinder(160, 60) - bd.Cylinder(125, 60) - bd.Pos(0, -130, 0) * bd.Box(400, 260, 60)
    deck = bd.Pos(0, 150, 0) * bd.Box(260, 20, 60)
    setup = Setup.model_validate(
        {
            "support": [{"faces": "<Y"}],
            "load": [{"faces": ">Y", "force": [0.0, -4000.0, 0.0]}],
        }
    )
    problem = mc.build_problem(setup, mc.part_from_cad((arch + deck).solid(), mesh_size=9.0))
    design, knobs = mc.design(problem, mc.DesignOptions(spacing=15.0), cache=StageCache.usual()), mc.Knobs()

lamps = Attach(
    where=Family("compression") & Where("boundary"), part="lamp.step", spacing=lamp_spacing, up=(0.0, 1.0, 0.0)
)
sheets = AddSheet(coordinate=sheet_family, low=-1000, high=1000, every=sheets_every, thickness=sheet_thickness)
structure = mc.EditList((lamps, sheets)).replay(design, knobs)
sized = mc.size_structure(structure)
plates, frames = build_sheets(structure), attachment_frames(structure, lamps)

if __name__ == "__main__":
    ball = (
        np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 0], [0, 0, -1]], float)
        * 0.25
        * sized.truss.spacing
    )
    eight = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]])
    at = (frames.origins[:, None] + np.einsum("nij,kj->nki", frames.axes, ball)).reshape(-1, 3)
    faces = (eight + 6 * np.arange(len(frames.origins))[:, None, None]).reshape(-1, 3)
    shown = [ShownMesh("lamps", (0.95, 0.85, 0.2), at, faces)]
    shown += [ShownMesh("sheet", (0.5, 0.7, 0.5), plate.vertices, plate.triangles) for plate in plates]
    mc.render_truss("arched_bridge.png", structure.whole_mesh, sized, up=1, others=shown)
    print(f"{len(frames.origins)} lamps, {len(plates)} sheets, see arched_bridge.png")
else:
    lamp = bd.Cylinder(0.5, 6) + bd.Pos(0, 0, 4) * bd.Sphere(2)
    show_object(mc.build_solid(sized, knobs).cadquery, name="bridge")  # pyright: ignore[reportUndefinedVariable]
    show_object([solid_of_plate(plate) for plate in plates], name="sheets")  # pyright: ignore[reportUndefinedVariable]
    show_object(place_copies(lamp, frames), name="lamps")  # pyright: ignore[reportUndefinedVariable]
