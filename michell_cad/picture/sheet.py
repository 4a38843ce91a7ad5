"""The sheet of paper: supersampled drawing, smaller copies, text, saving."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from michell_cad.errors import InvalidInputError

SUPERSAMPLING = 2
"""Canvas pixels per picture pixel and axis; their mean smooths the edges."""

INK = (0.16, 0.18, 0.21)
"""Colour of text and lines."""

FONT_SIZE, LINE, DOT = 22, 33, 8
"""Sizes of the text, of its lines and of the legend's dots, pixels."""

Colour = tuple[float, float, float]


def corner_normals(
    vertices: Float[np.ndarray, "n_v 3"], triangles: Int[np.ndarray, "n_b 3"], faces: Int[np.ndarray, " n_b"]
) -> Float[np.ndarray, "n_b 3 3"]:
    """Normals at the corners of triangles, averaged over the triangles of the same face around each vertex."""
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    area_vectors = np.cross(b - a, c - a)
    key = triangles * (faces.max() + 2) + (faces[:, None] + 1)
    unique, inverse = np.unique(key, return_inverse=True)
    summed = np.zeros((len(unique), 3))
    np.add.at(summed, inverse.reshape(-1), np.repeat(area_vectors, 3, axis=0))
    summed /= np.maximum(np.linalg.norm(summed, axis=1, keepdims=True), np.finfo(float).tiny)
    return summed[inverse.reshape(-1)].reshape(-1, 3, 3)


def shrink(picture: Float[np.ndarray, "h w 3"]) -> np.ndarray:
    """Average the supersampled picture and return it in bytes."""
    h, w = picture.shape[0] // SUPERSAMPLING, picture.shape[1] // SUPERSAMPLING
    mean = picture.reshape(h, SUPERSAMPLING, w, SUPERSAMPLING, 3).mean((1, 3))
    return (mean.clip(0, 1) * 255 + 0.5).astype(np.uint8)


def open_sheet(picture: np.ndarray):
    """A pillow image of a picture, a pen and the font."""
    from PIL import Image, ImageDraw, ImageFont

    image = Image.fromarray(picture)
    return image, ImageDraw.Draw(image), ImageFont.load_default(FONT_SIZE)


def save_sheet(image, path: str | Path) -> None:
    """Write a PNG; it appears under its name only when it is complete."""
    path = Path(path)
    part = path.with_name(f".{path.name}.part")
    try:
        image.save(part, format="PNG")
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise InvalidInputError(f"{path}: the picture cannot be written ({error.strerror or error})") from error


def draw_legend_dots(
    picture: Float[np.ndarray, "h w 3"], entries: Sequence[tuple[Colour, str]], left: int, bottom: int
) -> Float[np.ndarray, "h w 3"]:
    """Draw the coloured dots of a legend on the supersampled picture, which smooths them."""
    picture = picture.copy()
    rows, columns = np.ogrid[: picture.shape[0], : picture.shape[1]]
    for row, (colour, _) in enumerate(entries):
        x, y = SUPERSAMPLING * (left + DOT), SUPERSAMPLING * _legend_row(row, len(entries), bottom)
        top, end = int(y - 40), int(y + 40)
        disc = np.hypot(columns - x, rows[top:end] - y) < SUPERSAMPLING * DOT
        picture[top:end][disc] = colour
    return picture


def write_legend(pen, font, entries: Sequence[tuple[Colour, str]], left: int, bottom: int) -> None:
    """Write the lines of a legend beside their dots, the last one ending at `bottom`."""
    for row, (_, text) in enumerate(entries):
        y = _legend_row(row, len(entries), bottom)
        pen.text((left + 3 * DOT, y), text, fill=to_bytes(INK), font=font, anchor="lm")


def _legend_row(row: int, rows: int, bottom: int) -> int:
    return bottom - LINE * (rows - row) + LINE // 2


def to_bytes(colour: Colour) -> tuple[int, int, int]:
    """A colour of 0 to 1 in bytes."""
    r, g, b = (int(255 * value + 0.5) for value in colour)
    return r, g, b
