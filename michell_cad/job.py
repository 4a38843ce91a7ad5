"""The job file: a part, how it is held and loaded, and what to make of it (TOML, validated by pydantic).

Source: none, this is the program's own format; its keys are the fields of the models below and nothing else, and
`job_schema` gives them as JSON Schema. `[part]` is the only table that must be there. Lengths in the file are mm,
except for coordinates on the part (regions, points of axes), which are in the part's own unit (`[part] units`); forces
are N, moments N mm, pressures and strengths MPa, densities g/cm3. Paths are relative to the job file.

Rules that the keys alone do not tell:

* An `.npz` part brings its own supports and forces. `[[support]]` tables replace all of its supports, `[[load]]` tables
  all of its forces.
* A load without `case` belongs to the case "main". Cases act as `[cases] combination` says, see `DesignProblem`.
* A `[[support]]` holds the vertices of all triangles of its region; its `axes` are those of the coordinate system.
"""

import difflib
import tomllib
from collections.abc import Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, Field, ValidationError, field_validator, model_validator

from michell_cad.arrays import require
from michell_cad.domain.outline import Outline, Part
from michell_cad.errors import InvalidInputError
from michell_cad.job_values import STRICT, Number, Positive, Switch
from michell_cad.knobs import Knobs
from michell_cad.mistakes import either, expected, suggestion
from michell_cad.output_section import OutputSection
from michell_cad.problem import (
    DesignProblem,
    LoadCase,
    Material,
    self_weight,
    surface_force,
    surface_pressure,
    surface_torque,
)
from michell_cad.profile_source import with_profile_file
from michell_cad.selection import REGION_KEYS, Region, Vector, select_triangles
from michell_cad.sizing_section import SizingSection

DEFAULT_MATERIAL = "ABS"
"""The paper's printed examples are of ABS; the choice matters for masses and strengths, hardly for directions."""

MAIN_CASE = "main"
"""Name of the case of loads that name none."""


def _not_zero(value: Vector) -> Vector:
    if not any(value):
        raise ValueError("must not be the zero vector")
    return value


class PartSection(BaseModel):
    """The part's file."""

    model_config = STRICT
    file: str = Field(description=".step .stp .brep .stl .obj .3mf .mesh .msh .vtu or .npz, relative to the job file.")
    units: Literal["mm", "cm", "m", "in"] | None = Field(
        default=None,
        description="Unit of the file's numbers; default mm, m for .npz. STEP and 3MF files state their unit, which "
        "holds unless another one than mm is named here.",
    )


class MeshSection(BaseModel):
    """The tet mesh."""

    model_config = STRICT
    size: Positive | None = Field(default=None, description="Median edge of the tets, mm; default: from the part.")


class MaterialSection(BaseModel):
    """A named material, numbers of one's own, or a name with some numbers replaced."""

    model_config = STRICT
    name: str | None = Field(
        default=None, description="A material of the list, or with all numbers a name of one's own."
    )
    youngs_modulus: Positive | None = Field(default=None, description="Young's modulus, MPa.")
    poisson_ratio: Annotated[Number, Field(gt=-1, lt=0.5)] | None = Field(default=None, description="Poisson's ratio.")
    density: Positive | None = Field(default=None, description="Density, g/cm3.")
    yield_strength: Positive | None = Field(default=None, description="Yield strength, MPa.")


class Support(Region):
    """What holds the part: a region of its surface, and the axes along which it cannot move."""

    axes: str = Field(default="xyz", description="Held axes: letters of xyz, each at most once.")

    @field_validator("axes")
    @classmethod
    def _once(cls, value: str) -> str:
        if not value or len(set(value)) != len(value) or set(value) - set("xyz"):
            raise ValueError(f'expected letters of xyz, each at most once, such as "xyz" or "z", found {value!r}')
        return value

    @model_validator(mode="after")
    def _somewhere(self) -> "Support":
        if all(getattr(self, key) is None for key in REGION_KEYS):
            raise ValueError(f"say where: give one of {', '.join(REGION_KEYS)}")
        return self


