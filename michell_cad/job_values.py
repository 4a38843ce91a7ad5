"""What the values of a job file may be: strict numbers and switches, no unknown keys."""

from typing import Annotated

from pydantic import ConfigDict, Field

STRICT = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

Number = Annotated[float, Field(strict=True)]
Positive = Annotated[float, Field(strict=True, gt=0)]
Switch = Annotated[bool, Field(strict=True)]
