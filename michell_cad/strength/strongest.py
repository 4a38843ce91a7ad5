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
from michell_cad.strength.thick_nodes import ThickNodes

EVEN_SECTIONS = 31
"""Sections of a member, at equal distances. The highest stress at the rim of a ball is missed by 2 % at most."""

FIRST_POWER, LAST_POWER = 6.0, 40.0
"""Power of the norm in the first step and from step `RAMP` on (half as many, if the start is a sized truss). A low one sees all members, a high one only the worst;
to begin with a high one ends in a poor optimum."""

RAMP = 45
"""Steps over which the power rises, by the same factor each."""

LARGEST_STEP = 0.2
"""Largest change of the logarithm of an area in one step."""

PATIENCE = 20
"""Steps at the highest power without a better design after which it is enough."""


def strongest_radii(task: SizingTask) -> SizingRun:
    """Size for the highest load at which nothing fails."""
    nodes, groups, method = ThickNodes(task.model, task.node_ratios), task.groups, MovingAsymptotes(LARGEST_STEP)
    x = task.at_volume(np.clip(task.start, task.low, task.high))
    run = SizingRun(x)
    best, ramp = 0, RAMP if task.from_equal else 30
    for step in range(task.steps):
        radii = groups.radii(x)
        system = factorise_beams(nodes.with_radii(radii), task.loading.held)
        solution = solve_system(system, task.loading)
        columns = nodes.members(radii)
        power = FIRST_POWER * (LAST_POWER / FIRST_POWER) ** min(step / ramp, 1.0)
        norm = failure_norm(system, solution, power, critical_forces(columns) if task.buckling else None)
        run.compliances.append(float(task.loading.weights @ solution.compliances))
        run.factors.append(1 / norm.largest)
        if run.factors[-1] >= run.factors[best]:
            best, run.x = step, x
        if step - max(best, ramp) >= PATIENCE:
            run.converged = True
            break
        by_area = nodes.gradient(radii, norm.by_section)
        if task.buckling:
            by_area += nodes.member_gradient(radii, norm.by_column[:, None] * critical_force_slopes(columns))
        gradient = sum(W.T @ column for W, column in zip(groups.by_place, by_area.T, strict=True))
        use = groups.middle.T @ task.volumes(x)
        new = task.at_volume(method.step(x, gradient, use, (task.low, task.high)))
        run.change = task.mean_change(x, new)
        x = new
    return run
