"""Members within the balls of their nodes, at sections whose places stay: for radii that change from step to step.

The ball at a node has a fixed ratio to the largest radius of the members there. Between fat balls a thin member is
short and bends sharply as they turn, which a model of centre lines does not see: radii that it thinks strong may be a
third as strong once built. The sections of the outer halves of a member are as thick as the ball that they lie in,
(R^2 - d^2)^(1/2) at the distance d from its centre; the one in the middle always has the member's own radius, so that a
member hidden in two balls still has to carry what passes through it.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from michell_cad.arrays import require
from michell_cad.strength.beam_model import BeamModel


@dataclass(frozen=True, eq=False)
class ThickNodes:
    """A beam model of one element for each member, with the balls of its nodes.

    Parameters
    ----------
    model : with an odd number of sections, the same stations for all members; its radii are any.
    ratios : (n_n,), radius of the ball at each node over the largest radius there; 0: no ball.
    """

    model: BeamModel
    ratios: Float[np.ndarray, " n_n"]

    def __post_init__(self) -> None:
        require(self.model.radii.shape[1] % 2 == 1, "the middle of a member needs a section of its own")

    @cached_property
    def basis(self) -> Float[np.ndarray, "k 3"]:
        """Radius of every section for a radius 1 at the first node, in the middle, and at the second node alone: what
        `member_radius` does is linear in the three."""
        s = self.model.stations[0]
        smooth, bump = s**2 * (3 - 2 * s), 16 * (s * (1 - s)) ** 2
        return np.stack([1 - smooth - bump / 2, bump, smooth - bump / 2], axis=1)

    @cached_property
    def near_end(self) -> Int[np.ndarray, " k"]:
        """Which end (0, 1) each section is nearer to; -1 for the middle."""
        return np.array([0 if s < 0.5 - 1e-9 else 1 if s > 0.5 + 1e-9 else -1 for s in self.model.stations[0]])

    @cached_property
    def distance(self) -> Float[np.ndarray, "n_m k"]:
        """From the node at the nearer end, mm."""
        nodes = self.model.nodes[self.model.elements[:, self.near_end]]
        return np.linalg.norm(self.model.points - nodes, axis=2)

    def widest(self, radii: Float[np.ndarray, "n_m 3"]) -> Float[np.ndarray, " n_n"]:
        """Largest radius at every node, mm."""
        found = np.zeros(len(self.model.nodes))
        np.maximum.at(found, self.model.elements, radii[:, [0, 2]])
        return found

    def members(self, radii: Float[np.ndarray, "n_m 3"]) -> BeamModel:
        """The members alone."""
        return replace(self.model, radii=radii @ self.basis.T)

    def with_radii(self, radii: Float[np.ndarray, "n_m 3"]) -> BeamModel:
        """Members with these radii, and the balls that belong to them."""
        own = radii @ self.basis.T
        return replace(self.model, radii=np.maximum(own, self._ball(radii)))

    def gradient(
        self, radii: Float[np.ndarray, "n_m 3"], by_section: Float[np.ndarray, "n_m k"]
    ) -> Float[np.ndarray, "n_m 3"]:
        """Derivatives by the logarithms of the three areas of a member, from those by the areas of its sections.

        A ball goes with the largest radius at its node; of several equal ones each has a part in it.
        """
        own, ball = radii @ self.basis.T, self._ball(radii)
        hidden = ball > own
        found = self.member_gradient(radii, np.where(hidden, 0, by_section))
        # Of a section in a ball: d log A = (R / r)^2 d log of the ball's own largest area.
        widest = self.widest(radii)
        R = (self.ratios * widest)[self.model.elements]
        of_node = np.zeros(len(widest))
        for end in (0, 1):
            mine = hidden & (self.near_end == end)
            part = np.where(mine, by_section / np.where(mine, ball, 1) ** 2, 0).sum(1) * R[:, end] ** 2
            np.add.at(of_node, self.model.elements[:, end], part)
        leads = radii[:, [0, 2]] >= widest[self.model.elements] * (1 - 1e-9)
        count = np.bincount(self.model.elements[leads], minlength=len(widest))
        found[:, [0, 2]] += np.where(leads, (of_node / np.maximum(count, 1))[self.model.elements], 0)
        return found

    def member_gradient(
        self, radii: Float[np.ndarray, "n_m 3"], by_section: Float[np.ndarray, "n_m k"]
    ) -> Float[np.ndarray, "n_m 3"]:
        """The same for members without balls."""
        return (by_section / (radii @ self.basis.T)) @ self.basis * radii

    def _ball(self, radii: np.ndarray) -> np.ndarray:
        """Radius of the ball's section at each section, 0 outside of it."""
        R = (self.ratios * self.widest(radii))[self.model.elements]
        square = R[:, self.near_end] ** 2 - self.distance**2
        square[:, self.near_end < 0] = 0
        return np.sqrt(np.maximum(square, 0))
