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

EVEN_SECTIONS = 51
"""Sections of a member, at equal distances. With 31 the highest stress at the rims of balls is missed by 6 % on the
cantilever, with 51 by 4 %."""

FIRST_POWER, SIZED_POWER, LAST_POWER = 6.0, 20.0, 40.0
"""Power of the norm in the first step, from equal members and from sized ones, and at last. A low one sees all members,
a high one only the worst; to begin with a high one ends in a poor optimum."""

RAMP, SHORT_RAMP = 40, 20
"""Steps over which the power rises, by the same factor each: from equal members, and from sized ones."""

LARGEST_STEP = 0.2
"""Largest change of the logarithm of an area in one step."""

PATIENCE = 10
"""Steps at the highest power without a better design after which it is enough."""

MOST_RAMPS = 2.0
"""So many times the ramp are enough, too: what more brings is lost when the truss is built."""


def strongest_radii(task: SizingTask) -> SizingRun:
    """Size for the highest load at which nothing fails."""
    nodes, groups, method = ThickNodes(task.model, task.node_ratios), task.groups, MovingAsymptotes(LARGEST_STEP)
    x = task.at_volume(np.clip(task.start, task.low, task.high))
    run = SizingRun(x)
    best, (ramp, power_0) = 0, (RAMP, FIRST_POWER) if task.from_equal else (SHORT_RAMP, SIZED_POWER)
    for step in range(task.steps):
        radii = groups.radii(x)
        system = factorise_beams(nodes.with_radii(radii), task.loading.held)
        solution = solve_system(system, task.loading)
        columns = nodes.members(radii)
        power = power_0 * (LAST_POWER / power_0) ** min(step / ramp, 1.0)
        norm = failure_norm(system, solution, power, critical_forces(columns) if task.buckling else None)
        run.compliances.append(float(task.loading.weights @ solution.compliances))
        run.factors.append(1 / norm.largest)
        if run.factors[-1] >= run.factors[best]:
            best, run.x = step, x
        if step - max(best, ramp) >= PATIENCE or step >= MOST_RAMPS * ramp:
            run.converged = True
            break
        by_area = nodes.gradient(radii, norm.by_section)
        if task.buckling:
            by_area += nodes.member_gradient(radii, norm.by_column[:, None] * critical_force_slopes(columns))
        gradient = groups.gradient(by_area)
        use = groups.middle.T @ task.volumes(x)
        new = task.at_volume(method.step(x, gradient, use, (task.low, task.high)))
        run.change = task.mean_change(x, new)
        x = new
    return run
