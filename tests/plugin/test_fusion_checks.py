"""What can be said about the Fusion add-in without Fusion: types, imports, manifest, icons, and the table of knobs."""

import ast
import json
import shutil
import subprocess
import sys
import tomllib
import uuid
from pathlib import Path

import pytest
import write_knobs
from fusion_stubs import find_dummies, read_classes, write_stubs
from MichellTruss.logic.colours import COLOURS
from MichellTruss.logic.knobs import Widget, check_values, default_values, read_knobs
from MichellTruss.logic.layout import FAMILIES, FORMAT, NEWEST_VERSION, LayoutError
from MichellTruss.logic.selection import DEFAULT_RADIUS_RATIO, LARGEST_RADIUS_RATIO
from PIL import Image
from pydantic import ValidationError

from michell_cad import knobs as michell_knobs
from michell_cad import truss_json
from michell_cad.cad import step
from michell_cad.knobs import Knobs

ROOT = Path(__file__).parents[2]
ADDIN = ROOT / "plugin" / "fusion" / "MichellTruss"
COMMANDS = ("draw_truss", "edit_parameters", "set_material", "import_step")
GUID = "5f8f1d8e-6c0b-4a7e-9f43-2b6f0c1f7d52"
"""Fusion knows an add-in by this: it never changes."""

MISTAKES = {
    "a misspelt method": ("host/drawing.py", "sketchFixedSplines.addByNurbsCurve(", "sketchFixedSplines.addByNurbs("),
    "an argument left out": ("host/drawing.py", "lofts.createInput(operation)", "lofts.createInput()"),
    "an argument too many": ("host/drawing.py", "planes.add(across)", "planes.add(across, 1)"),
    "another enumeration": (
        "host/drawing.py",
        "createInput(profiles[0], path, operation)",
        "createInput(profiles[0], path, adsk.core.DialogResults.DialogYes)",
    ),
    "a number for a ValueInput": ("host/parameters.py", "prefix + name, given, host_", "prefix + name, value, host_"),
    "a misspelt property": ("host/events.py", "command.executeFailedMessage =", "command.executeFailMessage ="),
    "a read-only property": ("host/drawing.py", "body.name = tube.name", "body.volume = 1.0"),
    "a look-up that may find nothing": ("host/toolbar.py", "workspace.toolbarTabs.itemById(TAB) if workspace else None",
                                        "workspace.toolbarTabs.itemById(TAB)"),
    "a handler of another event": ("host/events.py", "definition.commandCreated.add(handler)",
                                   "definition.commandCreated.add(_OnCommand(lambda args: None))"),
}  # fmt: skip


