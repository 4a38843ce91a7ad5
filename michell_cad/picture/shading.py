"""From the buffers of a canvas to colours: light, depth cues, glass, lines.

Sources: diffuse and specular light after Phong; darkening of what lies behind its surroundings by an unsharp mask of
the depth buffer (Luft, Colditz and Deussen 2006, doi:10.1145/1141911.1142016), which tells near members from far ones.
"""

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from michell_cad.picture.canvas import Canvas

LIGHT = np.array([-0.45, 0.65, 0.62]) / np.linalg.norm([-0.45, 0.65, 0.62])
"""Direction to the lamp: left, above and before the part."""

AMBIENT, FULL, SPECULAR, GLOSS = 0.42, 1.04, 0.16, 24
"""Light from everywhere, all light on a surface that faces the lamp, the highlight and its exponent."""

FOG = 0.38
"""How much of the colour of the farthest point goes over to white."""

UNSHARP_WIDTH, UNSHARP_STRENGTH, UNSHARP_LIMIT = 12.0, 5.0, 0.42
"""Width of the depth blur (canvas pixels), darkening for a depth difference of the part's size, and its limit."""

GLASS_FACE, GLASS_RIM = 0.10, 0.34
"""Opacity of glass seen straight on, and what comes on top at grazing angles."""


def shade_solid(
    canvas: Canvas,
    palette: Float[np.ndarray, "k 3"],
    fog: float = FOG,
    unsharp: float = UNSHARP_STRENGTH,
    ambient: float = AMBIENT,
    specular: float = SPECULAR,
) -> tuple[Float[np.ndarray, "h w 3"], Bool[np.ndarray, "h w"]]:
    """Colours of the opaque things of a canvas (`palette` row of each tag, 0 to 1), and where there are any."""
    covered = canvas.tag >= 0
    rgb = np.ones((canvas.width * canvas.height, 3), np.float32)
    at = np.flatnonzero(covered)
    if len(at):
        depth = canvas.depth[at]
        reach = max(float(np.ptp(depth)), 1e-6)
        normal = canvas.normal[at]
        light = np.maximum(normal @ LIGHT.astype(np.float32), 0)
        half = LIGHT + np.array([0.0, 0.0, 1.0])
        gleam = np.maximum(normal @ (half / np.linalg.norm(half)).astype(np.float32), 0) ** GLOSS
        shadow = _behind_surroundings(canvas, covered)[at] * (unsharp / reach)
        strength = (ambient + (FULL - ambient) * light) * (1 - shadow.clip(0, UNSHARP_LIMIT))
        colour = palette.astype(np.float32)[canvas.tag[at]] * strength[:, None] + specular * gleam[:, None]
        mist = (fog * (depth.max() - depth) / reach)[:, None]
        rgb[at] = colour.clip(0, 1) * (1 - mist) + mist
    return canvas.image(rgb), canvas.image(covered)


def _behind_surroundings(canvas: Canvas, covered: np.ndarray) -> np.ndarray:
    """How far each pixel lies behind the mean depth of the pixels around it; the background does not count."""
    depth = np.where(covered, canvas.depth, 0).astype(np.float32)
    blurred = ndimage.uniform_filter(canvas.image(depth), int(2 * UNSHARP_WIDTH) + 1)
    weight = ndimage.uniform_filter(canvas.image(covered.astype(np.float32)), int(2 * UNSHARP_WIDTH) + 1)
    return (blurred / np.maximum(weight, 1e-6)).ravel() - depth


def glass_opacity(canvas: Canvas) -> Float[np.ndarray, "h w"]:
    """Opacity of the nearest sheet of a canvas drawn as glass: more towards its rim."""
    facing = canvas.normal[:, 2].clip(0, 1)
    opacity = np.where(canvas.tag >= 0, GLASS_FACE + GLASS_RIM * (1 - facing) ** 3, 0)
    return canvas.image(opacity.astype(np.float32))


def outline_pixels(canvas: Canvas, jump: float) -> Bool[np.ndarray, "h w"]:
    """Pixels on the rim of what is drawn, and where its depth jumps by more than `jump` (pixels)."""
    covered = canvas.image(canvas.tag >= 0)
    depth = np.where(covered, canvas.image(canvas.depth), 0)
    inner = np.asarray(ndimage.binary_erosion(covered, iterations=2), bool)
    rim = covered & ~inner
    # The second difference is small on any plane, however steep.
    bend = np.zeros_like(depth)
    bend[:, 1:-1] = np.abs(depth[:, 2:] - 2 * depth[:, 1:-1] + depth[:, :-2])
    bend[1:-1] = np.maximum(bend[1:-1], np.abs(depth[2:] - 2 * depth[1:-1] + depth[:-2]))
    return rim | (inner & (bend > jump))


def blend(
    below: Float[np.ndarray, "h w 3"], colour: Float[np.ndarray, " 3"], opacity: Float[np.ndarray, "h w"]
) -> Float[np.ndarray, "h w 3"]:
    """Lay a colour over a picture."""
    picture = below.copy()
    rows, columns = np.nonzero(opacity)
    old = picture[rows, columns]
    picture[rows, columns] = old + opacity[rows, columns, None] * (np.asarray(colour, np.float32) - old)
    return picture
