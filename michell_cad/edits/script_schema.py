"""JSON Schema of an edit script, so that editors of text complete and check `edits.toml`."""

from typing import Any

from pydantic import TypeAdapter

from michell_cad.curves import FAMILIES
from michell_cad.edits.edit_list import EDITS, VERSION
from michell_cad.edits.selections import PLACES
from michell_cad.knobs import FAMILY_ORDER, Knobs

SELECTION = "Selection"

_SELECTION_REF = {"$ref": f"#/$defs/{SELECTION}"}
_POINT = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}
_LIST = {"type": "array", "items": _SELECTION_REF, "minItems": 1}
_NUMBER = {"type": "integer", "minimum": 0}
_NAME = {"type": "string", "enum": list(FAMILIES)}


def script_schema() -> dict[str, Any]:
    """The schema; every key has its help text."""
    knobs = Knobs.model_json_schema()
    edits = TypeAdapter[Any](EDITS).json_schema()
    defs: dict[str, Any] = edits.pop("$defs") | {SELECTION: _selection_schema(), "Knobs": knobs}
    for edit in defs.values():
        fields = edit.get("properties", {})
        if "do" in fields:
            # It tells the edits apart, so that it must be there, whatever the models' defaults are.
            edit["required"] = ["do", *edit.get("required", [])]
        if "where" in fields and "do" in fields:
            fields["where"] = _SELECTION_REF | {"description": fields["where"]["description"]}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "EditScript",
        "description": "Edits of a finished design, for michell-cad edit --script.",
        "type": "object",
        "additionalProperties": False,
        "properties": {
            "version": {"type": "integer", "maximum": VERSION, "description": "Of this format."},
            "knobs": {"$ref": "#/$defs/Knobs", "description": "Knobs of the design that change."},
            "edit": {"type": "array", "items": edits, "description": "Edits, in order."},
        },
        "$defs": defs,
    }


def _selection_schema() -> dict[str, Any]:
    """The plain form of a selection, see `sentences`."""
    keys: dict[str, tuple[str, dict[str, Any]]] = {
        "family": (
            "Curves of a family, or of several.",
            {"anyOf": [_NAME, {"type": "array", "items": _NAME, "minItems": 1}]},
        ),
        "surface": ("With family: whether its boundary curves go with it; default: yes.", {"type": "boolean"}),
        "label": (
            "Curves whose isovalue of a coordinate lies between two values, both included.",
            {"type": "array", "items": {"type": "integer"}, "minItems": 2, "maxItems": 2},
        ),
        "coordinate": (
            "With label: the coordinate, or the family that runs along it.",
            {"anyOf": [{"type": "integer", "minimum": 0, "maximum": 2}, {"type": "string", "enum": [*FAMILY_ORDER]}]},
        ),
        "every": ("Every n-th curve by its label.", {"type": "integer", "minimum": 1}),
        "offset": ("With every: shift of the labels.", {"type": "integer"}),
        "part": (
            "Curves of some of several joined trusses: 0 is this design, 1 the first that was joined to it.",
            {"anyOf": [_NUMBER, {"type": "array", "items": _NUMBER, "minItems": 1}]},
        ),
        "length": (
            "Curves between two lengths, mm; one number: at least so long.",
            {"type": "array", "items": {"type": "number", "minimum": 0}, "minItems": 1, "maxItems": 2},
        ),
        "where": ("Curves that run on the boundary, or inside.", {"type": "string", "enum": list(PLACES)}),
        "box": (
            "Members whose middle lies in the box between two corners, mm.",
            {"type": "array", "items": _POINT, "minItems": 2, "maxItems": 2},
        ),
        "near": ("Members whose middle lies within a distance of a point, mm.", _POINT),
        "within": ("With near: the distance, mm.", {"type": "number", "exclusiveMinimum": 0}),
        "solid": ("Members whose middle lies in the solid of a file.", {"type": "string"}),
        "any": ("What is in any of these selections.", _LIST),
        "all": ("What is in all of these selections.", _LIST),
        "not": ("What is not in this selection.", _SELECTION_REF),
    }
    return {
        "type": "object",
        "description": "Curves or members; all keys must hold, and an empty table is everything.",
        "additionalProperties": False,
        "properties": {name: schema | {"description": text} for name, (text, schema) in keys.items()},
        "dependentRequired": {
            "label": ["coordinate"],
            "coordinate": ["label"],
            "near": ["within"],
            "within": ["near"],
            "surface": ["family"],
            "offset": ["every"],
        },
    }
