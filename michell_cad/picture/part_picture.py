"""A part from both sides, its faces in colours, with labels and arrows."""

import colorsys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from scipy import ndimage

from michell_cad.domain.outline import Surface
from michell_cad.picture.camera import Camera, place_camera
from michell_cad.picture.canvas import Canvas
from michell_cad.picture.shading import blend, outline_pixels, shade_solid
from michell_cad.picture.sheet import (
    INK,
    SUPERSAMPLING,
    Colour,
    corner_normals,
    draw_legend_dots,
    open_sheet,
    save_sheet,
    shrink,
    to_bytes,
    write_legend,
)

MARGIN = 0.04
"""Blank rim of each view over the height of the picture."""

ARROW_LENGTH, ARROW_RADIUS, HEAD_LENGTH, HEAD_RADIUS = 0.22, 0.006, 0.06, 0.018
"""Sizes of an arrow over the diagonal of the part."""

SMALLEST_LABEL = 9
"""A label is written where a disc of this radius fits on its face, pixels."""

EDGE_PIXELS = 1.2
"""Half the width of the lines between differently tagged triangles, pixels of the canvas."""

SOFT_LIGHT = 0.55
"""Share of light from everywhere: colours must be told apart on the dark sides, too."""

SHARP_COSINE = 0.9
"""A line is also drawn where the normals of two triangles differ by more (about 25 degrees)."""


@dataclass(frozen=True)
class Arrow:
    """An arrow beside the part.

    Parameters
    ----------
    point : where it acts, mm.
    direction : where it points; its length does not matter.
    colour : red, green and blue, 0 to 1.
    inward : the arrow ends at `point` instead of beginning there.
    double : a second head, as engineers draw moments.
    """

    point: tuple[float, float, float]
    direction: tuple[float, float, float]
    colour: Colour
    inward: bool = False
    double: bool = False


def face_colours(count: int) -> Float[np.ndarray, "k 3"]:
    """Light colours that tell neighbours apart: hues by the golden ratio, in three brightnesses."""
    return np.array(
        [colorsys.hls_to_rgb((0.58 + 0.618034 * k) % 1.0, 0.66 + 0.09 * (k % 3), 0.62) for k in range(count)]
    ).reshape(-1, 3)


def render_part(
    path: str | Path,
    surface: Surface,
    tags: Int[np.ndarray, " n_b"],
    palette: Float[np.ndarray, "k 3"],
    *,
    labels: Mapping[int, str] | None = None,
    arrows: Sequence[Arrow] = (),
    legend: Sequence[tuple[Colour, str]] = (),
    up: int = 2,
    size: tuple[int, int] = (1400, 1000),
) -> None:
    """Draw a part from the front and above and, beside it, from behind and below, as a PNG.

    Parameters
    ----------
    path : the PNG to write.
    surface : the part.
    tags : kind of each triangle, a row of `palette`.
    labels : text for tags, written on each where it is seen.
    arrows : drawn before everything else.
    legend : lines at the lower left.
    up : axis (0, 1, 2) that points up.
    """
    tips = _arrow_ends(arrows, surface.diagonal).reshape(-1, 3)
    points = np.concatenate([surface.vertices, tips])
    height_of_legend = 36 * len(legend) + (24 if legend else 0)
    views = _best_views(points, size, height_of_legend, up)
    picture = np.ones((SUPERSAMPLING * size[1], SUPERSAMPLING * size[0], 3), np.float32)
    written: list[tuple[float, float, str]] = []
    for camera in views:
        canvas = Canvas(SUPERSAMPLING * size[0], SUPERSAMPLING * size[1])
        _draw_part(canvas, camera, surface, tags)
        rgb, covered = shade_solid(canvas, palette, fog=0.1, ambient=SOFT_LIGHT, specular=0.05)
        picture = np.where(covered[:, :, None], rgb, picture)
        rim = outline_pixels(canvas, 0.02 * min(canvas.width, canvas.height))
        lines = _draw_edges(camera, surface, tags, canvas)
        picture = blend(picture, np.array(INK), np.where(lines, 0.7, 0.6 * rim).astype(np.float32))
        picture = _draw_arrows(picture, camera, arrows, surface.diagonal)
        written += _place_labels(canvas, labels or {})
    picture = draw_legend_dots(picture, legend, 28, size[1] - 20)
    image, pen, font = open_sheet(shrink(picture))
    for x, y, text in written:
        left, top, right, bottom = pen.textbbox((x, y), text, font=font, anchor="mm")
        pen.rounded_rectangle((left - 5, top - 4, right + 5, bottom + 4), radius=7, fill=(255, 255, 255))
        pen.text((x, y), text, fill=to_bytes(INK), font=font, anchor="mm")
    write_legend(pen, font, legend, 28, size[1] - 20)
    save_sheet(image, path)


