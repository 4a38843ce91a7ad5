"""The knobs of a finished structure: the one schema of what a designer may turn, shown alike by every host.

Applying knobs never touches what lies upstream (stress, parametrization, isocurves): `apply_knobs` takes the whole
truss and returns the chosen part of it with a radius for every member.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
from jaxtyping import Float
from pydantic import BaseModel, ConfigDict, Field, PositiveInt, field_validator

from michell_cad.arrays import freeze, require
from michell_cad.errors import InvalidInputError
from michell_cad.truss import Truss
