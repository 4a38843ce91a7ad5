"""The method of moving asymptotes with one constraint: Svanberg 1987, doi:10.1002/nme.1620240207.

A function of x is replaced by sum p / (U - x) + q / (x - L), which has its value and derivatives at the present point;
p goes with what makes it rise, q with what makes it fall. The sum is separable and convex, so that the least value
under one such constraint is a search for one multiplier. The asymptotes L and U move away where x goes on in one
direction and close in where it swings. Departures: the constraint is an equality that the caller restores, and steps
are bounded.
"""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

FIRST_SPAN = 0.5
"""Distance of the asymptotes in the first two steps, in units of x (here: logarithms of areas)."""

APART, TOGETHER = 1.2, 0.7
"""Svanberg's factors of that distance where x goes on, and where it swings."""

NEAREST, FARTHEST = 0.01, 10.0
"""Bounds of that distance."""

LARGEST_SHARE = 0.9
"""x goes at most this share of the way to an asymptote."""

CURVATURE = 1e-3
"""Share of each derivative that p and q both get: it keeps the sum strictly convex."""

BISECTIONS = 60
"""Halvings of the interval of the multiplier's logarithm, from -30 to 30 about the balance of the gradients."""


@dataclass(eq=False)
class MovingAsymptotes:
    """What the method remembers from step to step."""

    largest_step: float
    _points: list[np.ndarray] = field(default_factory=list)
    _span: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def step(
        self,
        x: Float[np.ndarray, " n"],
        gradient: Float[np.ndarray, " n"],
        use: Float[np.ndarray, " n"],
        bounds: tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]],
    ) -> Float[np.ndarray, " n"]:
        """The next point: it lowers a function with this gradient, and keeps what `use` is the gradient of."""
        self._move(x)
        low, high = x - self._span, x + self._span
        reach = np.minimum(LARGEST_SHARE * self._span, self.largest_step)
        least, most = np.maximum(bounds[0], x - reach), np.minimum(bounds[1], x + reach)
        (p, q), (a, b) = (self._coefficients(d) for d in (gradient, use * np.abs(gradient).sum() / np.abs(use).sum()))

        def at(multiplier: float) -> np.ndarray:
            # p / (U - x)^2 = q / (x - L)^2.
            rise, fall = np.sqrt(p + multiplier * a), np.sqrt(q + multiplier * b)
            return np.clip((rise * low + fall * high) / (rise + fall), least, most)

        now = (a / (high - x) + b / (x - low)).sum()
        lower, upper = -30.0, 30.0
        for _ in range(BISECTIONS):
            middle = (lower + upper) / 2
            y = at(np.exp(middle))
            if (a / (high - y) + b / (y - low)).sum() > now:
                lower = middle
            else:
                upper = middle
        return at(np.exp((lower + upper) / 2))

    def _move(self, x: np.ndarray) -> None:
        self._points = [*self._points[-2:], x]
        if len(self._points) < 3:
            self._span = np.full(len(x), FIRST_SPAN)
            return
        before, last, now = self._points
        turn = (now - last) * (last - before)
        factor = np.where(turn > 0, APART, np.where(turn < 0, TOGETHER, 1.0))
        self._span = np.clip(factor * self._span, NEAREST, FARTHEST)

    def _coefficients(self, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """p and q of a gradient, both positive."""
        rise, fall = np.maximum(d, 0), np.maximum(-d, 0)
        least = 1e-5 * np.abs(d).mean()
        square = self._span**2
        return square * ((1 + CURVATURE) * rise + CURVATURE * fall + least), square * (
            CURVATURE * rise + (1 + CURVATURE) * fall + least
        )
