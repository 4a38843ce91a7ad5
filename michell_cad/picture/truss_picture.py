"""The truss in three colours inside the ghost of its part."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from michell_cad.curves import FAMILIES
from michell_cad.domain.patches import number_patches
from michell_cad.palette import COLOURS
from michell_cad.picture.camera import Camera, place_camera
from michell_cad.picture.canvas import Canvas
from michell_cad.picture.shading import blend, glass_opacity, outline_pixels, shade_solid
from michell_cad.picture.sheet import (
    INK,
    SUPERSAMPLING,
    Colour,
    corner_normals,
    draw_legend_dots,
    open_sheet,
    save_sheet,
    shrink,
    write_legend,
)
from michell_cad.splines import MemberSplines, fit_splines
from michell_cad.tet_mesh import TetMesh
from michell_cad.truss import SizedTruss, member_radius

GHOST: Colour = (0.45, 0.55, 0.66)
"""Colour of the ghost of the part."""

_WORDS = {"feature": "sharp edges", "brace": "braces"}

PIECES = 6
"""Straight pieces in which a member is drawn if it is curved."""

STRAIGHT_PIXELS = 0.6
"""A member that leaves its chord by less is drawn as one piece, pixels of the canvas."""

NODE_RATIO = 1.35
"""Radius of a node over that of its thickest member, in the picture."""

LINE_PIXELS = 1.5
"""Half the width of the part's sharp edges, pixels of the canvas."""

MARGIN = 0.07
"""Blank rim of the picture over its height."""


class ShownMesh(NamedTuple):
    """Something else to draw with the truss, such as sheets: a closed mesh in mm, with its name and colour.

    The legend shows each name once.
    """

    name: str
    colour: Colour
    vertices: Float[np.ndarray, "n 3"]
    triangles: Int[np.ndarray, "t 3"]


def render_truss(
    path: str | Path,
    mesh: TetMesh,
    sized: SizedTruss,
    splines: MemberSplines | None = None,
    *,
    up: int = 2,
    size: tuple[int, int] = (1400, 1000),
    notes: Sequence[str] = (),
    others: Sequence[ShownMesh] = (),
) -> None:
    """Draw a truss in the colours of its families inside the ghost of its part, as a PNG.

    Parameters
    ----------
    path : the PNG to write.
    mesh : the part.
    sized : the truss and its radii.
    splines : its members as curves; default: fitted here.
    up : axis (0, 1, 2) that points up.
    size : width and height, pixels.
    notes : lines for the legend, below the families.
    others : what else to draw.

    Raises
    ------
    InvalidInputError
        If the file cannot be written.
    """
    splines = fit_splines(sized.truss) if splines is None else splines
    width, height = SUPERSAMPLING * size[0], SUPERSAMPLING * size[1]
    margin = MARGIN * height
    surface = mesh.vertices[mesh.boundary_vertices]
    camera = place_camera(surface, (margin, margin, width - margin, height - margin), up)
    bars = Canvas(width, height)
    _draw_members(bars, camera, sized, splines)
    for number, other in enumerate(others, len(FAMILIES)):
        corners = other.vertices[other.triangles]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
        facing = np.repeat(camera.turn(normals)[:, None], 3, axis=1)
        bars.draw_triangles(camera.project(corners), facing, np.full(len(corners), number))
    front, back, lines = _draw_ghost(mesh, camera, width, height)

    palette = np.array([*(COLOURS[name] for name in FAMILIES), *(other.colour for other in others)])
    rgb, covered = shade_solid(bars, palette)
    behind = np.where(covered, 0, glass_opacity(back)).astype(np.float32)
    picture = blend(rgb, np.array(GHOST), 0.7 * behind)
    picture = blend(picture, np.array(GHOST), glass_opacity(front))
    picture = _draw_lines(picture, lines, bars, front)
    curves = sized.truss.curves
    entries = [
        (COLOURS[name], f"{_WORDS.get(name, name)}: {count} curve{'s' if count > 1 else ''}")
        for name in FAMILIES
        if (count := sum(curve.family == name for curve in curves))
    ]
    entries += dict.fromkeys((other.colour, other.name) for other in others)
    entries += [((1.0, 1.0, 1.0), note) for note in notes]
    picture = draw_legend_dots(picture, entries, 28, size[1] - 20)
    image, pen, font = open_sheet(shrink(picture))
    write_legend(pen, font, entries, 28, size[1] - 20)
    save_sheet(image, path)


