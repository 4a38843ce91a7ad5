"""Build the bracket of `bracket.toml` with build123d and write `bracket.step` beside this script.

A base plate of 80 x 60 x 14 mm with four bolt holes of 9 mm, and a lug of 20 mm thickness whose eye, 16 mm wide, sits
40 mm above the base; the lug runs into the plate with a fillet of 5 mm.
"""

from datetime import UTC, datetime
from pathlib import Path

from build123d import (
    Align,
    Axis,
    Box,
    BuildPart,
    BuildSketch,
    Circle,
    Cylinder,
    GridLocations,
    Hole,
    Locations,
    Mode,
    Part,
    Plane,
    Polygon,
    export_step,
    extrude,
    fillet,
)

PLATE = (80.0, 60.0, 14.0)
BOLTS = (56.0, 40.0)
BOLT_RADIUS = 4.5
LUG_THICKNESS, LUG_FOOT = 20.0, 52.0
EYE_HEIGHT, EYE_RADIUS, LUG_RADIUS = 44.0, 8.0, 18.0
FILLET = 5.0


def build_bracket() -> Part:
    """Return the bracket, its base on z = 0."""
    with BuildPart() as bracket:
        Box(*PLATE, align=(Align.CENTER, Align.CENTER, Align.MIN))
        with BuildSketch(Plane.YZ):
            foot, eye = LUG_FOOT / 2, (LUG_RADIUS, EYE_HEIGHT)
            Polygon((-foot, 0), (foot, 0), eye, (-eye[0], eye[1]), align=None)
            with Locations((0, EYE_HEIGHT)):
                Circle(LUG_RADIUS)
        extrude(amount=LUG_THICKNESS / 2, both=True)
        corner = bracket.edges().filter_by(Axis.Y).filter_by(lambda e: abs(e.center().Z - PLATE[2]) < 1e-6)
        fillet(corner.filter_by(lambda e: abs(abs(e.center().X) - LUG_THICKNESS / 2) < 1e-6), FILLET)
        with Locations(Plane.XY.offset(PLATE[2])), GridLocations(*BOLTS, 2, 2):
            Hole(BOLT_RADIUS)
        with Locations(Plane.YZ.offset(LUG_THICKNESS / 2) * Plane((0, EYE_HEIGHT, 0)).location):
            Cylinder(EYE_RADIUS, 2 * LUG_THICKNESS, mode=Mode.SUBTRACT)
    assert bracket.part is not None
    return bracket.part


if __name__ == "__main__":
    part = build_bracket()
    target = Path(__file__).with_suffix(".step")
    # A fixed date keeps the file the same from run to run.
    export_step(part, str(target), timestamp=datetime(2026, 1, 1, tzinfo=UTC))
    print(f"{target.name}: {part.volume:.0f} mm3, {len(part.faces())} faces, valid: {part.is_valid}")