def _best_views(points: np.ndarray, size: tuple[int, int], legend: int, up: int) -> list[Camera]:
    """Two views side by side or one above the other, whichever shows the part larger; both at one scale."""
    w, h = (SUPERSAMPLING * value for value in size)
    h -= SUPERSAMPLING * legend
    m = MARGIN * SUPERSAMPLING * size[1]
    beside = ((m, m, w / 2 - m, h - m), (w / 2 + m, m, w - m, h - m))
    stacked = ((m, m, w - m, h / 2 - m), (m, h / 2 + m, w - m, h - m))
    pairs = [
        [place_camera(points, f, up, behind) for f, behind in zip(fs, (False, True), strict=True)]
        for fs in (beside, stacked)
    ]
    pair = max(pairs, key=lambda cameras: min(camera.scale for camera in cameras))
    scale = min(camera.scale for camera in pair)
    return [Camera(camera.axes, scale, camera.centre, camera.middle) for camera in pair]


def _draw_part(canvas: Canvas, camera: Camera, surface: Surface, tags: np.ndarray) -> None:
    normals = camera.turn(corner_normals(surface.vertices, surface.triangles, surface.face_numbers))
    facing = camera.turn(surface.area_vectors)[:, 2] > 0
    corners = camera.project(surface.vertices[surface.triangles[facing]])
    canvas.draw_triangles(corners, normals[facing], tags[facing])


def _draw_edges(camera: Camera, surface: Surface, tags: np.ndarray, canvas: Canvas) -> np.ndarray:
    """Visible lines between faces that meet sharply and between differently tagged triangles."""
    F = surface.triangles
    sides = np.sort(F[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    order = np.lexsort((sides[:, 1], sides[:, 0]))
    a, b = order[::2], order[1::2]
    unit = surface.area_vectors / np.maximum(surface.areas, np.finfo(float).tiny)[:, None]
    sharp = np.einsum("ed,ed->e", unit[a // 3], unit[b // 3]) < SHARP_COSINE
    chosen = sides[a][sharp | (tags[a // 3] != tags[b // 3])]
    ends = camera.project(surface.vertices[chosen])
    lines = Canvas(canvas.width, canvas.height)
    thin = np.full(len(ends), EDGE_PIXELS)
    lines.draw_tubes(ends[:, 0], ends[:, 1], thin, thin, np.zeros(len(ends), int))
    visible = (lines.tag >= 0) & (lines.depth >= canvas.depth - 4 * EDGE_PIXELS)
    return canvas.image(visible)


def _arrow_ends(arrows: Sequence[Arrow], diagonal: float) -> Float[np.ndarray, "n 2 3"]:
    """Tail and tip of every arrow, mm."""
    ends = np.zeros((len(arrows), 2, 3))
    for k, arrow in enumerate(arrows):
        step = np.array(arrow.direction) / np.linalg.norm(arrow.direction) * ARROW_LENGTH * diagonal
        point = np.array(arrow.point)
        ends[k] = (point - step, point) if arrow.inward else (point, point + step)
    return ends


def _draw_arrows(picture: np.ndarray, camera: Camera, arrows: Sequence[Arrow], diagonal: float) -> np.ndarray:
    if not arrows:
        return picture
    canvas = Canvas(picture.shape[1], picture.shape[0])
    unit = camera.scale * diagonal
    for number, (tail, tip) in enumerate(_arrow_ends(arrows, diagonal)):
        back = (tip - tail) / np.linalg.norm(tip - tail) * HEAD_LENGTH * diagonal
        heads = [(tip - back, tip)] + ([(tip - 1.8 * back, tip - 0.8 * back)] if arrows[number].double else [])
        starts = camera.project(np.array([tail, *(head[0] for head in heads)]))
        ends = camera.project(np.array([tip - back, *(head[1] for head in heads)]))
        r0 = unit * np.array([ARROW_RADIUS] + [HEAD_RADIUS] * len(heads))
        r1 = unit * np.array([ARROW_RADIUS] + [0.0] * len(heads))
        canvas.draw_tubes(starts, ends, r0, r1, np.full(len(starts), number))
        canvas.draw_balls(starts[:1], r0[:1] * 1.8, np.full(1, number))
    rgb, covered = shade_solid(canvas, np.array([arrow.colour for arrow in arrows]), fog=0.0, unsharp=0.0)
    return np.where(covered[:, :, None], rgb, picture)


def _place_labels(canvas: Canvas, labels: Mapping[int, str]) -> list[tuple[float, float, str]]:
    """Where each label fits best on what is seen of its tag (picture pixels)."""
    image = canvas.image(canvas.tag)
    boxes = ndimage.find_objects(image + 1)
    placed = []
    for tag, text in labels.items():
        box = boxes[tag] if tag < len(boxes) else None
        if box is None:
            continue
        inside = np.pad(image[box] == tag, 1)
        depth = np.asarray(ndimage.distance_transform_edt(inside))
        row, column = np.unravel_index(int(np.argmax(depth)), inside.shape)
        if depth[row, column] >= SMALLEST_LABEL * SUPERSAMPLING:
            y, x = box[0].start + row - 1, box[1].start + column - 1
            placed.append((float(x) / SUPERSAMPLING, float(y) / SUPERSAMPLING, text))
    return placed
