"""How strong a truss is: its beam model, the loads that the part hands to it, and radii that suit them."""

from michell_cad.strength.beam_model import BeamModel, build_beam_model
from michell_cad.strength.beam_solution import BeamSolution
from michell_cad.strength.beam_solver import solve_beams
from michell_cad.strength.loads import TrussLoading, add_off_axis_cases, carry_over_loads
from michell_cad.strength.mechanism import keep_supported
from michell_cad.strength.sized_for_loads import Build, Buildable
from michell_cad.strength.sizing import SizingOptions, SizingReport, size_members
from michell_cad.strength.strength_report import StrengthReport, measure_strength, strength_block
from michell_cad.strength.strengthen import (
    StrengthenReport,
    straighten,
    strengthen,
    strengthen_block,
)
from michell_cad.strength.strengthen_options import StrengthenOptions
from michell_cad.strength.thick_nodes import Balls

__all__ = [
    "Balls",
    "BeamModel",
    "BeamSolution",
    "Build",
    "Buildable",
    "SizingOptions",
    "SizingReport",
    "StrengthReport",
    "StrengthenOptions",
    "StrengthenReport",
    "TrussLoading",
    "add_off_axis_cases",
    "build_beam_model",
    "carry_over_loads",
    "keep_supported",
    "measure_strength",
    "size_members",
    "solve_beams",
    "straighten",
    "strength_block",
    "strengthen",
    "strengthen_block",
]
