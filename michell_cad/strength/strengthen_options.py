"""What `strengthen` is asked for."""

from dataclasses import dataclass
from typing import Literal

from michell_cad.arrays import require
from michell_cad.strength.braces import SHEAR_LIMIT
from michell_cad.strength.loads import OFF_AXIS_DEGREES
from michell_cad.strength.sizing_groups import SizedBy


@dataclass(frozen=True)
class StrengthenOptions:
    """Options of `strengthen`.

    Parameters
    ----------
    straight : whether members run along the chords between their nodes.
    size_by : what gets a radius of its own: "member", "curve" or "family"; None leaves the radii.
    criterion : "stress": the highest load at first yield or buckling; "compliance": the stiffest.
    braces : whether cell faces that shear may get a diagonal; they are kept only if the sized truss is better for it.
    shear_limit : see `choose_braces`.
    volume_fraction : sum of the members' volumes over that of the part; default: as the knobs made it.
    off_axis_degrees : every load case counts also tilted to four sides by this angle; 0: only as it is.
    buckling : whether members must not buckle before they yield ("stress") or at the loads ("compliance").
    smallest_radius, largest_radius : mm; defaults as in `SizingOptions`.
    """

    straight: bool = False
    size_by: SizedBy | None = None
    criterion: Literal["compliance", "stress"] = "stress"
    braces: bool = False
    shear_limit: float = SHEAR_LIMIT
    volume_fraction: float | None = None
    off_axis_degrees: float = OFF_AXIS_DEGREES
    buckling: bool = True
    smallest_radius: float | None = None
    largest_radius: float | None = None

    def __post_init__(self) -> None:
        require(
            not self.braces or self.size_by is not None,
            "braces cost at equal radii and pay only where radii are sized: give size_by as well",
        )
        require(
            self.volume_fraction is None or 0 < self.volume_fraction < 1,
            f"volume_fraction must lie between 0 and 1, found {self.volume_fraction}",
        )
