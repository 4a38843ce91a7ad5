"""The command `michell-cad edit`: every knob is an option, as its schema names it."""

import difflib
import tomllib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from michell_cad.errors import InvalidInputError
from michell_cad.knobs import Knobs, knob_bounds, knob_choices

if TYPE_CHECKING:
    from rich.console import Console


def read_knob_options(arguments: Sequence[str], settings: Sequence[str]) -> dict[str, Any]:
    """Knobs from what stands on the command line.

    Parameters
    ----------
    arguments : ``["--radius", "1.2", "--family=compression"]``; a knob ``fillet_ratio`` may be ``--fillet-ratio``.
    settings : ``["radius=1.2"]``.

    Raises
    ------
    InvalidInputError
        For an unknown knob, or one without value.
    """
    pairs = [_split(text, text) for text in settings]
    rest = list(arguments)
    while rest:
        option = rest.pop(0)
        if not option.startswith("--"):
            raise InvalidInputError(f"unexpected {option!r}; expected DESIGN and then options such as --radius 1.2")
        if "=" in option:
            pairs.append(_split(option[2:], option))
        elif rest and not rest[0].startswith("--"):
            pairs.append((option[2:], rest.pop(0)))
        else:
            _known(option[2:], option)
            raise InvalidInputError(f"{option} needs a value")
    return {_known(name, name): _value(text) for name, text in pairs}


def print_knobs(console: "Console") -> None:
    """Print the knobs with units, bounds, defaults and help texts."""
    from rich.table import Table

    table = Table("knob", "unit", "default", "bounds", "meaning")
    for name, field in Knobs.model_json_schema()["properties"].items():
        bounds = ", ".join(knob_choices(field)) or " ".join(knob_bounds(field)).strip()
        default = field.get("default")
        shown = "" if default is None else str(default)
        table.add_row(name, field.get("unit", ""), shown, bounds, field.get("description", ""))
    console.print(table)


def _split(text: str, shown: str) -> tuple[str, str]:
    name, found, value = text.partition("=")
    if not found or not value:
        raise InvalidInputError(f"--set takes name=value such as radius=1.2, found {shown!r}")
    return name.strip(), value.strip()


def _known(name: str, shown: str) -> str:
    knob = name.replace("-", "_")
    if knob not in Knobs.model_fields:
        near = difflib.get_close_matches(knob, Knobs.model_fields, n=1)
        hint = f"did you mean {near[0]}?" if near else f"the knobs are {', '.join(Knobs.model_fields)}"
        raise InvalidInputError(f"unknown option or knob {shown!r}; {hint}")
    return knob


def _value(text: str) -> Any:
    """A number, a text, or several separated by commas."""
    if "," in text and not text.startswith("[["):
        return tuple(_value(part.strip()) for part in text.strip("[]()").split(","))
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text.strip("\"'")
