"""Stress in colours, on the surface of a solid or along the members of a truss, with a bar that tells the values."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from michell_cad.picture.camera import Camera, place_camera
from michell_cad.picture.canvas import Canvas
from michell_cad.picture.shading import shade_solid
from michell_cad.picture.sheet import INK, SUPERSAMPLING, corner_normals, open_sheet, save_sheet, shrink, to_bytes

LEVELS = 128
"""Colours of the scale."""

ANCHORS = ("313695", "4575b4", "74add1", "abd9e9", "e0f3f8", "ffffbf", "fee090", "fdae61", "f46d43", "d73027", "a50026")
"""From no stress to the top of the scale: C. Brewer's RdYlBu, turned round; safe for the colour-blind
(https://colorbrewer2.org)."""

SUB_TRIANGLES = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])
"""A face of six nodes (corners, then the middles of the edges 01, 12, 20) in four triangles."""

MARGIN, BAR_ROOM, BAR_WIDTH = 40, 170, 26
"""Blank rim, room for the bar at the right, and its width, pixels of the picture."""

TICKS = 5
"""Numbers beside the bar, about."""

FLAT = {"fog": 0.12, "unsharp": 3.0, "ambient": 0.62, "specular": 0.04}
"""Light that changes the colours little, since they are read."""


def render_solid_stress(
    path: str | Path,
    nodes: Float[np.ndarray, "n_p 3"],
    faces: Int[np.ndarray, "n_b 6"],
    stress: Float[np.ndarray, " n_p"],
    top: float,
    *,
    notes: Sequence[str] = (),
    up: int = 2,
    size: tuple[int, int] = (1400, 1000),
) -> None:
    """Draw the stress at the nodes of quadratic triangles, as a PNG.

    Parameters
    ----------
    path : the PNG to write.
    nodes, faces : of a closed surface: three corners, counter-clockwise from outside, and the nodes on their edges.
    stress : MPa.
    top : of the scale, MPa; larger stresses have its colour.
    notes : lines above the bar.
    up : axis (0, 1, 2) that points up.
    size : width and height, pixels.

    Raises
    ------
    InvalidInputError
        If the file cannot be written.
    """
    triangles = faces[:, SUB_TRIANGLES].reshape(-1, 3)
    canvas, camera = _canvas(nodes[np.unique(triangles)], up, size)
    normals = camera.turn(corner_normals(nodes, triangles, np.zeros(len(triangles), int)))
    front = (normals[:, :, 2] > 0).any(1)
    level = _levels(stress[triangles[front]].mean(1), top)
    canvas.draw_triangles(camera.project(nodes[triangles[front]]), normals[front], level)
    _save(path, canvas, top, notes, size)


class StressedBalls(NamedTuple):
    """Balls at the nodes of a truss: centres and radii, mm, and their stress, MPa."""

    centres: Float[np.ndarray, "n 3"]
    radii: Float[np.ndarray, " n"]
    stress: Float[np.ndarray, " n"]


def render_member_stress(
    path: str | Path,
    points: Float[np.ndarray, "n k 3"],
    radii: Float[np.ndarray, "n k"],
    stress: Float[np.ndarray, "n k"],
    balls: StressedBalls,
    top: float,
    *,
    notes: Sequence[str] = (),
    up: int = 2,
    size: tuple[int, int] = (1400, 1000),
) -> None:
    """Draw the stress along members known by their sections, and that of their nodes, as a PNG.

    Parameters
    ----------
    path : the PNG to write.
    points, radii : centres and radii of the sections of each member, mm.
    stress : at the sections, MPa.
    balls : at the nodes.
    top, notes, up, size : as for `render_solid_stress`.

    Raises
    ------
    InvalidInputError
        If the file cannot be written.
    """
    canvas, camera = _canvas(points.reshape(-1, 3), up, size)
    seen, r = camera.project(points), camera.scale * radii
    level = _levels((stress[:, :-1] + stress[:, 1:]).ravel() / 2, top)
    canvas.draw_tubes(
        seen[:, :-1].reshape(-1, 3), seen[:, 1:].reshape(-1, 3), r[:, :-1].ravel(), r[:, 1:].ravel(), level
    )
    canvas.draw_balls(camera.project(balls.centres), camera.scale * balls.radii, _levels(balls.stress, top))
    _save(path, canvas, top, notes, size)


def stress_colours() -> Float[np.ndarray, "k 3"]:
    """Colours of the scale, from no stress to its top, 0 to 1."""
    anchors = np.array([[int(text[k : k + 2], 16) for k in (0, 2, 4)] for text in ANCHORS]) / 255
    at = np.linspace(0, len(anchors) - 1, LEVELS)
    return np.stack([np.interp(at, np.arange(len(anchors)), column) for column in anchors.T], axis=1)


def _levels(stress: np.ndarray, top: float) -> np.ndarray:
    return np.clip(stress / top * LEVELS, 0, LEVELS - 1).astype(int)


def _canvas(points: np.ndarray, up: int, size: tuple[int, int]) -> tuple[Canvas, Camera]:
    width, height = (SUPERSAMPLING * value for value in size)
    margin, room = SUPERSAMPLING * MARGIN, SUPERSAMPLING * BAR_ROOM
    return Canvas(width, height), place_camera(points, (margin, margin, width - room, height - margin), up)


def _save(path: str | Path, canvas: Canvas, top: float, notes: Sequence[str], size: tuple[int, int]) -> None:
    """Shade what is drawn, add the bar and the notes, and write the file."""
    colours = stress_colours()
    rgb, _ = shade_solid(canvas, colours, **FLAT)
    image, pen, font = open_sheet(shrink(rgb))
    ink = to_bytes(INK)
    left, low, high = size[0] - BAR_ROOM + MARGIN, size[1] - 3 * MARGIN, 5 * MARGIN
    for k, colour in enumerate(colours.tolist()):
        y = [low + (high - low) * j / LEVELS for j in (k + 1, k)]
        pen.rectangle((left, y[0], left + BAR_WIDTH, y[1]), fill=to_bytes(tuple(colour)))
    for value in tick_values(top):
        y = low + (high - low) * value / top
        pen.line((left + BAR_WIDTH, y, left + BAR_WIDTH + 6, y), fill=ink, width=2)
        pen.text((left + BAR_WIDTH + 12, y), f"{value:g}", fill=ink, font=font, anchor="lm")
    pen.text((size[0] - MARGIN, high - 40), "von Mises, MPa", fill=ink, font=font, anchor="rm")
    for row, note in enumerate(notes):
        pen.text((MARGIN, size[1] - MARGIN - 30 * (len(notes) - 1 - row)), note, fill=ink, font=font, anchor="lm")
    save_sheet(image, path)


def tick_values(top: float) -> list[float]:
    """Round numbers from 0 to at most the top: steps of 1, 2 or 5 times a power of ten."""
    least = top / TICKS
    power = 10.0 ** np.floor(np.log10(least))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= least * (1 - 1e-9))
    return [float(f"{k * step:.12g}") for k in range(int(np.floor(top / step * (1 + 1e-9))) + 1)]
