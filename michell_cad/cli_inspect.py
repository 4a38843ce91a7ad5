"""What `michell-cad faces`, `check` and `schema` show: tables for the terminal and pictures, nothing computed.

Source: none. Both commands work on the outline of the part (its surface), which takes a second or two; only tet files
have their mesh already. What would be meshed is a forecast.
"""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float
from rich.console import Console
from rich.table import Table

from michell_cad.arrays import require
from michell_cad.domain import Outline, forecast_tets, read_outline
from michell_cad.domain.refine import refine_surface
from michell_cad.domain.tet_meshing import check_mesh_size
from michell_cad.edits import script_schema
from michell_cad.errors import InvalidInputError
from michell_cad.job import MAIN_CASE, Job, Load, choose_material, job_schema, read_job
from michell_cad.picture import Arrow, face_colours, render_part
from michell_cad.problem import GRAVITY
from michell_cad.selection import select_triangles, suggest_selectors

FREE, HELD, LOADED, BOTH = range(4)
_PALETTE = np.array([(0.86, 0.87, 0.88), (0.25, 0.52, 0.80), (0.86, 0.36, 0.33), (0.62, 0.40, 0.68)])
_RED = (0.80, 0.13, 0.12)

VERTICES_PER_AREA = 1.15
"""Vertices of equilateral triangles over their area, in units of 1 / edge^2: 2 / sqrt(3)."""

MOST_ROWS = 200
"""Faces that the table lists at most; the picture has them all."""


def show_faces(part: Path, units: str | None, out: Path | None, console: Console) -> Path:
    """Number the faces of a part in a table with selectors and in a picture.

    The picture is `out`, or PART_faces.png in the folder where the program runs; its path returns.
    """
    outline = read_outline(part, units)
    unit = outline.unit_mm
    size = np.ptp(outline.surface.vertices, axis=0) / unit
    console.print(
        f"[bold]{outline.name}[/bold]: {len(outline.faces)} faces, {outline.volume:.6g} mm3, "
        f"{size[0]:.4g} x {size[1]:.4g} x {size[2]:.4g} in the units of the file"
    )
    table = Table(box=None, header_style="bold", pad_edge=False)
    for title in ("no.", "type", "area mm2", "centre", "normal or axis", "radius"):
        table.add_column(title, justify="right" if title in ("no.", "area mm2", "radius") else "left", no_wrap=True)
    table.add_column("faces = ", overflow="fold")
    for face, selector in list(zip(outline.faces, suggest_selectors(outline), strict=True))[:MOST_ROWS]:
        table.add_row(
            str(face.number),
            face.kind,
            f"{face.area:.5g}",
            _vector(np.array(face.centre) / unit),
            "" if face.direction is None else _vector(np.array(face.direction)),
            "" if face.radius is None else f"{face.radius / unit:.4g}",
            json.dumps(selector),
            style=None,
        )
    console.print(table, markup=False)
    if len(outline.faces) > MOST_ROWS:
        console.print(f"... and {len(outline.faces) - MOST_ROWS} more")
    path = out or Path(f"{Path(part).stem}_faces.png")
    render_part(
        path,
        outline.surface,
        np.asarray(outline.surface.face_numbers),
        face_colours(len(outline.faces)),
        labels={face.number: str(face.number) for face in outline.faces},
        up=outline.up,
    )
    console.print(f"picture: {path}", markup=False, highlight=False)
    return path


@dataclass(frozen=True)
class Resultant:
    """Net force (N) of a load, its moment (N mm) about the origin of the file, and where it acts (mm)."""

    force: Float[np.ndarray, " 3"]
    moment: Float[np.ndarray, " 3"]
    point: Float[np.ndarray, " 3"]


