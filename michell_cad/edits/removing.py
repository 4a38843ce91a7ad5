"""Fewer curves: thinning a selection, removing one, and taking off open ends."""

from typing import Literal

import numpy as np
from pydantic import Field

from michell_cad.arrays import require
from michell_cad.edits.selections import Every
from michell_cad.edits.structure import SelectingEdit, Structure
from michell_cad.truss import Truss, keep_members, without_loose


class Thin(SelectingEdit):
    """Of the selected curves keep every n-th by its label; sharp edges and added curves stay."""

    do: Literal["thin"] = "thin"
    every: int = Field(ge=1, le=1000, description="Keep the curves whose isovalues plus offset are multiples of this.")
    offset: int = Field(default=0, ge=0, le=1000, description="Shift of the labels.")

    def apply(self, structure: Structure) -> Structure:
        truss = structure.truss
        numbered = np.array([curve.isovalues != (None, None, None) for curve in truss.curves], bool)
        mine = self.curves(truss) & numbered
        kept = mine & Every(self.every, self.offset).curves(truss)
        require(
            kept.any(),
            f"edit 'thin': every = {self.every} with offset = {self.offset} keeps none of the {mine.sum()} curves "
            f"of {self.where}; use a smaller stride",
        )
        return structure.with_truss(remove_curves(truss, mine & ~kept))


class Remove(SelectingEdit):
    """Remove the selected curves."""

    do: Literal["remove"] = "remove"
    prune: bool = Field(default=True, description="Whether what hangs loose without them goes as well.")

    def apply(self, structure: Structure) -> Structure:
        return structure.with_truss(remove_curves(structure.truss, self.curves(structure.truss), self.prune))


class RemoveOpenEnds(SelectingEdit):
    """Shorten the selected curves back to their first and last node with another member."""

    do: Literal["remove open ends"] = "remove open ends"

    def apply(self, structure: Structure) -> Structure:
        truss = structure.truss
        mine = self.members(truss)
        others = np.zeros(len(truss.nodes), bool)
        others[truss.members[~mine]] = True
        left = without_loose(truss, np.ones(len(truss.members), bool), stays=others)
        return structure.with_truss(keep_members(truss, left))


def remove_curves(truss: Truss, curves: np.ndarray, prune: bool = True) -> Truss:
    """The truss without the curves in a mask; with `prune` no node has a single member that had more before.

    Raises
    ------
    InvalidInputError
        If nothing would be left.
    """
    covered = np.zeros(len(truss.members), bool)
    for curve, gone in zip(truss.curves, curves, strict=True):
        if not gone:
            covered[curve.members] = True
    left = without_loose(truss, covered, stays=truss.degrees <= 1) if prune else covered
    require(
        left.any(),
        f"removing {int(curves.sum())} of {len(curves)} curves leaves nothing"
        + (", since the rest would hang loose" if covered.any() else "")
        + "; select fewer",
    )
    return keep_members(truss, left, ~curves)
