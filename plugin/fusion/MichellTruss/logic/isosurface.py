"""Isosurfaces of the parametrization: the curves of a layout on which one coordinate has one whole value."""

from dataclasses import dataclass

from .layout import FAMILIES, Curve, Layout


@dataclass(frozen=True)
class Isosurface:
    """The surface where coordinate `axis` is `value`; `family` runs along that coordinate, so across the surface."""

    axis: int
    value: int
    family: str

    @property
    def label(self) -> str:
        """Where the surface is, in words."""
        return f"across {self.family}, level {self.value}"

    def holds(self, curve: Curve) -> bool:
        """Whether a curve lies on the surface."""
        return curve.isovalues[self.axis] == self.value


def isosurfaces(layout: Layout) -> tuple[Isosurface, ...]:
    """All isosurfaces on which curves of the layout lie, by coordinate and value."""
    family_along = {
        axis: curve.family
        for curve in layout.curves
        if curve.family in FAMILIES and curve.kind == "interior"
        for axis, value in enumerate(curve.isovalues)
        if value is None
    }
    values = {
        (axis, value) for curve in layout.curves for axis, value in enumerate(curve.isovalues) if value is not None
    }
    return tuple(
        Isosurface(axis, value, family_along.get(axis, f"coordinate {axis + 1}")) for axis, value in sorted(values)
    )