class Torque(BaseModel):
    """A couple about an axis. As it has no net force, it is the same about every parallel axis."""

    model_config = STRICT
    moment: Number = Field(description="Moment, N mm, right-handed about the axis.")
    axis: Vector = Field(description="Direction of the axis; its length does not matter.")
    axis_point: Vector | None = Field(
        default=None, description="A point of the axis, in the part's units; for the reader."
    )

    _axis = field_validator("axis")(_not_zero)


LOAD_KEYS = ("force", "pressure", "torque", "self_weight")


class Load(Region):
    """What acts on the part: on a region a total force, a pressure or a torque; or its own weight."""

    force: Vector | None = Field(default=None, description="Total force over the region, N.")
    pressure: Number | None = Field(default=None, description="Pressure, MPa; positive pushes into the part.")
    torque: Torque | None = None
    self_weight: Vector | None = Field(default=None, description="Direction of gravity; takes no region.")
    case: str = Field(default=MAIN_CASE, min_length=1, description="Load case to which this load belongs.")

    _direction = field_validator("self_weight")(lambda value: value if value is None else _not_zero(value))

    @model_validator(mode="after")
    def _one_kind(self) -> "Load":
        kinds = [key for key in LOAD_KEYS if getattr(self, key) is not None]
        if len(kinds) != 1:
            raise ValueError(f"give exactly one of {', '.join(LOAD_KEYS)}, found {' and '.join(kinds) or 'none'}")
        where = [key for key in REGION_KEYS if getattr(self, key) is not None]
        if kinds == ["self_weight"] and where:
            raise ValueError(f"self_weight acts on the whole part and takes no region, found {where[0]}")
        if kinds != ["self_weight"] and not where:
            raise ValueError(f"say where: give one of {', '.join(REGION_KEYS)}")
        moment = self.torque.moment if self.torque is not None else 0.0
        if not any((*(self.force or ()), self.pressure or 0.0, moment, *(self.self_weight or ()))):
            raise ValueError(f"{kinds[0]} is zero: a load must not be zero")
        return self


class Keep(Region):
    """Material of the part that stays solid, beside some of its faces."""

    depth: Positive = Field(description="Thickness of what is kept, mm, inward from the faces.")
    clearance: Positive | None = Field(
        default=None,
        description="How far the room in front of the faces stays free of members, mm; default: as far as the depth.",
    )

    @model_validator(mode="after")
    def _somewhere(self) -> "Keep":
        if all(getattr(self, key) is None for key in REGION_KEYS):
            raise ValueError(f"say where: give one of {', '.join(REGION_KEYS)}")
        return self


class CasesSection(BaseModel):
    """How several load cases make one design."""

    model_config = STRICT
    combination: Literal["sum", "envelope"] = Field(
        default="sum", description="sum: the cases act at once; envelope: one at a time, either way round."
    )
    weights: dict[str, Positive] = Field(default={}, description="Weight of each case by its name; default 1.")


class Options(BaseModel):
    """Options of the stages."""

    model_config = STRICT
    resolution: Positive | None = Field(
        default=None, description="Cells along the longest parametric range, the paper's rho; default 24."
    )
    spacing: Positive | None = Field(default=None, description="Cell edge, mm, instead of a resolution.")
    spacing_weight: Annotated[Number, Field(gt=0, le=100)] = Field(
        default=0.1, description="The paper's beta: 0.1 follows the stress closely, 1 keeps the spacing even."
    )
    spacing_bounds: tuple[Annotated[Number, Field(gt=0, lt=1)], Annotated[Number, Field(gt=1)]] | None = Field(
        default=None,
        description="Smallest and largest edge of a cell over the median edge, such as [0.5, 2]; held as nearly as the "
        "part allows, the report says where not. Default: no bounds.",
    )
    layers: Literal["clear", "hug"] = Field(
        default="clear",
        description="clear: no layer of members grazes a face of the part; hug: the outermost layers lie along such "
        "faces, with whole cells between them, for which the spacing may change by up to 5 per cent.",
    )
    follow_stress: Switch = Field(
        default=True,
        description="Align the curves themselves with the stress after the paper's Eq. 11; false stops there.",
    )

    @model_validator(mode="after")
    def _one_spacing(self) -> "Options":
        if self.resolution is not None and self.spacing is not None:
            raise ValueError("give resolution or spacing, not both")
        return self


