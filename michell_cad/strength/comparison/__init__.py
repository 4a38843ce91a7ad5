"""What else could be built of the same material in the same part, and how it does under the same loads."""

from michell_cad.strength.comparison.compare import Candidate, Row, compare_trusses, standard_rivals
from michell_cad.strength.comparison.grids import regular_grid
from michell_cad.strength.comparison.ground_structure import GroundStructureOptions, optimal_ground_structure
from michell_cad.strength.comparison.hex_truss import hex_truss
from michell_cad.strength.comparison.union_volume import scale_to_union, union_volume

__all__ = [
    "Candidate",
    "GroundStructureOptions",
    "Row",
    "compare_trusses",
    "hex_truss",
    "optimal_ground_structure",
    "regular_grid",
    "scale_to_union",
    "standard_rivals",
    "union_volume",
]
