"""What a designer has picked and chosen, kept as JSON in the document, and the same as a job file of michell_cad."""

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from michell_workbench import messages
from michell_workbench.texts import translate

LOAD_KINDS = ("force", "pressure", "torque", "self_weight")

VERSION = 1
"""Of what documents hold; older ones are read as they are, newer ones are refused."""

PART_SUFFIX = "-part.brep"
"""Of the body's file beside a job file; BREP keeps the numbers of the faces."""


@dataclass(frozen=True)
class Face:
    """A face as it was when it was picked.

    Parameters
    ----------
    name : FreeCAD's, ``Face3``.
    kind : of its surface.
    area : mm^2.
    centre : of mass, mm.
    """

    name: str
    kind: str
    area: float
    centre: tuple[float, float, float]

    @property
    def number(self) -> int:
        """What a job file calls it: FreeCAD counts from 1, michell_cad from 0."""
        return int(self.name[len("Face") :]) - 1


@dataclass(frozen=True)
class Support:
    """Faces that cannot move along the given axes."""

    faces: tuple[Face, ...]
    axes: str = "xyz"


@dataclass(frozen=True)
class Load:
    """What acts on faces.

    Parameters
    ----------
    faces : empty for the own weight.
    kind : one of `LOAD_KINDS`.
    vector : force (N) in all, axis of the torque, or direction of gravity.
    value : pressure (MPa) or torque (N mm).
    case : loads of one name act together.
    """

    faces: tuple[Face, ...]
    kind: str = "force"
    vector: tuple[float, float, float] = (0.0, 0.0, -100.0)
    value: float = 0.0
    case: str = "main"


@dataclass(frozen=True)
class Setup:
    """Everything of a job but the body and the knobs.

    Parameters
    ----------
    supports, loads : what holds the body, what acts on it.
    surfaces : kinds of all surfaces of the body, in order: as long as they stay, faces keep their names.
    material : name.
    resolution : cells along the longest coordinate; or
    spacing : edge of a cell, mm, if it is not 0.
    mesh_size : edge of the tets, mm; 0: from the body.
    spacing_weight : 0.1 follows the stress closely, 1 keeps the spacing even.
    layers : ``clear`` of faces, or ``hug`` them.
    combination : of load cases, ``sum`` or ``envelope``.
    """

    supports: tuple[Support, ...] = ()
    loads: tuple[Load, ...] = ()
    surfaces: tuple[str, ...] = ()
    material: str = "ABS"
    resolution: float = 24.0
    spacing: float = 0.0
    mesh_size: float = 0.0
    spacing_weight: float = 0.1
    layers: str = "clear"
    combination: str = "sum"

    def missing(self) -> list[str]:
        """What has to be given before it can be computed."""
        missing = []
        if not self.supports:
            missing.append(translate("MichellCAD", "a support"))
        if not self.loads:
            missing.append(translate("MichellCAD", "a load"))
        return missing

    def places(self) -> list[tuple[str, tuple[Face, ...]]]:
        """Every support and load with its faces, named for messages."""
        support, load = translate("MichellCAD", "support {n}"), translate("MichellCAD", "load {n}")
        return [(support.format(n=n), s.faces) for n, s in enumerate(self.supports, 1)] + [
            (load.format(n=n), x.faces) for n, x in enumerate(self.loads, 1)
        ]

    def with_faces(self, change: Callable[[Face], Face]) -> "Setup":
        """The same with every face changed."""
        values = asdict(self)
        for place, owner in zip(values["supports"] + values["loads"], self.supports + self.loads, strict=True):
            place["faces"] = [asdict(change(face)) for face in owner.faces]
        return setup_of(values)


def to_json(setup: Setup) -> str:
    """As text for the document."""
    return json.dumps({"version": VERSION} | asdict(setup))


def from_json(text: str) -> Setup:
    """Back from the document; an empty text is an empty setup.

    Raises
    ------
    ValueError
        If a newer add-in has saved it.
    """
    values = json.loads(text) if text else asdict(Setup())
    version = values.pop("version", VERSION)
    if version > VERSION:
        raise ValueError(messages.newer_document(version, VERSION))
    return setup_of(values)


def setup_of(values: Mapping[str, Any]) -> Setup:
    """A setup from plain values."""

    def faces(items: list[dict[str, Any]]) -> tuple[Face, ...]:
        return tuple(Face(**(item | {"centre": tuple(item["centre"])})) for item in items)

    supports = tuple(Support(**(item | {"faces": faces(item["faces"])})) for item in values["supports"])
    loads = tuple(
        Load(**(item | {"faces": faces(item["faces"]), "vector": tuple(item["vector"])})) for item in values["loads"]
    )
    return Setup(**(dict(values) | {"supports": supports, "loads": loads, "surfaces": tuple(values["surfaces"])}))


def job_text(setup: Setup, part: str, knobs: Mapping[str, Any]) -> str:
    """The job file: `part` relative to it, and the knobs that are set."""
    tables = [("[part]", {"file": part}), ("[material]", {"name": setup.material})]
    if setup.mesh_size:
        tables.append(("[mesh]", {"size": setup.mesh_size}))
    for support in setup.supports:
        tables.append(("[[support]]", {"faces": [face.number for face in support.faces], "axes": support.axes}))
    tables += [("[[load]]", _load_table(load)) for load in setup.loads]
    tables.append(("[cases]", {"combination": setup.combination}))
    cells = {"spacing": setup.spacing} if setup.spacing else {"resolution": setup.resolution}
    tables.append(("[options]", {**cells, "spacing_weight": setup.spacing_weight, "layers": setup.layers}))
    tables.append(("[knobs]", {name: value for name, value in knobs.items() if value is not None}))
    return (
        "\n\n".join("\n".join([head, *(f"{k} = {_toml(v)}" for k, v in table.items())]) for head, table in tables)
        + "\n"
    )


def write_job(path: Path, setup: Setup, knobs: Mapping[str, Any], write_part: Callable[[Path], None]) -> None:
    """Write a job file and the body's file beside it, each whole or not at all.

    Raises
    ------
    ValueError
        If there is no support or load yet.
    """
    missing = setup.missing()
    if missing:
        raise ValueError(messages.incomplete(missing))
    part = path.with_name(path.stem + PART_SUFFIX)
    text = job_text(setup, part.name, knobs)
    for target, write in ((part, write_part), (path, lambda file: file.write_text(text, encoding="utf-8"))):
        partial = target.with_name(f".{os.getpid()}-{target.name}")
        try:
            write(partial)
            partial.replace(target)
        finally:
            partial.unlink(missing_ok=True)


def _load_table(load: Load) -> dict[str, Any]:
    case = {"case": load.case}
    if load.kind == "self_weight":
        return {"self_weight": list(load.vector), **case}
    where = {"faces": [face.number for face in load.faces]}
    if load.kind == "pressure":
        return {**where, "pressure": load.value, **case}
    if load.kind == "torque":
        return {**where, "torque": {"moment": load.value, "axis": list(load.vector)}, **case}
    return {**where, "force": list(load.vector), **case}


def _toml(value: Any) -> str:
    """Plain values as TOML; JSON's texts, numbers and arrays are TOML's as well."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_toml(item)}" for key, item in value.items()) + " }"
    return json.dumps(value)
