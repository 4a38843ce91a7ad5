"""What else could be built of the same material in the same part, and how it does under the same loads."""

from michell_cad.strength.comparison.compare import Candidate, Row, compare_trusses, voxel_rows
from michell_cad.strength.comparison.grids import regular_grid
from michell_cad.strength.comparison.ground_structure import GroundStructureOptions, optimal_ground_structure
from michell_cad.strength.comparison.hexes import hex_truss
from michell_cad.strength.comparison.rivals import standard_rivals
from michell_cad.strength.comparison.union_volume import scale_to_union, union_volume
from michell_cad.strength.comparison.voxel_model import voxel_surface
from michell_cad.strength.comparison.voxel_optimisation import (
    VoxelDesign,
    VoxelOptions,
    optimise_voxels,
    require_voxels,
)

__all__ = [
    "Candidate",
    "GroundStructureOptions",
    "Row",
    "VoxelDesign",
    "VoxelOptions",
    "compare_trusses",
    "hex_truss",
    "optimal_ground_structure",
    "optimise_voxels",
    "regular_grid",
    "require_voxels",
    "scale_to_union",
    "standard_rivals",
    "union_volume",
    "voxel_rows",
    "voxel_surface",
]
