"""What a host may ask of the worker, see `michell_cad.worker`; CAD and solvers load when they are first needed."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from michell_cad.arrays import require
from michell_cad.errors import InvalidInputError
from michell_cad.worker import PROTOCOL

if TYPE_CHECKING:
    from michell_cad.cad import BuiltSolid
    from michell_cad.design_file import Saved
    from michell_cad.knobs import Knobs
    from michell_cad.pipeline import Design

Progress = Callable[[str, float], None]

BREP_FILE = "truss.brep"
STEP_SUFFIXES, STL_SUFFIXES = (".step", ".stp"), (".stl",)

Request = TypeVar("Request", bound=BaseModel)

_STRICT = ConfigDict(extra="forbid", strict=True)


@dataclass
class Session:
    """What the worker remembers to be quick; everything in it can be had again from the files.

    Parameters
    ----------
    designs : the design file that was read last: by path and time of change, what is in it.
    solids : the solid that was built last, by design file and knobs.
    """

    designs: "dict[tuple, Saved]" = field(default_factory=dict)
    solids: "dict[tuple, tuple[Knobs, BuiltSolid]]" = field(default_factory=dict)

    def open(self, path: str) -> "tuple[tuple, Saved]":
        """Read a design file, or find it again: what identifies it, and what is in it."""
        from michell_cad.design_file import load_saved

        file = Path(path)
        require(file.is_file(), f"{path}: there is no design file; design the truss again")
        key = (str(file.resolve()), file.stat().st_mtime_ns, file.stat().st_size)
        if key not in self.designs:
            self.designs = {key: load_saved(file)}
        return key, self.designs[key]

    def build(self, path: str, changes: Mapping[str, Any], progress: Progress) -> "tuple[Design, Knobs, BuiltSolid]":
        """Build a design with changed knobs, or find the solid again: the design, the knobs as used, and the solid."""
        from michell_cad.building import build_united, size_finished
        from michell_cad.edits import change_knobs

        key, saved = self.open(path)
        wanted = change_knobs(saved.knobs, changes)
        if (key, wanted) not in self.solids:
            progress("solid", 0.0)
            structure = saved.replay(wanted)
            sizing = size_finished(structure)
            self.solids = {(key, wanted): (sizing.knobs, build_united(structure, sizing, progress))}
        return (saved.design, *self.solids[key, wanted])


class HelloRequest(BaseModel):
    """The first thing that a host says."""

    model_config = _STRICT
    protocol: int


class DesignRequest(BaseModel):
    """A job file to read and a design file to write."""

    model_config = _STRICT
    job: str
    design: str


class BuildRequest(BaseModel):
    """A design file, changed knobs (the others stay as the design has them), and a folder for the shapes."""

    model_config = _STRICT
    design: str
    knobs: dict[str, Any] = {}
    folder: str
    families: bool = False


class ExportRequest(BaseModel):
    """A design file, changed knobs, and the file to write."""

    model_config = _STRICT
    design: str
    knobs: dict[str, Any] = {}
    file: str


def say_hello(session: Session, values: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    """Agree on the protocol; tell what a host needs for its forms."""
    from michell_cad.job import DEFAULT_MATERIAL, named_materials
    from michell_cad.knobs import SIZES, Knobs
    from michell_cad.pipeline import DEFAULT_RESOLUTION, STAGES

    request = _read(HelloRequest, values)
    require(
        request.protocol == PROTOCOL,
        f"the add-in speaks version {request.protocol} of the protocol, michell_cad {_version()} speaks {PROTOCOL}: "
        + ("install a newer michell_cad" if request.protocol > PROTOCOL else "install the add-in of this michell_cad"),
    )
    return {
        "protocol": PROTOCOL,
        "version": _version(),
        "knobs": Knobs.model_json_schema()["properties"],
        "one_of": list(SIZES),
        "materials": list(named_materials()),
        "default_material": DEFAULT_MATERIAL,
        "default_resolution": DEFAULT_RESOLUTION,
        "stages": ["mesh", *STAGES, "solid"],
    }


def run_job(session: Session, values: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    """Design the truss of a job file and write the design file."""
    from michell_cad.delivery import design_structure
    from michell_cad.design_file import save_design

    request = _read(DesignRequest, values)
    target = Path(request.design)
    require(target.parent.is_dir(), f"{target}: there is no folder {target.parent}")
    structure, up = design_structure(request.job, progress)
    truss = structure.design.truss
    save_design(target, structure.design, structure.knobs, up=up, kept=structure.kept, sizing=structure.sizing)
    return {
        "design": str(target),
        "knobs": structure.knobs.model_dump(mode="json"),
        "members": len(truss.members),
        "nodes": len(truss.nodes),
        "curves": len(truss.curves),
        "spacing_mm": truss.spacing,
    }


def build(session: Session, values: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    """Build a design and write its solid as BREP, all files or none."""
    from michell_cad.cad import COLOURS
    from michell_cad.cad.brep import export_brep, export_family_breps, face_families
    from michell_cad.delivery import report_solid
    from michell_cad.files import writing_folder

    request = _read(BuildRequest, values)
    design, knobs, solid = session.build(request.design, request.knobs, progress)
    truss = solid.sized.truss
    with writing_folder(Path(request.folder)) as folder:
        export_brep(solid, folder / BREP_FILE)
        families = export_family_breps(solid, folder) if request.families else {}
        progress("export", 1.0)
    names, numbers = face_families(solid)
    return {
        "brep": str(Path(request.folder) / BREP_FILE),
        "families": {name: str(Path(request.folder) / file) for name, file in families.items()},
        "family_names": list(names),
        "face_families": numbers.tolist(),
        "colours": {name: COLOURS[name] for name in names},
        "knobs": knobs.model_dump(mode="json"),
        "radius_mm": float(solid.sized.radii.min()),
        "spacing_mm": truss.spacing,
        "mass_g": solid.report.volume_mm3 * design.problem.material.density,
        "messages": list(solid.report.messages),
    } | report_solid(solid)


def export(session: Session, values: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    """Build a design, unless it is the last one built, and write it as STEP or STL."""
    from michell_cad.cad import export_step, export_stl

    request = _read(ExportRequest, values)
    path = Path(request.file)
    known = (*STEP_SUFFIXES, *STL_SUFFIXES)
    require(path.suffix.lower() in known, f"{path}: unknown kind of file; expected one of {' '.join(known)}")
    require(path.parent.is_dir(), f"{path}: there is no folder {path.parent}")
    _, _, solid = session.build(request.design, request.knobs, progress)
    if path.suffix.lower() in STEP_SUFFIXES:
        export_step(solid, path, progress=lambda fraction: progress("export", fraction))
    else:
        export_stl(solid, path)
    return {"file": str(path), "bytes": path.stat().st_size}


TASKS: dict[str, Callable[[Session, Mapping[str, Any], Progress], dict[str, Any]]] = {
    "hello": say_hello,
    "design": run_job,
    "build": build,
    "export": export,
}


def _read(kind: type[Request], values: Mapping[str, Any]) -> Request:
    try:
        return kind.model_validate(dict(values))
    except ValidationError as error:
        lines = [f"{'.'.join(map(str, item['loc']))}: {item['msg']}" for item in error.errors(include_url=False)]
        raise InvalidInputError("the request is wrong: " + "; ".join(lines)) from error


def _version() -> str:
    try:
        return version("michell_cad")
    except PackageNotFoundError:  # run from its folder, not installed
        return "(not installed)"