def load_resultant(outline: Outline, load: Load, density: float) -> Resultant:
    """Resultant of a load of a job on the true surface of the part (density in g/mm^3)."""
    surface = outline.surface
    if load.self_weight is not None:
        direction = np.array(load.self_weight) / np.linalg.norm(load.self_weight)
        # Centre of volume by the divergence theorem: the integral of x_i^2 n_i / 2 over the surface.
        corners = surface.vertices[surface.triangles]
        pairs = corners + np.roll(corners, 1, axis=1)
        centre = (surface.area_vectors * (pairs**2).sum(1) / 24).sum(0) / surface.volume
        force = outline.volume * density * 1e-3 * GRAVITY * direction
        return Resultant(force, np.cross(centre, force), centre)
    triangles = select_triangles(outline, load)
    areas, centroids = surface.areas[triangles], surface.centroids[triangles]
    centre = areas @ centroids / areas.sum()
    if load.force is not None:
        force = np.array(load.force)
        return Resultant(force, np.cross(centre, force), centre)
    if load.pressure is not None:
        forces = -load.pressure * surface.area_vectors[triangles]
        return Resultant(forces.sum(0), np.cross(centroids, forces).sum(0), centre)
    assert load.torque is not None
    axis = np.array(load.torque.axis) / np.linalg.norm(load.torque.axis)
    return Resultant(np.zeros(3), load.torque.moment * axis, centre)


def check_job(job: Path, out: Path | None, console: Console) -> Path:
    """Say what a job would hold, load and mesh, with a picture (default: JOB_check.png); return the picture's path.

    Raises
    ------
    InvalidInputError
        For the mistakes that can be found without meshing; the message names the file and the key.
    """
    content = read_job(job)
    outline = read_outline(content.part.file, content.part.units)
    material = choose_material(content.material)
    console.print(f"[bold]{outline.name}[/bold]: {len(outline.faces)} faces, {outline.volume:.6g} mm3")
    console.print(
        f"material {material.name}: E {material.youngs_modulus:g} MPa, nu {material.poisson_ratio:g}, "
        f"{1e3 * material.density:g} g/cm3, yield {material.yield_strength:g} MPa; the solid part weighs "
        f"{outline.volume * material.density:.4g} g",
        markup=False,
    )
    size = _show_mesh(outline, content, console)
    if outline.mesh is None:
        # Regions choose whole triangles; those of a flat face are as large as the face.
        outline = replace(outline, surface=refine_surface(outline.surface, size))
    tags = np.zeros(len(outline.surface.triangles), int)
    held = _show_supports(outline, content, size, console)
    loaded, arrows, cases = _show_loads(outline, content, material.density, console)
    tags[held] = HELD
    tags[loaded & ~held] = LOADED
    tags[loaded & held] = BOTH
    names = {HELD: "held", LOADED: "loaded", BOTH: "held and loaded"}
    legend = [(tuple(_PALETTE[tag].tolist()), text) for tag, text in names.items() if (tags == tag).any()]
    legend += [(_RED, f"{name}: {_vector(total.force)} N") for name, total in cases.items()]
    path = out or Path(f"{Path(job).stem}_check.png")
    render_part(path, outline.surface, tags, _PALETTE, arrows=arrows, legend=legend, up=outline.up)
    console.print(f"picture: {path}", markup=False, highlight=False)
    return path


def show_schema(what: str, console: Console) -> None:
    """Print the JSON Schema of a job file or of an edit script."""
    console.print_json(json.dumps(job_schema() if what == "job" else script_schema()))


def _show_mesh(outline: Outline, job: Job, console: Console) -> float:
    if outline.mesh is not None:
        mesh = outline.mesh
        console.print(
            f"mesh: {len(mesh.vertices):,} vertices and {len(mesh.tets):,} tets of {mesh.median_edge:.3g} mm, "
            "from the file"
        )
        return mesh.median_edge
    size = check_mesh_size(outline, job.mesh.size)
    origin = "of the job" if job.mesh.size is not None else "chosen from the part"
    console.print(f"mesh: about {forecast_tets(outline.volume, size):,} tets of {size:.3g} mm ({origin})")
    return size


