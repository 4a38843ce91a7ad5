"""What pydantic finds wrong with a value, in the words of those who wrote it."""

import difflib
from collections.abc import Sequence
from typing import Any

from pydantic import BaseModel, ValidationError

EXPECTED = {
    "float_type": "a number",
    "float_parsing": "a number",
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_from_float": "a whole number",
    "bool_type": "true or false",
    "string_type": "a text",
    "tuple_type": "an array",
    "dict_type": "a table",
    "model_type": "a table",
}
"""Words of TOML for what pydantic calls otherwise."""


def expected(item: Any) -> str:
    """What one of pydantic's errors says was expected."""
    text: str = item["msg"]
    if item["type"] == "too_long":
        return f"expected at most {item['ctx']['max_length']} entries"
    if item["type"] == "too_short":
        return f"expected at least {item['ctx']['min_length']} entries"
    return f"expected {EXPECTED.get(item['type'], text.removeprefix('Input should be '))}"


def either(texts: Sequence[str]) -> str:
    """One text of the messages for the alternatives of a union."""
    return " or ".join(dict.fromkeys(texts)).replace("or expected ", "or ")


def suggestion(key: str, known: Sequence[str], kind: str = "key") -> str:
    """That a key is unknown, and which one may be meant."""
    near = difflib.get_close_matches(key, known, n=1, cutoff=0.5)
    return f"unknown {kind}" + (
        f"; did you mean {near[0]}?" if near else f"; known {kind}s: {', '.join(sorted(known))}"
    )


def explain_fields(error: ValidationError, model: type[BaseModel], place: str) -> str:
    """One line for each wrong field of a flat model; `place` says where its values stand."""
    mistakes: dict[str, list[str]] = {}
    found: dict[str, Any] = {}
    for item in error.errors(include_url=False):
        location, kind = item["loc"], item["type"]
        where = str(location[0]) if location else ""
        # In an array, that of the entry; what else follows names the alternatives of a union.
        index = next((step for step in location[1:] if isinstance(step, int)), None)
        where += "" if index is None else f"[{index + 1}]"
        if kind == "extra_forbidden":
            text = suggestion(where, list(model.model_fields))
        elif kind == "missing":
            text = "is missing" if len(location) == 1 else "has too few entries"
        elif kind in ("value_error", "assertion_error"):
            text = item["msg"].removeprefix("Value error, ")
        else:
            text = expected(item)
            found[where] = item["input"]
        mistakes.setdefault(where, []).append(text)
    return "\n".join(
        f"{place}{': ' if where else ''}{where}: {either(texts)}"
        + (f", found {found[where]!r}" if where in found else "")
        for where, texts in mistakes.items()
    )
