"""One table: every host shows the knobs of the schema, with its names, units, defaults, bounds and choices.

Nothing here names a knob. What FreeCAD itself makes of its properties is in `test_freecad`.
"""

import inspect
import json
from collections.abc import Callable
from dataclasses import dataclass
from io import StringIO
from itertools import pairwise
from typing import Any

import pytest
from cadquery import cqgi
from fusion_layouts import write_layout
from hosts import ROOT
from michell_workbench.knob_properties import AS_DESIGNED, UNBOUNDED, properties_of
from MichellTruss.logic.knobs import read_knobs
from pydantic import TypeAdapter
from rich.console import Console

from michell_cad.cli_edit import print_knobs
from michell_cad.knobs import Knobs, describe_knob
from michell_cad.scripting.build123d_objects import MichellTruss, SavedTruss
from michell_cad.scripting.cadquery_plugin import METHOD, michell_truss, register, saved_truss

SCHEMA = Knobs.model_json_schema()


@dataclass(frozen=True)
class Row:
    """What a host shows of a knob; a bound is the same whether it belongs to the range or not.

    Hosts that know no "none" write 0 for a default that is none.
    """

    unit: str
    default: Any
    low: float | None
    high: float | None
    choices: tuple[str, ...]
    text: str


def row_of(entry: dict[str, Any]) -> Row:
    """The row of a knob by its entry in a JSON schema."""
    forms = [entry, *entry.get("anyOf", [])]
    forms = [SCHEMA.get("$defs", {}).get(form.get("$ref", "").rpartition("/")[2], form) for form in forms]

    def bound(*keys: str) -> float | None:
        return next((form[key] for form in forms for key in keys if key in form), None)

    choices = [value for form in forms for value in form.get("enum", [form["const"]] if "const" in form else [])]
    return Row(
        entry.get("unit", "1"),
        entry.get("default"),
        bound("minimum", "exclusiveMinimum"),
        bound("maximum", "exclusiveMaximum"),
        tuple(choices),
        entry["description"],
    )


TRUTH = {name: row_of(entry) for name, entry in SCHEMA["properties"].items()}


def in_freecad() -> dict[str, Row]:
    """Of the properties for all families at once; a length has no bounds but that it is never negative."""
    rows = {}
    for p in properties_of(SCHEMA["properties"]):
        if p.family is not None:
            continue
        low, high, _ = p.bounds or (None, None, 0)
        if p.kind == "App::PropertyLength":
            low = 0
        text, _, unit = p.help.removesuffix(" 0: not set.").partition(" [")
        single = tuple(choice for choice in p.choices if ", " not in choice and choice != AS_DESIGNED)
        high = None if high == UNBOUNDED else high
        default = None if p.unset is not None and p.default == p.unset else p.default
        rows[p.knob] = Row(unit.rstrip("]") or "1", default, low, high, single, text)
    return rows


def in_fusion() -> dict[str, Row]:
    """Of the table that the add-in ships."""
    return {k.name: Row(k.unit, k.default, k.lowest, k.highest, k.choices, k.description) for k in read_knobs()}


def on_the_command_line() -> dict[str, Row]:
    """Of the printed table."""
    console = Console(file=StringIO(), width=400)
    print_knobs(console)
    lines = [line.strip("│\n ") for line in console.file.getvalue().splitlines() if line.startswith("│")]
    rows = {}
    for name, unit, default, bounds, text in ([cell.strip() for cell in line.split("│")] for line in lines):
        words = bounds.split()
        ends = {word: float(x) for word, x in pairwise(words) if word in ("from", "above", "to", "below")}
        shown = tuple(bounds.split(", ")) if bounds and not ends else ()
        low, high = ends.get("from", ends.get("above")), ends.get("to", ends.get("below"))
        value = default if shown else json.loads(default) if default else None
        rows[name] = Row(unit or "1", value, low, high, shown, text)
    return rows


def in_the_script() -> dict[str, Row]:
    """Of the constants and texts of the script for CQ-editor; the texts name unit, bounds and choices."""
    parameters = cqgi.parse((ROOT / "plugin/cq_editor/show_design.py").read_text(encoding="utf-8")).metadata.parameters
    rows = {}
    for name, parameter in parameters.items():
        if name == "design_file":
            continue
        assert parameter.desc == describe_knob(name), f"the script should say of {name}: {describe_knob(name)}"
        truth = TRUTH[name]
        none = truth.default is None and parameter.default_value == 0
        default = None if none else parameter.default_value
        rows[name] = Row(truth.unit, default, truth.low, truth.high, truth.choices, truth.text)
    return rows


def in_signature(function: Callable[..., Any]) -> dict[str, Row]:
    """Of the parameters that help shows."""
    rows = {}
    for name, parameter in inspect.signature(function).parameters.items():
        if name in Knobs.model_fields:
            entry = TypeAdapter(parameter.annotation).json_schema()
            rows[name] = row_of(entry | {"default": parameter.default})
    return rows


def in_build123d() -> dict[str, Row]:
    """Of both objects, which agree."""
    rows = in_signature(MichellTruss)
    assert rows == in_signature(SavedTruss)
    return rows


def in_cadquery() -> dict[str, Row]:
    """Of both functions and the method, which agree."""
    import cadquery

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cadquery.Workplane, METHOD, None, raising=False)
        register()
        rows = in_signature(getattr(cadquery.Workplane, METHOD))
    assert rows == in_signature(michell_truss) == in_signature(saved_truss)
    return rows


HOSTS = (in_freecad, in_fusion, on_the_command_line, in_the_script, in_build123d, in_cadquery)


@pytest.mark.parametrize("host", HOSTS)
def test_every_host_shows_the_knobs_of_the_schema(host):
    rows = host()
    assert list(rows) == list(TRUTH)
    for name, row in rows.items():
        assert row == TRUTH[name], name


def test_a_layout_file_has_all_knobs(tmp_path):
    layout = json.loads(write_layout(tmp_path / "truss.json").read_text())
    assert list(layout["knobs"]) == list(TRUTH)


def test_a_knob_that_a_host_lacks_or_shows_otherwise_is_caught(monkeypatch):
    monkeypatch.setitem(TRUTH, "colour", TRUTH["radius"])
    for host in HOSTS:
        with pytest.raises(AssertionError):
            test_every_host_shows_the_knobs_of_the_schema(host)
