"""The plain form of selections: tables whose keys must all hold, as in TOML and JSON.

    { family = "compression", length = [20, 80], not = { near = [0, 0, 40], within = 5 } }

`any` and `all` take lists of tables, `not` takes one. An empty table is everything.
"""

import difflib
from collections.abc import Callable, Mapping, Sequence
from numbers import Integral, Real
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
    Part,
    Selection,
    Where,
    as_point,
)
from michell_cad.errors import InvalidInputError

_SENTENCES: dict[str, Callable[[Any, dict[str, Any]], Selection]] = {
    "family": lambda value, more: Family(_names(value), _flag(more.pop("surface", True), "surface")),
    "label": lambda value, more: Label(
        _coordinate(_given(more, "coordinate", "label")), *(_whole(end, "label") for end in _pair(value, "label"))
    ),
    "every": lambda value, more: Every(_whole(value, "every"), _whole(more.pop("offset", 0), "offset")),
    "part": lambda value, more: Part(
        tuple(_whole(number, "part") for number in (value if isinstance(value, list) else [value]))
    ),
    "length": lambda value, more: Length(*(_number(end, "length") for end in _one_or_two(value, "length"))),
    "where": lambda value, more: Where(_text(value, "where")),
    "box": lambda value, more: Box(*(as_point(corner, "a corner of the box") for corner in _pair(value, "box"))),
    "near": lambda value, more: Near(as_point(value, "near"), _number(_given(more, "within", "near"), "within")),
    "solid": lambda value, more: InSolid(_text(value, "solid")),
    "any": lambda value, more: AnyOf(_parts(value, "any")),
    "all": lambda value, more: AllOf(_parts(value, "all")),
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
        parts.append(_SENTENCES[key](value, more))
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


def _one_or_two(value: Any, key: str) -> Sequence[Any]:
    require(
        isinstance(value, list | tuple) and 1 <= len(value) <= 2,
        f"selection: {key} takes [from] or [from, to], found {value!r}",
    )
    return value


def _parts(value: Any, key: str) -> tuple[Selection, ...]:
    require(
        isinstance(value, list | tuple) and len(value),
        f"selection: {key} takes a list of tables, at least one, found {value!r}",
    )
    return tuple(selection_from(part) for part in value)


def _names(value: Any) -> str | tuple[str, ...]:
    return tuple(_text(name, "family") for name in value) if isinstance(value, list | tuple) else _text(value, "family")


def _coordinate(value: Any) -> int | str:
    return value if isinstance(value, str) else _whole(value, "coordinate")


def _text(value: Any, key: str) -> str:
    require(isinstance(value, str), f"selection: {key} must be a text, found {value!r}")
    return value


def _flag(value: Any, key: str) -> bool:
    require(isinstance(value, bool), f"selection: {key} must be true or false, found {value!r}")
    return value


def _whole(value: Any, key: str) -> int:
    require(
        isinstance(value, Integral) and not isinstance(value, bool), f"selection: {key} must be whole, found {value!r}"
    )
    return int(value)


def _number(value: Any, key: str) -> int | float:
    require(
        isinstance(value, Real) and not isinstance(value, bool), f"selection: {key} must be a number, found {value!r}"
    )
    return value if isinstance(value, int) else float(value)
