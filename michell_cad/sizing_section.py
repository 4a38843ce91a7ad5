"""The `[sizing]` table of a job file."""

from typing import Annotated, Literal

from pydantic import BaseModel, Field, model_validator

from michell_cad.job_values import STRICT, Number, Positive, Switch
from michell_cad.strength.loads import OFF_AXIS_DEGREES
from michell_cad.strength.sizing_groups import SizedBy
from michell_cad.strength.strengthen_options import StrengthenOptions


class SizingSection(BaseModel):
    """What becomes of the radii that the knobs give: straight members, radii that suit the loads, braces."""

    model_config = STRICT
    straight: Switch = Field(default=False, description="Members run along the chords between their nodes.")
    by: SizedBy | None = Field(
        default=None,
        description="What gets radii of its own: member, curve (with a smooth change along it) or family; default: "
        "nothing, the knobs decide.",
    )
    criterion: Literal["stress", "compliance"] = Field(
        default="stress", description="stress: the highest load at first yield or buckling; compliance: the stiffest."
    )
    braces: Switch = Field(
        default=False, description="Diagonals in cells that shear, if the sized truss is better for them."
    )
    volume_fraction: Annotated[Number, Field(gt=0, lt=1)] | None = Field(
        default=None, description="Sum of the members' volumes over the part's; default: as the knobs make it."
    )
    off_axis: Annotated[Number, Field(ge=0, lt=90)] = Field(
        default=OFF_AXIS_DEGREES, description="Each load counts also tilted to four sides by this angle, degrees."
    )
    buckling: Switch = Field(default=True, description="Members must not buckle before they yield.")
    smallest_radius: Positive | None = Field(default=None, description="mm; default: a fifth of equal radii.")
    largest_radius: Positive | None = Field(default=None, description="mm; default: a quarter of the cell edge.")

    @property
    def options(self) -> StrengthenOptions:
        """The same as the options of `strengthen`."""
        return StrengthenOptions(
            straight=self.straight,
            size_by=self.by,
            criterion=self.criterion,
            braces=self.braces,
            volume_fraction=self.volume_fraction,
            off_axis_degrees=self.off_axis,
            buckling=self.buckling,
            smallest_radius=self.smallest_radius,
            largest_radius=self.largest_radius,
        )

    @model_validator(mode="after")
    def _braces_are_sized(self) -> "SizingSection":
        if self.braces and self.by is None:
            raise ValueError("braces cost at equal radii and pay only where radii are sized: give by as well")
        return self
