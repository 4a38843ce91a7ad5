"""How large a STEP file will be, from the edges and faces it will hold, before anything is written.

A STEP file is a list of numbered lines such as ``#24 = CIRCLE('',#25,1.);``. Every edge, face and part takes a known
set of such lines: so many characters of text, and so many numbers of lines (its own and those it refers to), whose
digits grow with the file. `OWN` holds those of `step_text`, where some lines serve several users; the shares were
counted on trusses and differ little between them. Those in `KERNEL` were counted in files of the kernel's writer (7.9),
where a coordinate takes 15 characters. Accuracy: within 4 % on traced trusses, of one solid or as an assembly, with
pcurves or without. Where most coordinates are round numbers, as in a grid along the axes, the file is smaller, by up to
a quarter.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

HEADER = 2500
"""Bytes of the header, the units and the product of the whole."""


class Lines(NamedTuple):
    """What an item adds to a file: lines, characters of their text, and numbers of lines in it."""

    lines: float
    text: float
    numbers: float


def _sum(*parts: Lines) -> Lines:
    return Lines(*(sum(column) for column in zip(*parts, strict=True)))


def _times(n: float, item: Lines) -> Lines:
    return Lines(*(n * value for value in item))


POINT, DIRECTION = Lines(1, 79, 1), Lines(1, 75, 1)
PLACEMENT = _sum(Lines(1, 31, 4), POINT, DIRECTION, DIRECTION)
PARAMETER_POINT = Lines(1, 48, 1)
STYLE = Lines(7, 232, 16)

KERNEL = {
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
"""Lines of the kernel's writer for each item of `kernel_files.count_parts`."""

TAGGED_FACE = _sum(STYLE, Lines(0, 4, 2))
TAGGED_PART = _sum(STYLE, Lines(25, 1500, 55), PLACEMENT, PLACEMENT)
OWN_POINT = _times(0.775, Lines(1, 68.5, 1))
OWN_DIRECTION = Lines(1, 66, 1)
OWN_PLACEMENT = _sum(OWN_POINT, _times(0.71, Lines(1, 32, 4)), _times(0.8, OWN_DIRECTION))

OWN = {
    "vertices": _sum(Lines(1, 22, 2), OWN_POINT),
    "lines": _sum(Lines(2, 37, 5), OWN_POINT, _times(0.4, OWN_DIRECTION)),
    "circles": _sum(_times(0.8, Lines(1, 29, 2)), OWN_PLACEMENT),
    "splines": Lines(1, 99, 1),
    "curve_poles": _sum(OWN_POINT, Lines(0, 2, 1)),
    "coedges": Lines(1.5, 48, 5),
    "wires": Lines(2, 44, 4),
    "quadrics": _sum(Lines(1, 51, 2), OWN_PLACEMENT),
    "spline_faces": Lines(1, 330, 1),
    "surface_poles": _sum(OWN_POINT, Lines(0, 10.2, 1)),
}
"""Lines of `step_text` for each item."""

OWN_TAGGED_FACE = Lines(2, 66, 8)

NAMES_OF_PART = 4
"""So often the name of a part stands in the file."""


def forecast_bytes(shapes: Sequence[Any], names: Sequence[str]) -> int:
    """Bytes of a STEP file of these solids by `step_text`, with tagged faces of these names."""
    return _forecast(shapes, OWN, _times(len(names), OWN_TAGGED_FACE), sum(map(len, names)))


def forecast_kernel_bytes(shapes: Sequence[Any], names: Sequence[str], assembly: bool, pcurves: bool) -> int:
    """The same by the kernel's writer, with tagged faces or, in an assembly, tagged parts of these names."""
    tagged = _times(len(names), TAGGED_PART if assembly else TAGGED_FACE)
    return _forecast(shapes, KERNEL, tagged, (NAMES_OF_PART if assembly else 1) * sum(map(len, names)), pcurves)


def _forecast(
    shapes: Sequence[Any], items: Mapping[str, Lines], tagged: Lines, letters: int, pcurves: bool = False
) -> int:
    from michell_cad.cad import kernel_files

    counts = kernel_files.count_parts(shapes, pcurves)
    whole = _sum(*(_times(n, items[item]) for item, n in counts.items()), tagged)
    return round(HEADER + letters + whole.text + whole.numbers * _mean_digits(round(whole.lines)))


def _mean_digits(n: int) -> float:
    """Average number of digits of the numbers 1 to n."""
    return sum((n - 10**k + 1) / n for k in range(len(str(n))))
