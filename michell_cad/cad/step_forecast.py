"""How large a STEP file will be, from the edges and faces it will hold, before anything is written.

A STEP file is a list of numbered lines such as ``#24 = CIRCLE('',#25,1.);``. Every edge, face and part takes a known
set of such lines: so many characters of text, and so many numbers of lines (its own and those it refers to), whose
digits grow with the file. The texts in `ITEMS` were counted in files of the kernel's writer (7.9), where a coordinate
takes 15 characters. Accuracy: within 3 % on traced trusses, of one solid or as an assembly, with pcurves or without.
Where most coordinates are round numbers, as in a grid along the axes, the file is smaller, by up to a quarter.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

HEADER = 2500
"""Bytes of the header, the units and the product of the whole."""


class Lines(NamedTuple):
    """What an item adds to a file: lines, characters of their text, and numbers of lines in it."""

    lines: int
    text: int
    numbers: int


def _sum(*parts: Lines) -> Lines:
    return Lines(*(sum(column) for column in zip(*parts, strict=True)))


def _times(n: int, item: Lines) -> Lines:
    return Lines(*(n * value for value in item))


POINT, DIRECTION = Lines(1, 79, 1), Lines(1, 75, 1)
PLACEMENT = _sum(Lines(1, 31, 4), POINT, DIRECTION, DIRECTION)
PARAMETER_POINT = Lines(1, 48, 1)
STYLE = Lines(7, 232, 16)

ITEMS = {
    "vertices": _sum(Lines(1, 22, 2), POINT),
    "lines": _sum(Lines(3, 60, 10), POINT, DIRECTION),
    "circles": _sum(Lines(2, 55, 6), PLACEMENT),
    "splines": Lines(2, 147, 5),
    "curve_poles": _sum(POINT, Lines(0, 3, 1)),
    "coedges": Lines(1, 34, 3),
    "wires": Lines(2, 45, 3),
    "quadrics": _sum(Lines(2, 71, 5), PLACEMENT),
    "spline_faces": Lines(2, 390, 4),
    "surface_poles": _sum(POINT, Lines(0, 11, 1)),
    "parameter_lines": _sum(Lines(6, 300, 15), PARAMETER_POINT),
    "parameter_splines": Lines(4, 440, 10),
    "parameter_poles": _sum(PARAMETER_POINT, Lines(0, 3, 1)),
}
"""Lines for each item of `kernel_files.Counts`."""

TAGGED_FACE = _sum(STYLE, Lines(0, 4, 2))
TAGGED_PART = _sum(STYLE, Lines(25, 1500, 55), PLACEMENT, PLACEMENT)
NAMES_OF_PART = 4
"""So often the name of a part stands in the file."""


def forecast_bytes(shapes: Sequence[Any], names: Sequence[str], assembly: bool, pcurves: bool) -> int:
    """Bytes of a STEP file of these solids, with tagged faces or, in an assembly, tagged parts of these names."""
    from michell_cad.cad import kernel_files

    counts = kernel_files.count_parts(shapes, pcurves)
    held = [_times(n, ITEMS[item]) for item, n in counts.items()]
    whole = _sum(*held, _times(len(names), TAGGED_PART if assembly else TAGGED_FACE))
    letters = (NAMES_OF_PART if assembly else 1) * sum(map(len, names))
    return round(HEADER + letters + whole.text + whole.numbers * _mean_digits(whole.lines))


def _mean_digits(n: int) -> float:
    """Average number of digits of the numbers 1 to n."""
    return sum((n - 10**k + 1) / n for k in range(len(str(n))))
