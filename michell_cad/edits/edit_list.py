"""The list of edits: it is saved with a design, and can be replayed, undone, reordered, and written as a script.

A script is a TOML file (or the same as JSON)::

    version = 1
    [knobs]                # of the design, changed
    radius = 1.2
    [[edit]]               # in order
    do = "radius"
    where = { family = "compression" }
    times = 1.5

Paths in a script are relative to it.
"""

import json
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, get_args

from pydantic import Field, ValidationError

from michell_cad.arrays import require
from michell_cad.edits.adding import AddCurve, AddStrut
from michell_cad.edits.attachments import Attach
from michell_cad.edits.joining import Join
from michell_cad.edits.removing import Remove, RemoveOpenEnds, Thin
from michell_cad.edits.sheets import AddSheet
from michell_cad.edits.sizing import Entasis, Radius
from michell_cad.edits.snapping import Snap
from michell_cad.edits.structure import Edit, Structure
from michell_cad.edits.tagging import Tag
from michell_cad.errors import InvalidInputError
from michell_cad.files import writing
from michell_cad.knobs import Knobs
from michell_cad.mistakes import explain_fields, suggestion
from michell_cad.pipeline import Design
from michell_cad.profile_source import with_profile_file

VERSION = 1

KINDS = AddCurve | AddSheet | AddStrut | Attach | Entasis | Join | Radius | Remove | RemoveOpenEnds | Snap | Tag | Thin
EDITS = Annotated[KINDS, Field(discriminator="do")]
"""Any edit, told apart by what it does."""
_BY_NAME: dict[str, type[Edit]] = {kind.model_fields["do"].default: kind for kind in get_args(KINDS)}

_PATH_KEYS = ("solid", "design", "part")
"""Keys of edits and selections whose value is a path."""


@dataclass(frozen=True)
class EditList:
    """Edits in their order."""

    edits: tuple[Edit, ...] = ()

    def __len__(self) -> int:
        return len(self.edits)

    def then(self, *edits: Edit) -> "EditList":
        """The list with more edits at its end."""
        return EditList((*self.edits, *edits))

    def undone(self, count: int = 1) -> "EditList":
        """The list without its last edits."""
        require(0 <= count <= len(self), f"cannot undo {count} edits: there are {len(self)}")
        return EditList(self.edits[: len(self) - count])

    def moved(self, number: int, place: int) -> "EditList":
        """The list with edit `number` at another place, both counted from 0."""
        for name, value in (("edit", number), ("place", place)):
            require(0 <= value < len(self), f"there is no {name} {value}: the {len(self)} edits count from 0")
        rest = [edit for k, edit in enumerate(self.edits) if k != number]
        return EditList((*rest[:place], self.edits[number], *rest[place:]))

    def replay(self, design: Design, knobs: Knobs) -> Structure:
        """Choose the curves of a design by the knobs and edit them, in the order of `structure`.

        Raises
        ------
        InvalidInputError
            If an edit cannot be made; the message names it.
        """
        structure = Structure.of(design, knobs)
        for number, edit in sorted(enumerate(self.edits, 1), key=lambda pair: not isinstance(pair[1], Snap)):
            try:
                structure = edit.apply(structure)
            except InvalidInputError as error:
                raise InvalidInputError(f"edit {number} of {len(self)}: {error}") from error
        return structure

    def plain(self) -> list[dict[str, Any]]:
        """The edits as tables of plain values."""
        return [edit.plain() for edit in self.edits]

    def located(self) -> list[dict[str, Any]]:
        """The same as `plain`, with whole paths in place of those relative to the current folder, to be saved."""
        return _located(self.plain(), Path.cwd())

    @staticmethod
    def of(tables: Sequence[Mapping[str, Any]], name: str = "edits") -> "EditList":
        """The edits that tables of plain values mean; `name` is for messages."""
        return EditList(tuple(_edit(table, f"{name}: [[edit]] {k}") for k, table in enumerate(tables, 1)))


NO_EDITS = EditList()


@dataclass(frozen=True)
class EditScript:
    """Changed knobs, and edits."""

    knobs: dict[str, Any] = field(default_factory=dict)
    edits: EditList = NO_EDITS


