"""The knobs as user parameters of the document.

Radius, entasis and the smallest radius drive the bodies at once; the others, and an entasis that was 0, take effect
with Edit Truss, which starts from the parameters. Knobs without a number (the families) stay in the truss's attributes.
"""

from typing import Any

import adsk.core
import adsk.fusion

from ..logic.knobs import Knob, Widget
from ..logic.layout import FAMILIES
from ..logic.plan import Section
from ..logic.selection import Chosen
from ..logic.units import from_host, host_unit, to_host

_SAME = 1e-9
"""Parameter values that differ by less, in internal units, are the same."""


def shown_numbers(knobs: tuple[Knob, ...], values: dict[str, Any], chosen: Chosen) -> dict[str, tuple[Knob, float]]:
    """The number of each user parameter, by its name without prefix; knobs that stand for nothing have none."""
    numbers: dict[str, tuple[Knob, float]] = {}
    for knob in knobs:
        value: Any = values.get(knob.name, knob.default)
        if knob.name == "radius" and value is None:
            value = chosen.radius
        if knob.widget is Widget.PER_FAMILY:
            each = value if isinstance(value, (list, tuple)) else [value] * len(FAMILIES)
            numbers |= {f"{knob.name}_{family}": (knob, one) for family, one in zip(FAMILIES, each, strict=True)}
        elif knob.widget in (Widget.NUMBER, Widget.OPTIONAL_NUMBER, Widget.WHOLE) and value is not None:
            numbers[knob.name] = (knob, value)
    return numbers


def write_parameters(design: adsk.fusion.Design, prefix: str, numbers: dict[str, tuple[Knob, float]]) -> None:
    """Make the user parameters of a truss, or set those that differ, so that expressions of the designer stay."""
    parameters = design.userParameters
    for name, (knob, number) in numbers.items():
        parameter, value = parameters.itemByName(prefix + name), to_host(number, knob.unit)
        if not parameter:
            given = adsk.core.ValueInput.createByReal(value)
            parameters.add(prefix + name, given, host_unit(knob.unit), knob.description)
        elif abs(parameter.value - value) > _SAME:
            parameter.value = value


def read_parameters(
    design: adsk.fusion.Design, prefix: str, numbers: dict[str, tuple[Knob, float]], values: dict[str, Any]
) -> dict[str, Any]:
    """The knobs with what was changed in the Parameters dialog since the truss was drawn with `numbers`."""
    values = dict(values)
    for name, (knob, number) in numbers.items():
        parameter = design.userParameters.itemByName(prefix + name)
        if not parameter or abs(parameter.value - to_host(number, knob.unit)) <= _SAME:
            continue
        found = from_host(parameter.value, knob.unit)
        if knob.widget is Widget.PER_FAMILY:
            now = values.get(knob.name, knob.default)
            each = list(now) if isinstance(now, (list, tuple)) else [now] * len(FAMILIES)
            each[FAMILIES.index(name.removeprefix(f"{knob.name}_"))] = round(found)
            values[knob.name] = each
        else:
            values[knob.name] = round(found) if knob.widget is Widget.WHOLE else found
    return values


def radius_expression(section: Section, prefix: str, numbers: dict[str, tuple[Knob, float]]) -> str:
    """The radius of a section in terms of the user parameters; a number where no knob gives it."""
    if section.weight is None or "radius" not in numbers:
        return f"{section.radius:.9g} cm"
    expression = f"{prefix}radius"
    if section.weight and "entasis" in numbers:
        expression += f" * (1 + {prefix}entasis * {section.weight:.9f})"
    return f"max({expression}; {prefix}smallest_radius)" if "smallest_radius" in numbers else expression
