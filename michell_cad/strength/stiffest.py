"""The stiffest radii: least compliance sum_c w_c f_c . u_c at a given volume.

Its derivative by log A of a member is -(e2 + 2 e4) with the member's energies e2 (axial and shear, which go with 1 / A)
and e4 (bending and torsion, with 1 / A^2), so at the optimum d = sum (e2 + 2 e4) / sum A L is the same for all groups
within their bounds (Prager's criterion; Rozvany, Structural Design via Optimality Criteria, 1989). It is met by
x_g <- x_g + eta_g log(d_g / lambda) within the bounds, lambda such that the volume is kept. The exponent eta that is
exact where the forces do not change is one over the power of A with which d falls. With `buckling` no area falls below
that at which its member buckles by itself (guided ends) at the given loads.
"""

from dataclasses import replace

import numpy as np

from michell_cad.arrays import require
from michell_cad.strength.beam_solution import BeamSolution
from michell_cad.strength.beam_solver import factorise_beams, solve_system
from michell_cad.strength.member_buckling import member_buckling_factors
from michell_cad.strength.sizing_task import SizingRun, SizingTask, failure_index
from michell_cad.truss import member_radius

RELAXATION = 1.6
"""Factor of the exponents that are exact at fixed forces. Stiffer members draw force, so the compliance falls twice as
fast with a factor between 1.4 and 1.7; with 1.9 it oscillates."""

LARGEST_STEP = 4.0
"""An area changes by this factor at most in one step."""

BISECTIONS = 100
"""Halvings of the interval of log lambda: to the last digit."""

BUCKLING_MARGIN = 1.05
"""Areas above those at which members buckle: the forces still change a little when the radii have settled."""


def stiffest_radii(task: SizingTask) -> SizingRun:
    """Size by the optimality criterion until the areas have settled.

    Raises
    ------
    InvalidInputError
        If members that do not buckle take more than the volume.
    """
    model, groups, x = task.model, task.groups, task.start
    run = SizingRun(x)
    for _ in range(task.steps):
        radii = groups.radii(x)
        here = replace(model, radii=member_radius(radii[model.member_of_element, None], model.stations))
        solution = solve_system(factorise_beams(here, task.loading.held), task.loading)
        run.x = x
        run.compliances.append(float(task.loading.weights @ solution.compliances))
        run.factors.append(float(1 / failure_index(solution, task.buckling).max()))
        if run.change <= task.tolerance:
            run.converged = True
            break
        demand, exponent = _demand(solution, task, x)
        low = task.low
        if task.buckling:
            low = _buckling_floor(solution, task, x)
            _require_volume(task, low)
        step = np.log(LARGEST_STEP)
        bounds = np.maximum(low, x - step), np.maximum(low, np.minimum(task.high, x + step))
        new = _resize(x, demand, exponent, bounds, task)
        run.change = task.mean_change(x, new)
        x = new
    return run


def _demand(solution: BeamSolution, task: SizingTask, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """d of every group, in units of its mean, and eta."""
    stretching, bending = np.einsum("c,cmj->jm", task.loading.weights, solution.energies)
    bent = bending / np.maximum(stretching + bending, np.finfo(float).tiny)
    share, volumes = task.groups.shares.T, task.volumes(x)
    demand = (share @ (stretching + 2 * bending)) / (share @ volumes)
    exponent = RELAXATION / ((share @ (volumes * (2 + bent))) / (share @ volumes))
    return np.maximum(demand / demand.mean(), np.finfo(float).tiny), exponent


def _buckling_floor(solution: BeamSolution, task: SizingTask, x: np.ndarray) -> np.ndarray:
    """Least x with which no member buckles at its force, which goes with A^2; every variable suits all it has a share
    in, so that what lies between two of them is safe."""
    areas = task.volumes(x) / task.lengths
    floor = BUCKLING_MARGIN * areas / np.sqrt(member_buckling_factors(solution).min(0))
    shares = task.groups.shares.tocoo()
    low = task.low.copy()
    np.maximum.at(low, shares.col, np.log(np.maximum(floor, np.finfo(float).tiny))[shares.row])
    return low


def _require_volume(task: SizingTask, low: np.ndarray) -> None:
    least = float(task.volumes(low).sum())
    require(
        least <= task.volume,
        f"members that do not buckle at these loads take {least:.4g} mm^3, more than the volume of {task.volume:.4g} "
        "mm^3: give more volume, size by stress, or leave buckling out",
    )


def _resize(
    x: np.ndarray, demand: np.ndarray, exponent: np.ndarray, bounds: tuple[np.ndarray, np.ndarray], task: SizingTask
) -> np.ndarray:
    """clip(x + eta log(d / lambda), low, high) with the lambda at which these areas have the volume.

    Between the values of lambda at which all are at their upper and all at their lower bound, the volume never rises.
    """
    low, high = bounds

    def at(log_multiplier: float) -> np.ndarray:
        return np.clip(x + exponent * (np.log(demand) - log_multiplier), low, high)

    a = (np.log(demand) - (high - x) / exponent).min()
    b = (np.log(demand) - (low - x) / exponent).max()
    for _ in range(BISECTIONS):
        middle = (a + b) / 2
        if task.volumes(at(middle)).sum() > task.volume:
            a = middle
        else:
            b = middle
    return at((a + b) / 2)
