"""The solid of a truss checked: quadratic tets under the loads and supports of the truss."""

from michell_cad.strength.solid.check import SolidCheck, check_solid
from michell_cad.strength.solid.quadratic_mesh import QuadraticMesh
from michell_cad.strength.solid.solid_deck import write_solid_deck
from michell_cad.strength.solid.solid_loading import SolidLoading, carry_to_solid
from michell_cad.strength.solid.solid_mesh import mesh_solid
from michell_cad.strength.solid.solid_solution import SolidSolution, solve_solid

__all__ = [
    "QuadraticMesh",
    "SolidCheck",
    "SolidLoading",
    "SolidSolution",
    "carry_to_solid",
    "check_solid",
    "mesh_solid",
    "solve_solid",
    "write_solid_deck",
]