def _show_supports(outline: Outline, job: Job, size: float, console: Console) -> np.ndarray:
    surface = outline.surface
    held = np.zeros(len(surface.triangles), bool)
    if not job.support:
        require(outline.fixed is not None and outline.fixed.any(), "no support: give at least one [[support]]")
        assert outline.fixed is not None
        held = np.all(outline.fixed[surface.triangles], axis=1)
        console.print(f"held: {outline.fixed.sum():,} vertices, as the file says")
        return held
    for number, support in enumerate(job.support, 1):
        chosen = _select(outline, support, f"[[support]] {number}")
        held[chosen] = True
        area = surface.areas[chosen].sum()
        if outline.mesh is not None:
            vertices = f"{len(np.unique(surface.triangles[chosen])):,} vertices"
        else:
            vertices = f"about {max(round(VERTICES_PER_AREA * area / size**2), 3):,} vertices"
        console.print(
            f"held along {support.axes}: {support.described} -> {_faces(outline, chosen)}, {area:.5g} mm2, {vertices}",
            markup=False,
        )
    return held


def _show_loads(
    outline: Outline, job: Job, density: float, console: Console
) -> tuple[np.ndarray, list[Arrow], dict[str, Resultant]]:
    """Which triangles are loaded, the arrows to draw, and the resultant of each case."""
    surface = outline.surface
    loaded = np.zeros(len(surface.triangles), bool)
    arrows: list[Arrow] = []
    if not job.load:
        require(outline.force is not None and np.any(outline.force), "no load: give at least one [[load]]")
        assert outline.force is not None
        force, x = outline.force, surface.vertices
        pushed = (force != 0).any(1)
        total = Resultant(force.sum(0), np.cross(x, force).sum(0), x[pushed].mean(0))
        console.print(f"loaded: {pushed.sum():,} vertices, as the file says; {_spell(total)}", markup=False)
        on_surface = np.all(pushed[surface.triangles], axis=1)
        return on_surface, _arrows(surface, np.flatnonzero(on_surface), total), {MAIN_CASE: total}
    cases: dict[str, Resultant] = {}
    for number, load in enumerate(job.load, 1):
        where, chosen = "the whole part", np.zeros(0, int)
        if load.self_weight is None:
            chosen = _select(outline, load, f"[[load]] {number}")
            where = f"{load.described} -> {_faces(outline, chosen)}, {surface.areas[chosen].sum():.5g} mm2"
            loaded[chosen] = True
        result = load_resultant(outline, load, density)
        console.print(f"loaded: {where}: {_spell(result)}", markup=False)
        arrows += _arrows(surface, chosen, result)
        old = cases.get(load.case)
        cases[load.case] = (
            result if old is None else Resultant(old.force + result.force, old.moment + result.moment, old.point)
        )
    for name, total in cases.items():
        weight = job.cases.weights.get(name, 1.0)
        console.print(f"load case {name} (weight {weight:g}): {_spell(total)}", markup=False)
    return loaded, arrows, cases


def _select(outline: Outline, region, place: str) -> np.ndarray:
    try:
        return select_triangles(outline, region)
    except InvalidInputError as error:
        raise InvalidInputError(f"{place}: {error}") from error


def _arrows(surface, triangles: np.ndarray, result: Resultant) -> list[Arrow]:
    """An arrow for the force, or a double-headed one for a couple; it ends at a face that it pushes."""
    force, moment = result.force, result.moment
    scale = np.abs(moment).max() / surface.diagonal
    point = tuple(result.point.tolist())
    if np.linalg.norm(force) > 1e-6 * scale:
        inward = bool(surface.area_vectors[triangles].sum(0) @ force < 0)
        return [Arrow(point, tuple(force.tolist()), _RED, inward)]
    return [Arrow(point, tuple(moment.tolist()), _RED, double=True)]


def _faces(outline: Outline, triangles: np.ndarray) -> str:
    numbers = np.unique(outline.surface.face_numbers[triangles])
    listed = ", ".join(map(str, numbers[:12])) + (", ..." if len(numbers) > 12 else "")
    return f"face{'s' if len(numbers) > 1 else ''} {listed}"


def _spell(result: Resultant) -> str:
    return f"force {_vector(result.force)} N, moment about the origin {_vector(result.moment)} N mm"


def _vector(values: np.ndarray) -> str:
    """Three numbers, with 0 for what is zero up to rounding."""
    scale = max(float(np.abs(values).max()), 1e-300)
    return "(" + ", ".join(f"{0.0 if abs(v) < 1e-9 * max(scale, 1) else v:.4g}" for v in values) + ")"
