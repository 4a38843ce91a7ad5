"""The strongest radii: the highest factor of the loads at which a first member yields or buckles, at a given volume.

The largest failure index is replaced by its norm (see `stress_norm`), whose power rises from step to step, and every
step goes by the method of moving asymptotes. The radii with the highest factor of all steps are returned.
"""

import numpy as np

from michell_cad.strength.asymptotes import MovingAsymptotes
from michell_cad.strength.beam_solver import factorise_beams, solve_system
from michell_cad.strength.member_buckling import critical_force_slopes, critical_forces
from michell_cad.strength.sizing_task import SizingRun, SizingTask
from michell_cad.strength.stress_norm import failure_norm

FIRST_POWER, LAST_POWER = 6.0, 40.0
"""Power of the norm in the first step and at last. A low one sees all members, a high one only the worst; to begin with
a high one, even from sized members, ends in an optimum half as good."""

RAMP = 40
"""Steps over which the power rises, by the same factor each."""

LARGEST_STEP = 0.2
"""Largest change of the logarithm of an area in one step."""

PATIENCE = 10
"""Steps at the highest power without a better design after which it is enough."""

MOST_RAMPS = 2.0
"""So many times the ramp are enough, too: what more brings is lost when the truss is built."""


def strongest_radii(task: SizingTask) -> SizingRun:
    """Size for the highest load at which nothing fails."""
    nodes, groups, method = task.nodes, task.groups, MovingAsymptotes(LARGEST_STEP)
    x = task.at_volume(np.clip(task.start, task.low, task.high))
    run = SizingRun(x)
    best = 0
    for step in range(task.steps):
        radii = groups.radii(x)
        model = nodes.with_balls(radii)
        system = factorise_beams(model, task.loading.held)
        solution = solve_system(system, task.loading)
        columns = nodes.members(radii)
        power = FIRST_POWER * (LAST_POWER / FIRST_POWER) ** min(step / RAMP, 1.0)
        norm = failure_norm(system, solution, power, critical_forces(columns) if task.buckling else None)
        run.compliances.append(float(task.loading.weights @ solution.compliances))
        run.factors.append(1 / norm.largest)
        if run.factors[-1] >= run.factors[best]:
            best, run.x = step, x
        if step - max(best, RAMP) >= PATIENCE or step >= MOST_RAMPS * RAMP:
            run.converged = True
            break
        by_area = nodes.gradient(model, radii, norm.by_section)
        if task.buckling:
            by_area += nodes.gradient(columns, radii, norm.by_column[:, None] * critical_force_slopes(columns))
        gradient = groups.gradient(by_area)
        use = groups.middle.T @ task.volumes(x)
        new = task.at_volume(method.step(x, gradient, use, (task.low, task.high)))
        run.change = task.mean_change(x, new)
        x = new
    return run
