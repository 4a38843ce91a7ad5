"""The schema of edit scripts accepts what the program reads, and nothing that it refuses for its form."""

import json
import tomllib

import pytest
from schemas import check_schema
from test_edit_list import EVERY_KIND

from michell_cad.edits import Attach, Join, read_script, script_schema, write_script
from michell_cad.edits.script_schema import SELECTION
from michell_cad.edits.sentences import _SECOND, _SENTENCES
from michell_cad.errors import InvalidInputError

SCHEMA = script_schema()


def accepts(script: dict) -> bool:
    try:
        check_schema(script, SCHEMA, SCHEMA["$defs"])
    except AssertionError:
        return False
    return True


def test_every_edit_is_accepted_as_it_is_written(tmp_path):
    edits = EVERY_KIND.then(Join(design="d.npz"), Attach(part="lamp.step", spacing=5.0))
    write_script(tmp_path / "edits.toml", edits, {"radius": 1.2, "family": ["tension"], "every": [1, 2, 1]})
    assert accepts(tomllib.loads((tmp_path / "edits.toml").read_text()))
    json.dumps(SCHEMA)


def test_every_key_of_a_selection_is_described():
    schema = SCHEMA["$defs"][SELECTION]
    assert set(schema["properties"]) == set(_SENTENCES) | set(_SECOND)
    assert all(entry["description"] for entry in schema["properties"].values())
    for second, first in _SECOND.items():
        assert first in schema["dependentRequired"][second]


@pytest.mark.parametrize(
    "script",
    [
        {"version": 2},
        {"edits": []},
        {"knobs": {"radius": -1.0}},
        {"knobs": {"radios": 1.0}},
        {"edit": [{"where": {}}]},
        {"edit": [{"do": "radius", "too": 1.0}]},
        {"edit": [{"do": "tag"}]},
        {"edit": [{"do": "remove", "where": {"familly": "tension"}}]},
        {"edit": [{"do": "remove", "where": {"family": "compresion"}}]},
        {"edit": [{"do": "remove", "where": {"near": [0, 0, 0]}}]},
        {"edit": [{"do": "remove", "where": {"not": {"where": "outside"}}}]},
    ],
)
def test_what_the_schema_refuses_the_program_refuses_too(script, tmp_path):
    from michell_cad.edits import change_knobs
    from michell_cad.knobs import Knobs

    assert not accepts(script)
    file = tmp_path / "edits.json"
    file.write_text(json.dumps(script))
    with pytest.raises(InvalidInputError):
        change_knobs(Knobs(), read_script(file).knobs)