def _draw_members(canvas: Canvas, camera: Camera, sized: SizedTruss, splines: MemberSplines) -> None:
    truss = sized.truss
    if not len(truss.members):
        return
    tags = np.array([FAMILIES.index(curve.family) for curve in truss.curves])[truss.shape_of_member]
    s = np.linspace(0, 1, PIECES + 1)
    points = camera.project(splines.positions(s))
    radii = member_radius(sized.radii[:, None, :], s) * camera.scale
    chord = points[:, :1] + s[:, None] * (points[:, -1:] - points[:, :1])
    curved = np.abs(points - chord).max((1, 2)) > STRAIGHT_PIXELS
    curved |= np.ptp(radii, axis=1) > STRAIGHT_PIXELS
    starts = [points[~curved, 0], points[curved, :-1].reshape(-1, 3)]
    ends = [points[~curved, -1], points[curved, 1:].reshape(-1, 3)]
    start_radii = [radii[~curved, 0], radii[curved, :-1].ravel()]
    end_radii = [radii[~curved, -1], radii[curved, 1:].ravel()]
    piece_tags = np.concatenate([tags[~curved], np.repeat(tags[curved], PIECES)])
    start, end, start_radius, end_radius = (np.concatenate(pair) for pair in (starts, ends, start_radii, end_radii))
    canvas.draw_tubes(start, end, start_radius, end_radius, piece_tags)
    thickest, family = np.zeros(len(truss.nodes)), np.zeros(len(truss.nodes), int)
    for column, end in ((0, 0), (1, 2)):
        order = np.argsort(sized.radii[:, end], kind="stable")
        node, radius = truss.members[order, column], sized.radii[order, end]
        larger = radius >= thickest[node]
        thickest[node[larger]], family[node[larger]] = radius[larger], tags[order[larger]]
    used = thickest > 0
    canvas.draw_balls(camera.project(truss.nodes[used]), NODE_RATIO * camera.scale * thickest[used], family[used])


def _draw_ghost(mesh: TetMesh, camera: Camera, width: int, height: int) -> tuple[Canvas, Canvas, Canvas]:
    """The sides of the part that face the viewer, those that face away, and its sharp edges."""
    triangles = mesh.boundary_triangles
    corners = camera.project(mesh.vertices[triangles])
    faces = np.asarray(mesh.cad_faces)
    if (faces < 0).any():
        faces = number_patches(mesh.vertices, triangles)
    normals = camera.turn(corner_normals(mesh.vertices, triangles, faces))
    facing = camera.turn(mesh.boundary_area_vectors)[:, 2] > 0
    sheets = []
    for chosen, sign in ((facing, 1.0), (~facing, -1.0)):
        sheet = Canvas(width, height)
        sheet.draw_triangles(corners[chosen], sign * normals[chosen], np.zeros(chosen.sum(), int))
        sheets.append(sheet)
    lines = Canvas(width, height)
    ends = camera.project(mesh.vertices[mesh.feature_edges])
    thin = np.full(len(ends), LINE_PIXELS)
    lines.draw_tubes(ends[:, 0], ends[:, 1], thin, thin, np.zeros(len(ends), int))
    corners_at = camera.project(mesh.vertices[np.unique(mesh.feature_edges)])
    lines.draw_balls(corners_at, np.full(len(corners_at), LINE_PIXELS), np.zeros(len(corners_at), int))
    return sheets[0], sheets[1], lines


def _draw_lines(
    picture: Float[np.ndarray, "h w 3"], lines: Canvas, bars: Canvas, front: Canvas
) -> Float[np.ndarray, "h w 3"]:
    """Sharp edges and the rim of the part: those in front strong, hidden ones faint and never over a member."""
    drawn = lines.image(lines.tag >= 0)
    reach = 4 * LINE_PIXELS
    seen = drawn & (lines.image(lines.depth) >= front.image(front.depth) - reach)
    hidden = drawn & ~seen & (lines.image(lines.depth) >= bars.image(bars.depth))
    rim = outline_pixels(front, 0.02 * min(front.width, front.height))
    opacity = np.where(seen, 0.75, np.where(rim, 0.55, np.where(hidden, 0.22, 0))).astype(np.float32)
    return blend(picture, np.array(INK), opacity)
