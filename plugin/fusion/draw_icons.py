"""Draw the icons of the add-in's commands: a truss bay, and a mark that says what the command does to it."""

from pathlib import Path

from MichellTruss.logic.colours import COLOURS
from PIL import Image, ImageDraw

SIZES = (16, 32, 64)
"""Fusion asks for these, pixels."""

FINE = 8
"""Icons are drawn so many times larger and scaled down, for smooth edges."""

TENSION, COMPRESSION, THIRD, GREY = (COLOURS[name] for name in ("tension", "compression", "third", "feature"))
BAY = (((0.1, 0.8), (0.9, 0.8)), ((0.1, 0.2), (0.9, 0.2)), ((0.1, 0.2), (0.1, 0.8)), ((0.9, 0.2), (0.9, 0.8)))
MARKS = {
    "draw_truss": (((0.1, 0.8), (0.9, 0.2)), ((0.1, 0.2), (0.9, 0.8))),
    "edit_parameters": (((0.1, 0.5), (0.9, 0.5)),),
    "set_material": (((0.5, 0.2), (0.5, 0.8)),),
    "import_step": (((0.5, 0.1), (0.5, 0.6)), ((0.3, 0.4), (0.5, 0.62)), ((0.7, 0.4), (0.5, 0.62))),
}


def icon(command: str, size: int) -> Image.Image:
    """The icon of a command, square, on a transparent ground."""
    n = size * FINE
    image = Image.new("RGBA", (n, n), (0, 0, 0, 0))
    draw = ImageDraw.Draw(image)
    width = n // 10
    for line in BAY:
        draw.line([(x * n, y * n) for x, y in line], fill=GREY, width=width)
    for number, line in enumerate(MARKS[command]):
        colour = (TENSION, COMPRESSION, COMPRESSION)[number] if command != "set_material" else THIRD
        draw.line([(x * n, y * n) for x, y in line], fill=colour, width=int(1.4 * width))
    for x in (0.1, 0.9):
        for y in (0.2, 0.8):
            draw.ellipse([x * n - width, y * n - width, x * n + width, y * n + width], fill=COMPRESSION)
    return image.resize((size, size), Image.Resampling.LANCZOS)


if __name__ == "__main__":
    for name in MARKS:
        for size in SIZES:
            folder = Path(__file__).parent / "MichellTruss" / "commands" / name / "resources"
            icon(name, size).save(folder / f"{size}x{size}.png", optimize=True)
