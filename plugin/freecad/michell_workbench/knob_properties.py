"""The knobs as FreeCAD properties, made from the schema that the worker tells; nothing here names a knob.

========================================  ==============================================================================
in the schema                             in FreeCAD
========================================  ==============================================================================
a choice, perhaps of several              Enumeration of all combinations
a length (unit mm)                        Length, which is never negative
a number                                  FloatConstraint with the bounds
a whole number                            IntegerConstraint with the bounds
... that may be none                      the value 0 says so
... that may be one per family            three more IntegerConstraints: smallest value less one says "as above"
a choice, or a table of one's own         Enumeration of the choices, and "as designed", which leaves it as it is
========================================  ==============================================================================
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any

GROUP = "Knobs"
FAMILIES = ("Tension", "Compression", "Third")
"""Endings of the properties of a knob that has one value per family, in the schema's order."""

SEPARATOR = ", "
AS_DESIGNED = "as designed"
"""Stands for a value that a form has no place for, such as an outline of one's own: the design keeps it."""

UNBOUNDED = 1e9
"""Bound of a number without one: a constraint needs both."""

STEPS = 40
"""Clicks of the arrows from the lower to the upper bound of a number, about."""


@dataclass(frozen=True)
class KnobProperty:
    """One property.

    Parameters
    ----------
    name : of the property.
    knob : name in the schema.
    kind : FreeCAD's type.
    default : value that stands for the knob's default.
    bounds : smallest, largest, step of constraints; else None.
    choices : of enumerations.
    unset : the value that says "none" or "as the knob for all"; None if there is no such value.
    family : which entry of a knob with one value per family, else None.
    help : tooltip, with the unit.
    """

    name: str
    knob: str
    kind: str
    default: Any
    bounds: tuple[float, float, float] | None = None
    choices: tuple[str, ...] = ()
    unset: Any = None
    family: int | None = None
    help: str = ""


def properties_of(schema: Mapping[str, Any]) -> list[KnobProperty]:
    """Properties for the knobs of a JSON schema, in its order."""
    found = []
    for knob, field in schema.items():
        forms = [field, *field.get("anyOf", [])]
        unit = field.get("unit", "1")
        note = field.get("description", "") + ("" if unit == "1" else f" [{unit}]")
        kinds = {form.get("type") for form in forms}
        name = "".join(word.capitalize() for word in knob.split("_"))
        if "string" in kinds:
            found.append(_choice(name, knob, forms, field.get("default"), note))
        elif "integer" in kinds:
            found += _whole(name, knob, forms, field.get("default"), note, several="array" in kinds)
        else:
            found.append(_number(name, knob, forms, field.get("default"), note, unit, optional="null" in kinds))
    return found


def knobs_of(properties: list[KnobProperty], read: Callable[[str], Any]) -> dict[str, Any]:
    """The knobs from values of the properties.

    Parameters
    ----------
    properties : PropertySpec of all knobs.
    read : value of the property of a name.
    """
    knobs: dict[str, Any] = {}
    each: dict[str, list[Any]] = {}
    for p in properties:
        value = read(p.name)
        if p.family is not None:
            each.setdefault(p.knob, []).append(knobs[p.knob] if value == p.unset else value)
        elif p.choices:
            names = value.split(SEPARATOR)
            if value != AS_DESIGNED:
                knobs[p.knob] = names[0] if len(names) == 1 else names
        else:
            knobs[p.knob] = None if p.unset is not None and value == p.unset else value
    for knob, values in each.items():
        if any(value != knobs[knob] for value in values):
            knobs[knob] = values
    return knobs


def values_of(properties: list[KnobProperty], knobs: Mapping[str, Any]) -> dict[str, Any]:
    """Values of the properties for knobs; the other way round."""
    values = {}
    for p in properties:
        value = knobs.get(p.knob)
        several = isinstance(value, list | tuple)
        if p.choices:
            own = several and not all(isinstance(item, str) for item in value)
            values[p.name] = AS_DESIGNED if own else SEPARATOR.join(value) if several else value or p.default
        elif p.family is not None:
            values[p.name] = value[p.family] if several else p.unset
        elif several:
            values[p.name] = value[0]
        else:
            values[p.name] = p.default if value is None else value
    return values


def rivals(properties: list[KnobProperty], one_of: list[str], name: str) -> list[KnobProperty]:
    """The properties that a newly set one replaces: of the knobs `one_of` only one may be set."""
    mine = [p.knob for p in properties if p.name == name]
    if not mine or mine[0] not in one_of:
        return []
    return [p for p in properties if p.knob in one_of and p.name != name]


def _choice(name: str, knob: str, forms: list[Any], default: str, note: str) -> KnobProperty:
    single = [value for form in forms for value in form.get("enum", [form["const"]] if "const" in form else [])]
    choices = list(single)
    for form in forms:
        several = form.get("items", {}).get("enum", [])
        choices += [SEPARATOR.join(some) for n in range(2, len(several)) for some in combinations(several, n)]
        choices += [AS_DESIGNED] * (form.get("type") == "array" and not several)
    return KnobProperty(name, knob, "App::PropertyEnumeration", default, choices=tuple(choices), help=note)


def _whole(name: str, knob: str, forms: list[Any], default: int, note: str, several: bool) -> list[KnobProperty]:
    low, high = int(_bound(forms, "minimum", 0)), int(_bound(forms, "maximum", UNBOUNDED))
    kind = "App::PropertyIntegerConstraint"
    found = [KnobProperty(name, knob, kind, default, (low, high, 1), help=note)]
    if several:
        for family, ending in enumerate(FAMILIES):
            tip = f"{name} for {ending.lower()} alone; {low - 1}: as {name}. {note}"
            bounds = (low - 1, high, 1)
            found.append(
                KnobProperty(name + ending, knob, kind, low - 1, bounds, unset=low - 1, family=family, help=tip)
            )
    return found


def _number(
    name: str, knob: str, forms: list[Any], default: float | None, note: str, unit: str, optional: bool
) -> KnobProperty:
    if optional:
        note += " 0: not set."
    unset = 0.0 if optional else None
    start = 0.0 if default is None else float(default)
    if unit == "mm":
        return KnobProperty(name, knob, "App::PropertyLength", start, unset=unset, help=note)
    low = 0.0 if optional else float(_bound(forms, "minimum", -UNBOUNDED))
    high = float(_bound(forms, "maximum", _bound(forms, "exclusiveMaximum", UNBOUNDED)))
    step = (high - low) / STEPS if high - low < UNBOUNDED else 1.0
    bounds = (low, high, float(f"{step:.1g}"))
    return KnobProperty(name, knob, "App::PropertyFloatConstraint", start, bounds, unset=unset, help=note)


def _bound(forms: list[Any], key: str, otherwise: float) -> float:
    return next((form[key] for form in forms if key in form), otherwise)