def read_script(path: str | Path) -> EditScript:
    """Read a script, .toml or .json.

    Raises
    ------
    InvalidInputError
        If the file is missing, no script, or written for a newer version.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
        data = json.loads(text) if path.suffix == ".json" else tomllib.loads(text)
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidInputError(f"{path}: the edit script cannot be read ({error})") from error
    except ValueError as error:
        kind = "JSON" if path.suffix == ".json" else "TOML"
        raise InvalidInputError(f"{path}: not valid {kind}: {error}") from error
    require(isinstance(data, dict), f"{path}: an edit script is a table with [knobs] and [[edit]]")
    version = data.get("version", VERSION)
    require(
        isinstance(version, int) and not isinstance(version, bool) and version >= 1,
        f"{path}: version = {version!r} is none of an edit script; write version = {VERSION}",
    )
    require(
        version <= VERSION,
        f"{path}: edit script of version {version!r}, this program reads up to {VERSION}: install a newer michell_cad",
    )
    unknown = sorted(set(data) - {"version", "knobs", "edit"})
    require(not unknown, f"{path}: unknown key {', '.join(unknown)}; a script has version, [knobs] and [[edit]]")
    require(isinstance(data.get("edit", []), list), f"{path}: write [[edit]], with two brackets: there may be several")
    knobs = data.get("knobs", {})
    require(isinstance(knobs, dict), f"{path}: [knobs] is a table such as radius = 1.2, found {knobs!r}")
    folder = path.parent.absolute()
    return EditScript(with_profile_file(knobs, folder), EditList.of(_located(data.get("edit", []), folder), str(path)))


def write_script(path: str | Path, edits: EditList, knobs: Mapping[str, Any] | None = None) -> None:
    """Write a script; .json as JSON, else TOML. The file is there whole or not at all."""
    path, tables = Path(path), edits.located()
    if path.suffix == ".json":
        text = json.dumps({"version": VERSION, "knobs": dict(knobs or {}), "edit": tables}, indent=1) + "\n"
    else:
        lines = [f"version = {VERSION}"]
        lines += ["", "[knobs]", *_toml_lines(knobs)] if knobs else []
        for table in tables:
            lines += ["", "[[edit]]", *_toml_lines(table)]
        text = "\n".join(lines) + "\n"
    with writing(path) as partial:
        partial.write_text(text, encoding="utf-8")


def change_knobs(knobs: Knobs, changes: Mapping[str, Any], name: str = "knobs") -> Knobs:
    """The knobs with some changed. A new radius, volume fraction or mass replaces the one that was there.

    Raises
    ------
    InvalidInputError
        For an unknown knob, or a value out of its bounds.
    """
    from michell_cad.knobs import SIZES

    values, changes = knobs.model_dump(), with_profile_file(changes)
    if any(changes.get(size) is not None for size in SIZES):
        values |= dict.fromkeys(SIZES)
    try:
        return Knobs.model_validate(values | changes)
    except ValidationError as error:
        raise InvalidInputError(explain_fields(error, Knobs, name)) from error


def _edit(table: Any, place: str) -> Edit:
    require(isinstance(table, Mapping), f"{place}: an edit is a table with `do`, found {table!r}")
    kind = table.get("do")
    require(kind is not None, f"{place}: `do` is missing; it says what to do: {', '.join(sorted(_BY_NAME))}")
    require(kind in _BY_NAME, f"{place}: do = {kind!r}: {suggestion(str(kind), list(_BY_NAME), 'edit')}")
    try:
        return _BY_NAME[kind].model_validate(table)
    except ValidationError as error:
        raise InvalidInputError(explain_fields(error, _BY_NAME[kind], f"{place} ({kind})")) from error
    except InvalidInputError as error:
        raise InvalidInputError(f"{place} ({kind}): {error}") from error


def _located(value: Any, folder: Path) -> Any:
    """The same plain value with its paths relative to the folder made whole."""
    if isinstance(value, list):
        return [_located(item, folder) for item in value]
    if isinstance(value, dict):
        return {
            key: str((folder / item).resolve())
            if key in _PATH_KEYS and isinstance(item, str)
            else _located(item, folder)
            for key, item in value.items()
        }
    return value


def _toml_lines(table: Mapping[str, Any]) -> list[str]:
    return [f"{_toml_key(key)} = {_toml(value)}" for key, value in table.items() if value is not None]


def _toml_key(key: str) -> str:
    return key if key.replace("_", "").replace("-", "").isalnum() else json.dumps(key)


def _toml(value: Any) -> str:
    """A plain value as TOML, tables inline. JSON's strings and numbers are TOML's as well."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(_toml_lines(value)) + " }" if value else "{}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    return json.dumps(value, ensure_ascii=False)