class Setup(BaseModel):
    """Everything of a job but the part's file: for parts that come from Python."""

    model_config = STRICT
    mesh: MeshSection = MeshSection()
    material: MaterialSection = MaterialSection()
    support: tuple[Support, ...] = ()
    load: tuple[Load, ...] = ()
    keep: tuple[Keep, ...] = ()
    cases: CasesSection = CasesSection()
    options: Options = Options()
    knobs: Knobs = Knobs()
    sizing: SizingSection = SizingSection()
    output: OutputSection = OutputSection()

    @model_validator(mode="after")
    def _known_cases(self) -> "Setup":
        named = list(dict.fromkeys(load.case for load in self.load)) or [MAIN_CASE]
        for case in self.cases.weights:
            if case not in named:
                raise ValueError(f"[cases] weights: no load has the case {case!r}; the cases are {', '.join(named)}")
        return self


class Job(Setup):
    """A whole job, as in its file."""

    part: PartSection


# --- reading ---------------------------------------------------------------------------------------------------------


def read_job(path: str | Path) -> Job:
    """Read a job file. The part's path becomes absolute, or relative to where the program runs.

    Raises
    ------
    InvalidInputError
        For a file that is missing or not TOML (with the line), an unknown key (with the nearest known one), or a value
        that is not what its key expects. The message names the file and the key as it stands in the file.
    """
    path = Path(path)
    if not path.is_file():
        raise InvalidInputError(f"{path}: the job file {'is a folder' if path.is_dir() else 'does not exist'}")
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise InvalidInputError(
            f"{path}: not a text file in UTF-8 (byte {error.start}); a job is a TOML file"
        ) from error
    except tomllib.TOMLDecodeError as error:
        raise InvalidInputError(f"{path}: not valid TOML: {error}") from error
    job = parse_job(_with_profile(data, path), str(path))
    return job.model_copy(update={"part": job.part.model_copy(update={"file": str(path.parent / job.part.file)})})


def _with_profile(data: dict[str, Any], path: Path) -> dict[str, Any]:
    """The contents of a job file with the outline in place of the file that the knob `profile` names."""
    knobs = data.get("knobs")
    try:
        return data | {"knobs": with_profile_file(knobs, path.parent)} if isinstance(knobs, dict) else data
    except InvalidInputError as error:
        raise InvalidInputError(f"{path}: [knobs] profile: {error}") from error


def parse_job(data: Mapping[str, Any], name: str = "job") -> Job:
    """Validate the contents of a job file; errors as for `read_job`."""
    try:
        return Job.model_validate(data)
    except ValidationError as error:
        raise InvalidInputError(_explain(error, name, data)) from error


