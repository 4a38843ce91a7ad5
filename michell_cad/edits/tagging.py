"""Tags: a name, such as a material, on some of the members, for whoever makes them."""

from typing import Literal

import numpy as np
from jaxtyping import Bool
from pydantic import Field

from michell_cad.edits.structure import SelectingEdit, Structure
from michell_cad.truss import Truss


class Tag(SelectingEdit):
    """A name on the selected members. ``{ label = [3, 3], coordinate = 0 }`` selects those along one isosurface."""

    do: Literal["tag"] = "tag"
    name: str = Field(min_length=1, description="Such as a material.")

    def apply(self, structure: Structure) -> Structure:
        self.members(structure.truss)
        return structure.with_note(self)


def tagged_members(structure: Structure, truss: Truss | None = None) -> dict[str, Bool[np.ndarray, " n_m"]]:
    """The members of each tag. A member has one tag, the last that was given to it.

    Parameters
    ----------
    structure : Structure
    truss : what to look at instead of the structure's own truss, for example the truss as it was built.
    """
    truss = structure.truss if truss is None else truss
    tags: dict[str, np.ndarray] = {}
    for edit in structure.of_kind(Tag):
        mine = edit.where.members(truss)
        tags = {name: members & ~mine for name, members in tags.items()}
        tags[edit.name] = mine | tags.get(edit.name, False)
    return tags
