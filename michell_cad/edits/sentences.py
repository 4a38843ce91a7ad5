"""The plain form of selections: tables whose keys must all hold, as in TOML and JSON.

    { family = "compression", length = [20, 80], not = { near = [0, 0, 40], within = 5 } }

`any` and `all` take lists of tables, `not` takes one. An empty table is everything.
"""

import difflib
from collections.abc import Callable, Mapping
from typing import Any

from michell_cad.arrays import require
from michell_cad.edits.selections import (
    AllOf,
    AnyOf,
    Box,
    Every,
    Everything,
    Family,
    InSolid,
    Label,
    Length,
    Near,
    NotOf,
    Selection,
    Where,
    as_point,
)
from michell_cad.errors import InvalidInputError

_SENTENCES: dict[str, Callable[[Any, dict[str, Any]], Selection]] = {
    "family": lambda value, more: Family(tuple(value) if isinstance(value, list) else value, more.pop("surface", True)),
    "label": lambda value, more: Label(_given(more, "coordinate", "label"), *_pair(value, "label")),
    "every": lambda value, more: Every(int(value), int(more.pop("offset", 0))),
    "length": lambda value, more: Length(*value),
    "where": lambda value, more: Where(value),
    "box": lambda value, more: Box(*(as_point(corner, "a corner of the box") for corner in _pair(value, "box"))),
    "near": lambda value, more: Near(as_point(value, "near"), float(_given(more, "within", "near"))),
    "solid": lambda value, more: InSolid(str(value)),
    "any": lambda value, more: AnyOf(tuple(selection_from(part) for part in value)),
    "all": lambda value, more: AllOf(tuple(selection_from(part) for part in value)),
    "not": lambda value, more: NotOf(selection_from(value)),
}
"""What each key of a table selects; some take a second key along."""

_SECOND = {"surface": "family", "coordinate": "label", "offset": "every", "within": "near"}


def selection_from(table: Mapping[str, Any]) -> Selection:
    """The selection that a table of plain values means; all of its keys must hold. An empty table is everything.

    Raises
    ------
    InvalidInputError
        For an unknown key or a value that is not what its key expects.
    """
    require(isinstance(table, Mapping), f"a selection is a table such as {{ family = 'tension' }}, found {table!r}")
    more = {key: value for key, value in table.items() if key in _SECOND}
    parts = []
    for key, value in table.items():
        if key in _SECOND:
            continue
        if key not in _SENTENCES:
            near = difflib.get_close_matches(key, _SENTENCES, n=1)
            hint = f"did you mean {near[0]}?" if near else f"known keys: {', '.join(_SENTENCES)}"
            raise InvalidInputError(f"selection: unknown key {key!r}; {hint}")
        try:
            parts.append(_SENTENCES[key](value, more))
        except (TypeError, ValueError) as error:
            raise InvalidInputError(f"selection: {key} = {value!r} is not what {key} expects ({error})") from error
    for key in more:
        raise InvalidInputError(f"selection: {key} goes with {_SECOND[key]}, which is not there")
    if len(parts) == 1:
        return parts[0]
    return AllOf(tuple(parts)) if parts else Everything()


def _given(more: dict[str, Any], key: str, owner: str) -> Any:
    require(key in more, f"selection: {owner} needs {key} as well")
    return more.pop(key)


def _pair(value: Any, key: str) -> tuple[Any, Any]:
    require(isinstance(value, list | tuple) and len(value) == 2, f"selection: {key} takes two values, found {value!r}")
    return value[0], value[1]
