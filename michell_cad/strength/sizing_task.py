"""What a sizing starts from, and what it found: shared by its two criteria."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from michell_cad.strength.beam_model import BeamModel
from michell_cad.strength.beam_solution import BeamSolution
from michell_cad.strength.loads import TrussLoading
from michell_cad.strength.member_buckling import member_buckling_factors
from michell_cad.strength.sizing_groups import SizingGroups
from michell_cad.strength.thick_nodes import ThickNodes

BISECTIONS = 100
"""Halvings of the interval of the shift that restores the volume: to the last digit."""


@dataclass(frozen=True, eq=False)
class SizingTask:
    """Members to be sized.

    Parameters
    ----------
    model : of the truss, with any radii.
    loading : TrussLoading
    groups : what is sized together: log A = W x.
    lengths : (n_m,) of the members, mm.
    volume : mm^3.
    low, high : (n_x,) bounds of x.
    start : (n_x,), any volume.
    nodes : makes models with the balls of the nodes.
    buckling : whether members must not buckle.
    tolerance, steps : see `SizingOptions`.
    """

    model: BeamModel
    loading: TrussLoading
    groups: SizingGroups
    lengths: Float[np.ndarray, " n_m"]
    volume: float
    low: Float[np.ndarray, " n_x"]
    high: Float[np.ndarray, " n_x"]
    start: Float[np.ndarray, " n_x"]
    nodes: ThickNodes
    buckling: bool
    tolerance: float
    steps: int

    def volumes(self, x: Float[np.ndarray, " n_x"]) -> Float[np.ndarray, " n_m"]:
        """Volume of each member by the area of its middle, mm^3."""
        return np.exp(self.groups.middle @ x) * self.lengths

    def mean_change(self, x: Float[np.ndarray, " n_x"], new: Float[np.ndarray, " n_x"]) -> float:
        """Mean relative change of the areas, weighted by volume."""
        return float(np.abs(self.groups.middle @ (new - x)) @ self.volumes(x) / self.volume)

    def at_volume(self, x: Float[np.ndarray, " n_x"]) -> Float[np.ndarray, " n_x"]:
        """x shifted, within its bounds, to the volume."""
        a, b = (self.low - x).min(), (self.high - x).max()
        for _ in range(BISECTIONS):
            middle = (a + b) / 2
            if self.volumes(np.clip(x + middle, self.low, self.high)).sum() > self.volume:
                b = middle
            else:
                a = middle
        return np.clip(x + (a + b) / 2, self.low, self.high)


@dataclass(eq=False)
class SizingRun:
    """How a sizing goes: the chosen x, and the figures of all steps."""

    x: Float[np.ndarray, " n_x"]
    compliances: list[float] = field(default_factory=list)
    factors: list[float] = field(default_factory=list)
    change: float = np.inf
    converged: bool = False


def failure_index(
    solution: BeamSolution, buckling: bool, columns: BeamModel | None = None
) -> Float[np.ndarray, " n_m"]:
    """Largest over the load cases of one over the factor at which each member yields (or buckles, as in `columns`)."""
    index = solution.peak_stress.max(0) / solution.model.material.yield_strength
    if buckling:
        index = np.maximum(index, (1 / member_buckling_factors(solution, columns)).max(0))
    return index
