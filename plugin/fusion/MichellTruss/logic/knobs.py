"""The knobs as the dialogs show them, read from `knobs.json`, the schema that michell_cad itself writes.

Nothing here names a knob: what michell_cad adds to its schema, the dialogs show. `selection` says what a knob does.
"""

import json
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from .layout import FAMILIES, LayoutError

SCHEMA_FILE = Path(__file__).parents[1] / "knobs.json"


class Widget(StrEnum):
    """How a knob is asked for."""

    FAMILIES = "families"
    """Any of the three families, or all."""
    PER_FAMILY = "per family"
    """A whole number for each family."""
    WHOLE = "whole number"
    NUMBER = "number"
    OPTIONAL_NUMBER = "number or nothing"
    """A positive number, or none, which the dialogs show as 0."""
    CHOICE = "choice"
    FLAG = "flag"


@dataclass(frozen=True)
class Knob:
    """One knob: name, widget, unit ("1": none), help text, default and bounds (None: unbounded)."""

    name: str
    title: str
    widget: Widget
    unit: str
    description: str
    default: Any
    lowest: float | None = None
    highest: float | None = None
    above: bool = False
    """Whether the lowest value itself is refused."""
    below: bool = False
    """Whether the highest value itself is refused."""
    choices: tuple[str, ...] = ()

    def check(self, value: Any) -> str | None:
        """What is wrong with a value, or None."""
        if self.widget is Widget.FAMILIES:
            chosen = (value,) if isinstance(value, str) else tuple(value)
            bad = [name for name in chosen if name not in self.choices] or ["nothing"] * (not chosen)
            return f"{self.title}: choose at least one of {', '.join(FAMILIES)}; found {bad[0]}." if bad else None
        if self.widget is Widget.CHOICE:
            return None if value in self.choices else f"{self.title}: choose one of {', '.join(self.choices)}."
        if self.widget is Widget.FLAG or value is None:
            optional = self.widget in (Widget.FLAG, Widget.OPTIONAL_NUMBER)
            return None if optional else f"{self.title}: give a value."
        numbers = value if isinstance(value, (tuple, list)) else (value,)
        return next((text for text in map(self._check_number, numbers) if text), None)

    def _check_number(self, value: Any) -> str | None:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            return f"{self.title}: {value!r} is not a number."
        unit = "" if self.unit == "1" else f" {self.unit}"
        if self.lowest is not None and (value < self.lowest or (self.above and value == self.lowest)):
            rule = f"{'more than' if self.above else 'at least'} {self.lowest:g}{unit}"
        elif self.highest is not None and (value > self.highest or (self.below and value == self.highest)):
            rule = f"{'less than' if self.below else 'at most'} {self.highest:g}{unit}"
        else:
            return None
        return f"{self.title} is {value:g}{unit}: give {rule}."


def read_knobs(schema: dict[str, Any] | None = None) -> tuple[Knob, ...]:
    """The knobs of a JSON schema (default: the one in the add-in's folder), in its order.

    Raises
    ------
    LayoutError
        If a knob is of a kind that the dialogs do not know.
    """
    if schema is None:
        schema = json.loads(SCHEMA_FILE.read_text(encoding="utf-8"))
    assert schema is not None
    definitions = schema.get("$defs", {})
    return tuple(_knob(name, _resolved(entry, definitions)) for name, entry in schema["properties"].items())


def default_values(knobs: tuple[Knob, ...]) -> dict[str, Any]:
    """The default of every knob."""
    return {knob.name: knob.default for knob in knobs}


def check_values(knobs: tuple[Knob, ...], values: dict[str, Any]) -> None:
    """Refuse unknown knobs and values out of bounds.

    Raises
    ------
    LayoutError
        With one line for each wrong value.
    """
    known = {knob.name: knob for knob in knobs}
    wrong = [f"This add-in has no knob '{name}': update the add-in." for name in values if name not in known]
    wrong += [text for name, value in values.items() if name in known and (text := known[name].check(value))]
    if wrong:
        raise LayoutError("\n".join(wrong))


def _resolved(entry: dict[str, Any], definitions: dict[str, Any]) -> dict[str, Any]:
    """A schema entry with references to definitions replaced by what they define."""
    if "$ref" in entry:
        entry = definitions[entry["$ref"].rsplit("/", 1)[-1]] | {k: v for k, v in entry.items() if k != "$ref"}
    if "anyOf" in entry:
        return entry | {"anyOf": [_resolved(option, definitions) for option in entry["anyOf"]]}
    return entry


def _knob(name: str, entry: dict[str, Any]) -> Knob:
    options = entry.get("anyOf", [entry])
    types = {option.get("type") for option in options}
    choices = [
        choice for option in options for choice in option.get("enum", [option.get("const")]) if choice is not None
    ]
    if types == {"string", "array"} and set(FAMILIES) <= set(choices):
        widget = Widget.FAMILIES
    elif types == {"integer", "array"}:
        widget = Widget.PER_FAMILY
    elif types == {"number", "null"}:
        widget = Widget.OPTIONAL_NUMBER
    elif types == {"number"} or types == {"integer"} or types == {"boolean"}:
        widget = {"number": Widget.NUMBER, "integer": Widget.WHOLE, "boolean": Widget.FLAG}[options[0]["type"]]
    elif types <= {"string", "array"} and choices:  # an outline of one's own comes from a job file only
        widget = Widget.CHOICE
    else:
        raise LayoutError(f"knobs.json asks for a knob '{name}' that this add-in cannot show: update the add-in.")
    bounds = next((option for option in options if option.get("type") in ("number", "integer")), {})
    return Knob(
        name=name,
        title=name.replace("_", " ").capitalize(),
        widget=widget,
        unit=entry.get("unit", "1"),
        description=entry.get("description", ""),
        default=entry.get("default"),
        lowest=bounds.get("minimum", bounds.get("exclusiveMinimum")),
        highest=bounds.get("maximum", bounds.get("exclusiveMaximum")),
        above="exclusiveMinimum" in bounds,
        below="exclusiveMaximum" in bounds,
        choices=tuple(dict.fromkeys(choices)),
    )
