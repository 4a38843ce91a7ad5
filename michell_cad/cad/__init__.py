"""The truss as CAD geometry: node spheres, fillets and tubes as one closed shell, its direct mesh, and their files.

Arrays until the last step: only the files `kernel*.py` import the CAD kernel (OCP), and only when a solid is made or
written.
"""

from michell_cad.cad.assembly import AssemblyPart, build_assembly
from michell_cad.cad.ball_rule import BallRule, rule_as_built, rule_at_rest
from michell_cad.cad.beam_lattice import BeamLattice, export_beam_lattice, sample_beams
from michell_cad.cad.brep import export_brep
from michell_cad.cad.built import BuiltSolid, curve_of_part
from michell_cad.cad.clearance import Crossings, crossing_members
from michell_cad.cad.formats import FORMATS, ExportOptions, FormatName, export_solid, file_name, format_of
from michell_cad.cad.glb import export_glb
from michell_cad.cad.keep import KeptSolid, keep_material, kept_shape
from michell_cad.cad.mesh import TrussMesh, mesh_truss
from michell_cad.cad.mesh_groups import coloured_triangles
from michell_cad.cad.prepare import prepare_truss
from michell_cad.cad.prepared import PreparedTruss, node_room
from michell_cad.cad.preview import PreviewMesh, preview_truss
from michell_cad.cad.profile_files import profile_from_cad, read_profile
from michell_cad.cad.shell_plan import FaceRole
from michell_cad.cad.solid import TrussSolid, build_round_solid, build_solid
from michell_cad.cad.solid_report import KeptReport, SolidReport, SweptReport
from michell_cad.cad.step import StepForm, StepSchema, export_step, forecast_step, read_step_summary
from michell_cad.cad.stl import export_stl
from michell_cad.cad.swept_solid import SweptSolid, build_swept, swept_volume
from michell_cad.cad.target_volume import resolve_radius
from michell_cad.cad.threemf import export_3mf
from michell_cad.cad.unite import unite
from michell_cad.palette import COLOURS

__all__ = [
    "COLOURS",
    "FORMATS",
    "AssemblyPart",
    "BallRule",
    "BeamLattice",
    "BuiltSolid",
    "Crossings",
    "ExportOptions",
    "FaceRole",
    "FormatName",
    "KeptReport",
    "KeptSolid",
    "PreparedTruss",
    "PreviewMesh",
    "SolidReport",
    "StepForm",
    "StepSchema",
    "SweptReport",
    "SweptSolid",
    "TrussMesh",
    "TrussSolid",
    "build_assembly",
    "build_round_solid",
    "build_solid",
    "build_swept",
    "coloured_triangles",
    "crossing_members",
    "curve_of_part",
    "export_3mf",
    "export_beam_lattice",
    "export_brep",
    "export_glb",
    "export_solid",
    "export_step",
    "export_stl",
    "file_name",
    "forecast_step",
    "format_of",
    "keep_material",
    "kept_shape",
    "mesh_truss",
    "node_room",
    "prepare_truss",
    "preview_truss",
    "profile_from_cad",
    "read_profile",
    "read_step_summary",
    "resolve_radius",
    "rule_as_built",
    "rule_at_rest",
    "sample_beams",
    "swept_volume",
    "unite",
]