def test_pyright_passes_the_add_in_and_catches_planted_mistakes(tmp_path):
    dummies = find_dummies()
    if dummies is None:
        pytest.skip("the package adsk is not installed: pip install '.[test]'")
    write_stubs(read_classes(dummies), tmp_path / "stubs")
    ignore = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ADDIN, tmp_path / "clean", ignore=ignore)
    shutil.copytree(ADDIN, tmp_path / "spoilt", ignore=ignore)
    planted = {}
    for name, (file, right, wrong) in MISTAKES.items():
        text = (tmp_path / "spoilt" / file).read_text()
        assert right in text, f"nowhere to plant {name}"
        planted[name] = (file, text[: text.index(right)].count("\n"))
        (tmp_path / "spoilt" / file).write_text(text.replace(right, wrong, 1))
    settings = {
        "include": ["clean", "spoilt"],
        "stubPath": "stubs",
        "typeCheckingMode": "standard",
        "pythonVersion": "3.12",
    }
    (tmp_path / "pyrightconfig.json").write_text(json.dumps(settings))
    command = [sys.executable, "-m", "pyright", "--outputjson", "-p", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    found: dict[str, set[int]] = {}
    for one in json.loads(done.stdout)["generalDiagnostics"]:
        place = Path(one["file"]).relative_to(tmp_path).as_posix()
        found.setdefault(place, set()).add(one["range"]["start"]["line"])
    assert not [place for place in found if place.startswith("clean/")], done.stdout
    missed = [name for name, (file, line) in planted.items() if line not in found.get(f"spoilt/{file}", ())]
    assert not missed


def sources() -> list[Path]:
    return sorted(ADDIN.rglob("*.py"))


def imports(file: Path) -> set[str]:
    """Top-level names of the absolute imports of a file."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found.add((node.module or "").split(".")[0])
    return found


def test_only_the_standard_library_and_adsk_are_imported():
    assert len(sources()) > 15
    for file in sources():
        assert imports(file) <= set(sys.stdlib_module_names) | {"adsk"}, file
        if file.relative_to(ADDIN).parts[0] == "logic":
            assert "adsk" not in imports(file), f"{file.name} is meant to be free of the host"
    assert "adsk" in imports(ADDIN / "host" / "drawing.py")


def test_manifest():
    manifest = json.loads((ADDIN / f"{ADDIN.name}.manifest").read_text())
    assert (ADDIN / f"{ADDIN.name}.py").is_file(), "Fusion starts the file with the folder's name"
    assert manifest["autodeskProduct"] == "Fusion360"
    assert manifest["type"] == "addin"
    assert str(uuid.UUID(manifest["id"])) == GUID
    assert manifest["author"]
    assert manifest["description"][""]
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert manifest["version"] == version
    assert manifest["runOnStartup"] is False
    assert set(manifest["supportedOS"].split("|")) == {"windows", "mac"}
    assert (ADDIN / manifest["iconFilename"]).is_file()


def test_every_command_has_its_entry_and_icons():
    folders = {folder.parent.name for folder in ADDIN.glob("commands/*/entry.py")}
    assert folders == set(COMMANDS)
    pictures = set()
    for name in COMMANDS:
        for size in (16, 32, 64):
            with Image.open(ADDIN / "commands" / name / "resources" / f"{size}x{size}.png") as icon:
                assert icon.size == (size, size)
                assert icon.mode == "RGBA"
                assert icon.getchannel("A").getextrema() == (0, 255)
                pictures.add(icon.tobytes())
    assert len(pictures) == 3 * len(COMMANDS)


def test_the_shipped_knobs_are_the_live_schema():
    shipped = write_knobs.SCHEMA_FILE.read_text(encoding="utf-8")
    assert shipped == write_knobs.schema_text(), "run: python plugin/fusion/write_knobs.py"


def test_the_table_of_knobs_is_that_of_michell_cad():
    """Names, units, defaults and help texts; and every bound accepts and refuses what michell_cad does."""
    table = read_knobs()
    assert [knob.name for knob in table] == list(Knobs.model_fields)
    for knob in table:
        field = Knobs.model_fields[knob.name]
        extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
        assert (knob.unit, knob.description) == (extra.get("unit", "1"), field.description)
        assert knob.default == field.default
    check_values(table, default_values(table))
    tried = 0
    for knob in table:
        step_ = 1 if knob.widget in (Widget.PER_FAMILY, Widget.WHOLE) else 1e-6
        for bound in (knob.lowest, knob.highest):
            for value in () if bound is None else (bound - step_, bound, bound + step_):
                try:
                    Knobs(**{knob.name: value})
                except ValidationError:
                    assert knob.check(value), f"{knob.name} = {value} must be refused"
                else:
                    assert knob.check(value) is None
                tried += 1
    assert tried >= 20


def test_knobs_of_other_kinds():
    """What the schema may come to hold: choices, flags, references to definitions; and what it may not."""
    schema = {
        "$defs": {"Profile": {"enum": ["round", "square"], "type": "string"}},
        "properties": {
            "profile": {"$ref": "#/$defs/Profile", "default": "round"},
            "hollow": {"type": "boolean", "default": False},
            "sides": {"type": "integer", "minimum": 3, "maximum": 12, "default": 6},
        },
    }
    profile, hollow, sides = read_knobs(schema)
    assert (profile.widget, profile.choices) == (Widget.CHOICE, ("round", "square"))
    assert profile.check("oval")
    assert hollow.widget is Widget.FLAG
    assert sides.check(2) == "Sides is 2: give at least 3."
    with pytest.raises(LayoutError, match="cannot show"):
        read_knobs({"properties": {"shape": {"type": "object"}}})
    with pytest.raises(LayoutError, match=r"no knob 'depth'"):
        check_values((sides,), {"depth": 3})


def test_what_the_add_in_repeats_is_what_michell_cad_says():
    assert (FORMAT, NEWEST_VERSION) == (truss_json.FORMAT, truss_json.VERSION)
    assert FAMILIES == michell_knobs.FAMILY_ORDER
    assert DEFAULT_RADIUS_RATIO == michell_knobs.DEFAULT_RADIUS_RATIO
    assert LARGEST_RADIUS_RATIO == michell_knobs.LARGEST_RADIUS_RATIO
    for family, colour in COLOURS.items():
        assert colour == pytest.approx([255 * part for part in step.COLOURS[family]], abs=1)
