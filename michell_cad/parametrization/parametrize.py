"""From frames to coordinates: the stage that puts the steps of this folder in order."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from jaxtyping import Float

from michell_cad.arrays import freeze, require
from michell_cad.constant_frames import constant_frames
from michell_cad.elasticity import StressField
from michell_cad.errors import InvalidInputError
from michell_cad.frame_field import FrameField, matching_metric
from michell_cad.parametrization.cells import measure_cells
from michell_cad.parametrization.equation_11 import centre_parts, integrate_frames
from michell_cad.parametrization.fold_barrier import (
    BarrierEnergy,
    remove_folds,
    require_injective,
    untangled_start,
)
from michell_cad.parametrization.phase import choose_phases, hug_faces
from michell_cad.parametrization.spacing_bounds import SpacingBounds, bound_spacing
from michell_cad.parametrization.stress_following import follow_stress, following_energy
from michell_cad.part_axes import part_axes
from michell_cad.tet_mesh import TetMesh

Layers = Literal["clear", "hug"]
"""Where the layers of cells lie: clear of the faces that they would graze, or just inside them, see `phase`."""


@dataclass(frozen=True)
class ParametrizationOptions:
    """Options of `parametrize`.

    Parameters
    ----------
    spacing_weight : the paper's beta: 0.1 follows the stress closely, 1 keeps the spacing even.
    follow_stress : whether to align the curves themselves after Eq. 11; False ends with Eq. 11 and its fold barrier.
    spacing_bounds : smallest and largest edge of a cell over the median edge, for example (0.5, 2). They are held in
        all of the part if that is possible without folds, and as nearly as possible if not; the report states the
        share of the volume left outside. None: no bounds.
    """

    spacing_weight: float = 0.1
    follow_stress: bool = True
    spacing_bounds: SpacingBounds | None = None

    def __post_init__(self) -> None:
        require(
            np.isfinite(self.spacing_weight) and 1e-3 <= self.spacing_weight <= 100,
            f"spacing_weight must lie between 0.001 and 100, found {self.spacing_weight}",
        )
        require(
            self.spacing_bounds is None or 0 < self.spacing_bounds[0] < 1 < self.spacing_bounds[1] < np.inf,
            f"spacing_bounds must be two numbers, one below 1 and one above it, found {self.spacing_bounds}",
        )


@dataclass(frozen=True, eq=False)
class Parametrization:
    """Three coordinates at the vertices, whose integer isocurves (after scaling) are the truss.

    Parameters
    ----------
    mesh : TetMesh
    phi : (n_v, 3) float, in units of length: the mean cell edge of the unscaled map is about one.
    """

    mesh: TetMesh
    phi: Float[np.ndarray, "n_v 3"]

    def __post_init__(self) -> None:
        freeze(self, phi=np.float64)
        require(np.isfinite(self.phi).all(), "the parametrization is not finite")

    @cached_property
    def jacobians(self) -> Float[np.ndarray, "n_t 3 3"]:
        """J = grad phi per tet; rows g_i."""
        return self.mesh.gradients(self.phi)

    @cached_property
    def _cells(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return measure_cells(self.jacobians)

    @property
    def determinants(self) -> Float[np.ndarray, " n_t"]:
        """det J per tet."""
        return self._cells[0]

    @property
    def cell_edges(self) -> Float[np.ndarray, "n_t 3"]:
        """Edges h_i = |b_i| of the cell of unit isovalues in each tet, b_i the columns of J^-1; inf where det J = 0."""
        return self._cells[1]

    @property
    def tangents(self) -> Float[np.ndarray, "n_t 3 3"]:
        """Directions of the curves: columns b_i of J^-1, normalised; column i runs along coordinate i."""
        return self._cells[2]

    def levels(
        self,
        resolution: float | None = None,
        spacing: float | None = None,
        layers: Layers = "clear",
    ) -> tuple[Float[np.ndarray, "n_v 3"], float]:
        """Scale and shift the coordinates into cells; returns them with the median edge of a cell, mm.

        One scale for all three coordinates. With `resolution` (the paper's rho) the coordinate with the longest range
        spans that many cells; with `spacing` (mm) the median cell edge is that long. With `layers` "clear" the shift of
        each coordinate is that of `choose_phases`; with "hug" it is shifted, and stretched by a few per cent, by
        `hug_faces`. On top comes the integer that makes its lowest value lie between 0 and 1.
        """
        low, high = self.phi.min(0), self.phi.max(0)
        unit_edge = float(np.median(self.cell_edges))
        if resolution is not None and spacing is None:
            scale = resolution / float((high - low).max())
        elif spacing is not None and resolution is None:
            scale = unit_edge / spacing
        else:
            raise InvalidInputError("give either a resolution or a spacing")
        levels, edge = (self.phi - low) * scale, unit_edge / scale
        if layers == "hug":
            stretch, shift = hug_faces(self.mesh, levels)
            levels = levels * stretch + shift
            edge = float(np.median(self.cell_edges / stretch)) / scale
        else:
            levels = levels + choose_phases(self.mesh, levels)
        return levels - np.floor(levels.min(0)), edge


def parametrize(
    mesh: TetMesh,
    stress_field: StressField,
    frame_field: FrameField,
    options: ParametrizationOptions | None = None,
    progress: Callable[[float], None] = lambda fraction: None,
) -> Parametrization:
    """Integrate the frames (Eq. 11), remove the folds, and let the curves follow the stress.

    The last step starts from three injective maps: the fold-free Eq. 11, and the straight grids along the best constant
    frame and along the part's axes; the lowest energy is kept.

    With `spacing_bounds` a last step, from the map so found and with the same energy, draws the cells within them.

    Raises
    ------
    ConvergenceError
        If no fold-free map was found.
    """
    options = options or ParametrizationOptions()
    linear = integrate_frames(mesh, frame_field.frames, options.spacing_weight)
    frames, beta = frame_field.frames, options.spacing_weight
    if options.follow_stress:
        metric, _ = matching_metric(stress_field.stress)
        grids = [mesh.vertices @ R for R in (*constant_frames(mesh, metric, 1), part_axes(mesh))]
        start = untangled_start(mesh, frames, beta, linear)
        starts = grids if start is None else [start, *grids]
        phi, _ = follow_stress(mesh, stress_field.stress, beta, starts, linear.factors[0].ordering, progress)
        require_injective(mesh, phi)
    else:
        phi = remove_folds(mesh, frames, beta, linear, progress)
    if options.spacing_bounds is not None:
        if options.follow_stress:
            energy, stiffness, weights = following_energy(mesh, stress_field.stress, beta)
            phi = phi / np.median(np.linalg.det(mesh.gradients(phi))) ** (1 / 3)
        else:
            energy, stiffness, weights = BarrierEnergy(mesh, frames, beta, linear), 2 * linear.weights, linear.weights
        phi = bound_spacing(mesh, phi, options.spacing_bounds, energy, stiffness, weights)
    return Parametrization(mesh, centre_parts(mesh, phi))
