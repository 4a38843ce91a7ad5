"""Members within the balls of their nodes, for radii that change from step to step, and derivatives by these radii.

How large the ball at a node is depends on the radii of the members there. Between fat balls a thin member is short and
bends sharply as they turn, which a model of centre lines does not see: radii that it thinks strong may be a third as
strong once built.

Where a ball ends on a member, at its rim, both have the same radius (nearly, if the member tapers). So moving the rim
changes no integral over the member to first order (Leibniz's rule), and derivatives are those at fixed places, though
the sections of the model move with the rims.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from michell_cad.problem import Material
from michell_cad.splines import MemberSplines, fit_splines
from michell_cad.strength.beam_model import BeamModel, build_beam_model
from michell_cad.truss import SizedTruss, Truss

Balls = Callable[[Float[np.ndarray, "n_m 2"]], tuple[Float[np.ndarray, " n_n"], Float[np.ndarray, "n_m 2"]]]
"""For the radii of all members at their two nodes, mm: the radius of the ball at each node, mm, and the derivative of
its logarithm by that of each radius, at the node where it is."""


@dataclass(frozen=True, eq=False)
class ThickNodes:
    """What makes a beam model of radii: one element for each member.

    Parameters
    ----------
    truss, material : Truss, Material
    straight : whether members are taken along their chords or along their curves.
    balls : None: none.
    """

    truss: Truss
    material: Material
    straight: bool
    balls: Balls | None = None

    @cached_property
    def splines(self) -> MemberSplines | None:
        """Centre lines of members along their curves."""
        return None if self.straight else fit_splines(self.truss)

    def members(self, radii: Float[np.ndarray, "n_m 3"]) -> BeamModel:
        """The members alone."""
        return self._model(radii, None)

    def with_balls(self, radii: Float[np.ndarray, "n_m 3"]) -> BeamModel:
        """The members, as thick as the balls within these."""
        return self._model(radii, None if self.balls is None else self.balls(radii[:, [0, 2]])[0])

    def gradient(
        self, model: BeamModel, radii: Float[np.ndarray, "n_m 3"], by_section: Float[np.ndarray, "n_m k"]
    ) -> Float[np.ndarray, "n_m 3"]:
        """Derivatives by the logarithms of the three areas of a member, from those by the areas of its sections.

        `model` is one of the two above, of these radii.
        """
        basis = section_basis(model.stations)
        own = np.einsum("mki,mi->mk", basis, radii)
        hidden = model.radii > own * (1 + 1e-9)
        by_area = np.where(hidden, 0, by_section) / own
        found = np.einsum("mk,mki->mi", by_area, basis) * radii
        if self.balls is None or not hidden.any():
            return found
        # Of a section in a ball, r^2 = R^2 - d^2: d log A = 2 (R / r)^2 d log R.
        R, slopes = self.balls(radii[:, [0, 2]])
        part = np.where(hidden, by_section / model.radii**2, 0)
        of_node = np.zeros(len(R))
        half = part.shape[1] // 2  # sections in balls come first and last, as many at either end
        for end, own_part in enumerate((part[:, :half], part[:, half:])):
            np.add.at(of_node, model.elements[:, end], own_part.sum(1))
        found[:, [0, 2]] += slopes * (R**2 * of_node)[model.elements]
        return found

    def _model(self, radii: np.ndarray, joints: np.ndarray | None) -> BeamModel:
        sized = SizedTruss(self.truss, radii)
        return build_beam_model(sized, self.material, self.straight, joints=joints, splines=self.splines)


def section_basis(s: Float[np.ndarray, "*n k"]) -> Float[np.ndarray, "*n k 3"]:
    """Radius of a section for a radius 1 at the first node, in the middle, and at the second node alone: what
    `member_radius` does is linear in the three."""
    smooth, bump = s**2 * (3 - 2 * s), 16 * (s * (1 - s)) ** 2
    return np.stack([1 - smooth - bump / 2, bump, smooth - bump / 2], axis=-1)
