"""The truss as CAD geometry: node spheres, fillets and tubes as one closed shell, its direct mesh, STEP and STL.

Arrays until the last step: only `kernel.py` imports the CAD kernel (OCP), and only when a solid is made.
"""

from michell_cad.cad.clearance import Crossings, crossing_members
from michell_cad.cad.mesh import TrussMesh, mesh_truss
from michell_cad.cad.prepare import prepare_truss
from michell_cad.cad.prepared import PreparedTruss
from michell_cad.cad.preview import PreviewMesh, preview_truss
from michell_cad.cad.shell_plan import FaceRole
from michell_cad.cad.solid import SolidReport, TrussSolid, build_solid, curve_of_part
from michell_cad.cad.step import COLOURS, export_step, read_step_summary
from michell_cad.cad.stl import export_stl
from michell_cad.cad.target_volume import resolve_radius

__all__ = [
    "COLOURS",
    "Crossings",
    "FaceRole",
    "PreparedTruss",
    "PreviewMesh",
    "SolidReport",
    "TrussMesh",
    "TrussSolid",
    "build_solid",
    "crossing_members",
    "curve_of_part",
    "export_step",
    "export_stl",
    "mesh_truss",
    "prepare_truss",
    "preview_truss",
    "read_step_summary",
    "resolve_radius",
]
