"""What a process pays once: compiled loops are built, or read from numba's cache, before any stage is timed.

Source: none. numba compiles a loop when it first meets arguments of new types, which takes seconds on the first run of
all and tenths of a second later; nothing of it belongs to the part at hand. Rather than listing the loops and their
types once more, the stages that use them run here on a cube of six tets.
"""

from functools import cache

import numpy as np

from michell_cad.elasticity import solve_elasticity
from michell_cad.frame_field import FrameFieldOptions, fit_frame_field
from michell_cad.isocurves import trace_isocurves
from michell_cad.metrics import name_families
from michell_cad.parametrization import parametrize
from michell_cad.problem import DesignProblem, LoadCase, Material
from michell_cad.tet_mesh import TetMesh

_CORNERS = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
_KUHN = np.array([[0, 4, 6, 7], [0, 4, 5, 7], [0, 2, 6, 7], [0, 2, 3, 7], [0, 1, 5, 7], [0, 1, 3, 7]])
"""The six tets of Kuhn in a cube, all along its diagonal."""


@cache
def load_compiled_loops() -> None:
    """Have every compiled loop and the sparse solver ready; a second call returns at once."""
    mesh = TetMesh(_CORNERS, _KUHN)
    held = np.repeat(_CORNERS[:, :1] == 0, 3, axis=1)
    pull = np.where(held, 0.0, [1.0, 0.0, -1.0])
    problem = DesignProblem(mesh, Material("any", 1.0, 0.3, 1.0, 1.0), held, (LoadCase("pull", pull),))
    stress_field = solve_elasticity(problem)
    frame_field = fit_frame_field(mesh, stress_field, FrameFieldOptions(starts=1, smoothness=(1.0,)))
    parametrization = parametrize(mesh, stress_field, frame_field)
    levels, _ = parametrization.levels(resolution=2.0)
    trace_isocurves(mesh, levels, name_families(mesh, stress_field.stress, parametrization.tangents))
