"""Limited-memory BFGS with a preconditioner, for energies that may be infinite outside their feasible region.

Nocedal and Wright, Numerical Optimization (2006), Algorithms 7.4 and 7.5. SciPy's L-BFGS-B knows neither
preconditioners nor infinite values, and the frame field and the parametrization need the first and the second.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

SUFFICIENT_DECREASE = 1e-4
"""Armijo's constant (Nocedal and Wright, Eq. 3.4)."""
ROUNDING = 1e-13
"""A direction that promises less (relative to the value) than rounding makes is none."""
WIDEN = 4.0
"""A search begins at most this many times as far as the last one ended: where the feasible region is narrow, whole
steps would be halved ten times over, again and again."""
SMALLEST_STEP = 1e-12
"""A line search that has shrunk its step to this gives up (relative to the step of the quasi-Newton model)."""

SCALED_ITERATIONS = 5
"""The first iterations find the scale of the preconditioner (Nocedal and Wright, Eq. 7.20); going on would cost one
more application of it, often the dearest part, in every iteration."""
PATIENCE = 3
"""Iterations without decrease after which a minimisation has converged."""


@dataclass(frozen=True)
class MinimizeReport:
    """How a minimisation ended."""

    value: float
    iterations: int
    evaluations: int
    converged: bool
    reason: str


def minimize(
    function: Callable[[np.ndarray], tuple[float, np.ndarray]],
    x: np.ndarray,
    precondition: Callable[[np.ndarray], np.ndarray],
    memory: int = 8,
    iterations: int = 100,
    tolerance: float = 1e-6,
    stop: Callable[[float], bool] = lambda value: False,
    patience: int = PATIENCE,
) -> tuple[np.ndarray, MinimizeReport]:
    """Minimise `function` from the feasible point `x` by preconditioned L-BFGS with backtracking.

    Parameters
    ----------
    function : returns value and gradient (same shape as x); the value may be inf, the gradient is then not used.
    x : any shape.
    precondition : maps a gradient to a step; an approximation of the inverse Hessian, symmetric positive definite.
    memory : number of correction pairs.
    iterations : largest number.
    tolerance : relative decrease of the value in one full step that counts as none; `patience` such steps, with none in
        between that decreased it by more, end the minimisation. (A step cut short by the edge of the feasible region
        says nothing; if it counted, it would be luck where a minimisation among many such edges ends.)
    stop : called with each accepted value; ends the minimisation when true.
    """
    value, gradient = function(x)
    evaluations = 1
    pairs: deque[tuple[np.ndarray, np.ndarray, float]] = deque(maxlen=memory)
    scale, idle, step = 1.0, 0, 1.0
    for iteration in range(iterations):
        direction = _two_loop(gradient, pairs, scale, precondition)
        slope = float(np.vdot(direction, gradient))
        if not slope < -ROUNDING * abs(value):
            if not pairs:
                return x, MinimizeReport(value, iteration, evaluations, True, "the gradient vanishes")
            pairs.clear()
            continue
        step = min(1.0, WIDEN * step)
        while True:
            x_new = x + step * direction
            value_new, gradient_new = function(x_new)
            evaluations += 1
            if value_new <= value + SUFFICIENT_DECREASE * step * slope:
                break
            if np.isfinite(value_new):  # minimum of the parabola through both values and the slope, kept in bounds
                parabola = -slope * step / (2 * (value_new - value - slope * step)) * step
                step = float(np.clip(parabola, 0.1 * step, 0.5 * step))
            else:
                step *= 0.5
            if step < SMALLEST_STEP:
                return x, MinimizeReport(value, iteration, evaluations, False, "no step decreases the energy")
        s, y = x_new - x, gradient_new - gradient
        curvature = float(np.vdot(s, y))
        if curvature > np.finfo(float).eps * float(np.linalg.norm(s) * np.linalg.norm(y)):
            pairs.append((s, y, 1 / curvature))
            if iteration < SCALED_ITERATIONS:
                scale = curvature / float(np.vdot(y, precondition(y)))
        if value - value_new > tolerance * max(abs(value), np.finfo(float).tiny):
            idle = 0
        elif step == 1.0:
            idle += 1
        x, value, gradient = x_new, value_new, gradient_new
        if stop(value):
            return x, MinimizeReport(value, iteration + 1, evaluations, True, "the caller's condition is met")
        if idle >= patience:
            return x, MinimizeReport(value, iteration + 1, evaluations, True, "the energy no longer decreases")
    return x, MinimizeReport(value, iterations, evaluations, False, "all iterations used")


def _two_loop(gradient: np.ndarray, pairs: deque, scale: float, precondition: Callable) -> np.ndarray:
    q = gradient.copy()
    coefficients = []
    for s, y, rho in reversed(pairs):
        a = rho * float(np.vdot(s, q))
        q -= a * y
        coefficients.append(a)
    q = scale * precondition(q)
    for (s, y, rho), a in zip(pairs, reversed(coefficients), strict=True):
        q += s * (a - rho * float(np.vdot(y, q)))
    return -q
