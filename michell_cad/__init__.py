"""Stress-aligned trusses of any 3D part, as editable CAD solids.

The public names, listed one by one; each is imported from its module when it is first used, so that importing the
package costs nothing and CAD is loaded only by those who need it.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from michell_cad.cad import (
        BuiltSolid,
        ExportOptions,
        KeptSolid,
        SweptSolid,
        TrussSolid,
        build_solid,
        export_3mf,
        export_beam_lattice,
        export_brep,
        export_glb,
        export_solid,
        export_step,
        export_stl,
        forecast_step,
        keep_material,
        kept_shape,
        profile_from_cad,
        read_profile,
        resolve_radius,
        unite,
    )
    from michell_cad.delivery import deliver_job, design_job, design_options
    from michell_cad.delivery_edit import deliver_edit
    from michell_cad.delivery_export import export_design
    from michell_cad.delivery_strength import deliver_strength
    from michell_cad.design_file import load_design, load_edits, open_structure, save_design
    from michell_cad.domain import Part, part_from_cad, read_part
    from michell_cad.edits import EditList, Structure, change_knobs, read_script, size_structure, write_script
    from michell_cad.errors import ConvergenceError, GeometryKernelError, InvalidInputError, MichellError
    from michell_cad.job import Job, build_problem, read_job
    from michell_cad.knobs import Knobs, apply_knobs
    from michell_cad.picture import render_truss
    from michell_cad.pipeline import Design, DesignOptions, design
    from michell_cad.problem import DesignProblem, LoadCase, Material
    from michell_cad.scripting.build123d_objects import MichellTruss, SavedTruss
    from michell_cad.scripting.cadquery_plugin import michell_truss, saved_truss
    from michell_cad.tet_mesh import TetMesh
    from michell_cad.truss import SizedTruss, Truss

_HOME = {
    "BuiltSolid": "cad",
    "ConvergenceError": "errors",
    "Design": "pipeline",
    "DesignOptions": "pipeline",
    "DesignProblem": "problem",
    "EditList": "edits",
    "ExportOptions": "cad",
    "GeometryKernelError": "errors",
    "InvalidInputError": "errors",
    "Job": "job",
    "KeptSolid": "cad",
    "Knobs": "knobs",
    "LoadCase": "problem",
    "Material": "problem",
    "MichellError": "errors",
    "MichellTruss": "scripting.build123d_objects",
    "Part": "domain",
    "SavedTruss": "scripting.build123d_objects",
    "SizedTruss": "truss",
    "Structure": "edits",
    "SweptSolid": "cad",
    "TetMesh": "tet_mesh",
    "Truss": "truss",
    "TrussSolid": "cad",
    "apply_knobs": "knobs",
    "build_problem": "job",
    "build_solid": "cad",
    "change_knobs": "edits",
    "deliver_edit": "delivery_edit",
    "deliver_job": "delivery",
    "deliver_strength": "delivery_strength",
    "design": "pipeline",
    "design_job": "delivery",
    "design_options": "delivery",
    "export_3mf": "cad",
    "export_beam_lattice": "cad",
    "export_brep": "cad",
    "export_design": "delivery_export",
    "export_glb": "cad",
    "export_solid": "cad",
    "export_step": "cad",
    "export_stl": "cad",
    "forecast_step": "cad",
    "keep_material": "cad",
    "kept_shape": "cad",
    "load_design": "design_file",
    "load_edits": "design_file",
    "michell_truss": "scripting.cadquery_plugin",
    "open_structure": "design_file",
    "part_from_cad": "domain",
    "profile_from_cad": "cad",
    "read_job": "job",
    "read_part": "domain",
    "read_profile": "cad",
    "read_script": "edits",
    "render_truss": "picture",
    "resolve_radius": "cad",
    "save_design": "design_file",
    "saved_truss": "scripting.cadquery_plugin",
    "size_structure": "edits",
    "unite": "cad",
    "write_script": "edits",
}

__all__ = [
    "BuiltSolid",
    "ConvergenceError",
    "Design",
    "DesignOptions",
    "DesignProblem",
    "EditList",
    "ExportOptions",
    "GeometryKernelError",
    "InvalidInputError",
    "Job",
    "KeptSolid",
    "Knobs",
    "LoadCase",
    "Material",
    "MichellError",
    "MichellTruss",
    "Part",
    "SavedTruss",
    "SizedTruss",
    "Structure",
    "SweptSolid",
    "TetMesh",
    "Truss",
    "TrussSolid",
    "apply_knobs",
    "build_problem",
    "build_solid",
    "change_knobs",
    "deliver_edit",
    "deliver_job",
    "deliver_strength",
    "design",
    "design_job",
    "design_options",
    "export_3mf",
    "export_beam_lattice",
    "export_brep",
    "export_design",
    "export_glb",
    "export_solid",
    "export_step",
    "export_stl",
    "forecast_step",
    "keep_material",
    "kept_shape",
    "load_design",
    "load_edits",
    "michell_truss",
    "open_structure",
    "part_from_cad",
    "profile_from_cad",
    "read_job",
    "read_part",
    "read_profile",
    "read_script",
    "render_truss",
    "resolve_radius",
    "save_design",
    "saved_truss",
    "size_structure",
    "unite",
    "write_script",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'michell_cad' has no attribute {name!r}")
    value = getattr(import_module(f"michell_cad.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(__all__))