def job_schema() -> dict[str, Any]:
    """Return the JSON Schema of a job file."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | Job.model_json_schema()


def _explain(error: ValidationError, name: str, data: Mapping[str, Any]) -> str:
    """One line for each mistake, each key named as it stands in the file."""
    mistakes: dict[tuple, list[str]] = {}
    for item in error.errors(include_url=False):
        where, owner = _locate(item["loc"])
        kind = item["type"]
        if kind == "extra_forbidden":
            text = suggestion(str(where[-1]), list(owner.model_fields))
        elif kind == "missing" and isinstance(where[-1], int):
            where, text = where[:-1], "has too few entries"
        elif kind == "missing":
            text = "is missing" if where == list(item["loc"]) else "has too few entries"
        elif kind in ("value_error", "assertion_error"):
            text = item["msg"].removeprefix("Value error, ")
        elif kind == "tuple_type" and where in (["support"], ["load"], ["keep"]):
            text = f"write [[{where[0]}]], with two brackets: there may be several"
        else:
            text = expected(item)
        mistakes.setdefault(tuple(where), []).append(text)
    lines = []
    for where, texts in mistakes.items():
        # A union gives one message for each of its alternatives.
        text = either(texts)
        found = f", found {_value_at(data, where)!r}" if "expected" in text and "found" not in text else ""
        place = _spell(where)
        lines.append(f"{name}: {place}{': ' if place else ''}{text}{found}")
    return "\n".join(lines)


def _value_at(data: Any, where: tuple) -> Any:
    for step in where:
        data = data[step]
    return data


def _locate(location: tuple) -> tuple[list, type[BaseModel]]:
    """The part of a pydantic location that stands in the file (without names of union members), and its model."""
    where: list = []
    owner: type[BaseModel] = Job
    for step in location:
        where.append(step)
        if isinstance(step, int):
            continue
        field = owner.model_fields.get(step)
        if field is None:
            break
        inner = [t for t in _members(field.annotation) if isinstance(t, type) and issubclass(t, BaseModel)]
        if not inner:
            index = location[len(where) : len(where) + 1]
            where += [i for i in index if isinstance(i, int)]
            break
        owner = inner[0]
    return where, owner


def _members(annotation: Any) -> list:
    arguments = getattr(annotation, "__args__", None)
    return [annotation] if not arguments else [m for a in arguments for m in _members(a)]


def _spell(where: tuple) -> str:
    """`[[load]] 2: force` for ("load", 1, "force"), `[part] file` for ("part", "file")."""
    if not where:
        return ""
    table, rest = where[0], list(where[1:])
    if rest and isinstance(rest[0], int) and table in ("support", "load", "keep"):
        text = f"[[{table}]] {rest.pop(0) + 1}"
        separator = ": "
    else:
        text, separator = f"[{table}]", " "
    keys = ""
    for step in rest:
        keys += f"[{step + 1}]" if isinstance(step, int) else f"{'.' if keys else ''}{step}"
    return text + (separator + keys if keys else "")


# --- from a job to a problem -----------------------------------------------------------------------------------------


@cache
def named_materials() -> dict[str, Material]:
    """The materials of `materials.toml` by name."""
    table = tomllib.loads(resources.files("michell_cad").joinpath("materials.toml").read_text(encoding="utf-8"))
    return {
        name: Material(
            name,
            values["youngs_modulus"],
            values["poisson_ratio"],
            values["density"] * 1e-3,
            values["yield_strength"],
            values["source"],
        )
        for name, values in table.items()
    }


def choose_material(section: MaterialSection) -> Material:
    """Return the material that a job means: named, by its numbers, or named with some numbers replaced."""
    known = {name.lower(): material for name, material in named_materials().items()}
    numbers = section.model_dump(exclude={"name"}, exclude_none=True)
    if "density" in numbers:
        numbers["density"] *= 1e-3
    wanted = section.name or (DEFAULT_MATERIAL if not numbers else "")
    base = known.get(wanted.lower())
    if base is not None:
        source = f"{base.source}; with {', '.join(numbers)} of the job" if numbers else base.source
        return Material(**{**vars(base), **numbers, "source": source})
    missing = [key for key in ("youngs_modulus", "poisson_ratio", "density", "yield_strength") if key not in numbers]
    if not missing:
        return Material(wanted or "own", **numbers, source="the job")
    if not wanted:
        raise InvalidInputError(f"[material]: without a name all numbers are needed; {', '.join(missing)} missing")
    near = difflib.get_close_matches(wanted, list(named_materials()), n=1, cutoff=0.4)
    hint = f"did you mean {near[0]!r}? " if near else ""
    raise InvalidInputError(
        f"[material] name: unknown material {wanted!r}; {hint}Known: {', '.join(named_materials())}; "
        f"or give its numbers as well ({', '.join(missing)} missing)"
    )


def build_problem(job: Setup, part: Part) -> DesignProblem:
    """Resolve supports and loads of a job on its part; see the module for the rules.

    Raises
    ------
    InvalidInputError
        For a region that matches nothing, no support, no load, or what `DesignProblem` refuses.
    """
    material = choose_material(job.material)
    cases = _load_cases(job, part, material.density)
    return DesignProblem(part.mesh, material, _held(job, part), cases, job.cases.combination)


def require_faces(job: Setup, outline: Outline) -> None:
    """Refuse an unknown material and faces that a part does not have, before time is spent on its mesh.

    Other regions (boxes, spheres, planes) can only be resolved among the triangles of the mesh.

    Raises
    ------
    InvalidInputError
        As `build_problem`.
    """
    choose_material(job.material)
    for kind, regions in (("support", job.support), ("load", job.load)):
        for number, region in enumerate(regions, 1):
            if region.faces is not None:
                _region(outline, region, f"[[{kind}]] {number}")


def _held(job: Setup, part: Part) -> np.ndarray:
    mesh = part.mesh
    if not job.support:
        require(
            part.fixed is not None and part.fixed.any(),
            "no support: give at least one [[support]]"
            + ("" if part.fixed is None else f"; {part.name} itself holds no vertex"),
        )
        return np.repeat(np.asarray(part.fixed)[:, None], 3, axis=1)
    fixed = np.zeros((len(mesh.vertices), 3), bool)
    for number, support in enumerate(job.support, 1):
        with_vertices = np.unique(mesh.boundary_triangles[_region(part, support, f"[[support]] {number}")])
        for axis in support.axes:
            fixed[with_vertices, "xyz".index(axis)] = True
    return fixed


def _load_cases(job: Setup, part: Part, density: float) -> tuple[LoadCase, ...]:
    weights = job.cases.weights
    if not job.load:
        require(part.force is not None, "no load: give at least one [[load]]")
        return (LoadCase(MAIN_CASE, np.asarray(part.force), weights.get(MAIN_CASE, 1.0)),)
    forces: dict[str, np.ndarray] = {}
    for number, load in enumerate(job.load, 1):
        try:
            nodal = _nodal_force(part, load, density, f"[[load]] {number}")
        except InvalidInputError as error:
            place = f"[[load]] {number}"
            raise error if str(error).startswith(place) else InvalidInputError(f"{place}: {error}") from error
        forces[load.case] = forces.get(load.case, 0.0) + nodal
    return tuple(LoadCase(name, force, weights.get(name, 1.0)) for name, force in forces.items())


def _nodal_force(part: Part, load: Load, density: float, place: str) -> np.ndarray:
    mesh = part.mesh
    if load.self_weight is not None:
        return self_weight(mesh, density, np.array(load.self_weight))
    triangles = _region(part, load, place)
    if load.force is not None:
        return surface_force(mesh, triangles, np.array(load.force))
    if load.pressure is not None:
        return surface_pressure(mesh, triangles, load.pressure)
    assert load.torque is not None
    point = np.zeros(3) if load.torque.axis_point is None else np.array(load.torque.axis_point) * part.unit_mm
    return surface_torque(mesh, triangles, load.torque.moment, point, np.array(load.torque.axis))


def _region(part: Part | Outline, region: Region, place: str) -> np.ndarray:
    try:
        return select_triangles(part, region)
    except InvalidInputError as error:
        raise InvalidInputError(f"{place}: {error}") from error
