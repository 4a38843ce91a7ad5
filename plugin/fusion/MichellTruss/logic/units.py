"""Units of the knobs and the host's own: Fusion computes in centimetres, kilograms and radians."""

from .layout import LayoutError

_HOST = {
    "mm": ("mm", 0.1),
    "g": ("g", 0.001),
    "1": ("", 1.0),
    "rad": ("rad", 1.0),
    "deg": ("deg", 0.017453292519943295),
}
"""For each unit of a knob: what Fusion calls it, and one of it in Fusion's internal unit."""


def host_unit(unit: str) -> str:
    """What the host calls a knob's unit; empty for a plain number."""
    return _of(unit)[0]


def to_host(number: float, unit: str) -> float:
    """A number in a knob's unit in the host's internal unit."""
    return number * _of(unit)[1]


def from_host(number: float, unit: str) -> float:
    """A number in the host's internal unit in a knob's unit."""
    return number / _of(unit)[1]


def _of(unit: str) -> tuple[str, float]:
    if unit not in _HOST:
        raise LayoutError(f"knobs.json has the unit '{unit}', which this add-in does not know: update the add-in.")
    return _HOST[unit]
