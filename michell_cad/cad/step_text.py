"""The text of STEP files (ISO 10303-21) that hold solids with named, coloured and layered faces.

A file is a list of numbered records that refer to each other by number (ISO 10303-42 for geometry and topology, -46 for
colours and layers, -41 for products). The CAD kernel can write them too, but repeats what is used twice, a chain of
seven records for the colour of every face among it: shared, a truss takes half the room, and less than half the time.
`kernel_step` tells the geometry of solids of the kernel.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime

PROGRAM = "michell_cad"
"""Stands as the originating system in the header."""

DIGITS = 13
"""Significant digits of the largest coordinate, and decimals of directions, weights and knots: rounding is a thousandth
of the kernel's tolerance. With three digits fewer the kernel still reads the faces, but finds some edges of narrow
tori to cross each other."""

Colour = tuple[float, float, float]

LISTED = 16
"""Numbers of records on one line of a list."""


@dataclass(frozen=True)
class Schema:
    """Name of a schema in the header and to the kernel, its protocol, year and application context."""

    header: str
    kernel_name: str
    protocol: str
    year: int
    context: str


AP214 = Schema(
    "AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }",
    "AP214IS",
    "automotive_design",
    2000,
    "core data for automotive mechanical design processes",
)

AP242 = Schema(
    "AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF {1 0 10303 442 1 1 4 }",
    "AP242DIS",
    "ap242_managed_model_based_3d_engineering",
    2013,
    "Managed model based 3d engineering",
)


@dataclass(frozen=True)
class Tag:
    """What a face or a part is called: its name, its colour (sRGB), its layer."""

    name: str
    colour: Colour
    layer: str


class StepText:
    """The records of a file, while it grows.

    Parameters
    ----------
    extent : largest absolute coordinate, mm; lengths get as many decimals as give it `DIGITS` digits.
    """

    def __init__(self, extent: float) -> None:
        self._records: list[str] = []
        self._known: dict[str, int] = {}
        self._styles: dict[Colour, int] = {}
        self._decimals = max(DIGITS - len(f"{extent:.0f}"), 1)

    @property
    def size(self) -> int:
        """Characters of all records with their numbers."""
        n = len(self._records)
        digits = sum(max(n - 10**k + 1, 0) for k in range(len(str(n))))
        return sum(map(len, self._records)) + len("#=;\n") * n + digits

    def add(self, record: str) -> int:
        """Add a record; returns its number."""
        self._records.append(record)
        return len(self._records)

    def share(self, record: str) -> int:
        """Number of the record with this text, added if there is none."""
        number = self._known.get(record)
        if number is None:
            number = self._known[record] = self.add(record)
        return number

    def lines(self, name: str, schema: Schema) -> Iterator[str]:
        """The lines of the whole file; the header holds the name."""
        now = datetime.now().isoformat(timespec="seconds")
        yield "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION(('truss of curves along principal stresses'),'2;1');\n"
        yield f"FILE_NAME({quoted(name)},'{now}',(''),(''),'{PROGRAM}','{PROGRAM}','');\n"
        yield f"FILE_SCHEMA(('{schema.header}'));\nENDSEC;\nDATA;\n"
        for number, record in enumerate(self._records, 1):
            yield f"#{number}={record};\n"
        yield "ENDSEC;\nEND-ISO-10303-21;\n"

    def length(self, value: float) -> str:
        """A number in mm."""
        return _real(value, self._decimals)

    def point(self, x: float, y: float, z: float) -> int:
        """Number of a point, mm."""
        n = self._decimals
        return self.share(f"CARTESIAN_POINT('',({_real(x, n)},{_real(y, n)},{_real(z, n)}))")

    def direction(self, x: float, y: float, z: float) -> int:
        """Number of a unit vector."""
        return self.share(f"DIRECTION('',({_real(x, DIGITS)},{_real(y, DIGITS)},{_real(z, DIGITS)}))")

    def placement(self, origin: int, axis: int, zero: int) -> int:
        """Number of a right-handed frame: origin, z axis, x axis."""
        return self.share(f"AXIS2_PLACEMENT_3D('',#{origin},#{axis},#{zero})")

    def style(self, colour: Colour) -> int:
        """Number of the style of faces of this colour (sRGB)."""
        if colour in self._styles:
            return self._styles[colour]
        red, green, blue = (_real(value, DIGITS) for value in colour)
        number = self.add(f"COLOUR_RGB('',{red},{green},{blue})")
        for record in (
            "FILL_AREA_STYLE_COLOUR('',#{})",
            "FILL_AREA_STYLE('',(#{}))",
            "SURFACE_STYLE_FILL_AREA(#{})",
            "SURFACE_SIDE_STYLE('',(#{}))",
            "SURFACE_STYLE_USAGE(.BOTH.,#{})",
            "PRESENTATION_STYLE_ASSIGNMENT((#{}))",
        ):
            number = self.add(record.format(number))
        self._styles[colour] = number
        return number

    def layers(self, items: Iterable[tuple[str, int]]) -> None:
        """Assign records to layers by name."""
        members: dict[str, list[int]] = {}
        for name, number in items:
            members.setdefault(name, []).append(number)
        for name, numbers in members.items():
            self.add(f"PRESENTATION_LAYER_ASSIGNMENT({quoted(name)},'visible',({listed(numbers)}))")

    def product(self, name: str, solid: int, tolerance: float, styled: Sequence[int], schema: Schema) -> None:
        """A product of its own that is a solid, with its styled items; tolerance in mm."""
        origin, z, x = self.point(0, 0, 0), self.direction(0, 0, 1), self.direction(1, 0, 0)
        context = self._geometric_context(tolerance)
        shape = self.add(
            f"ADVANCED_BREP_SHAPE_REPRESENTATION('',(#{self.placement(origin, z, x)},#{solid}),#{context})"
        )
        of = self.share(f"APPLICATION_CONTEXT('{schema.context}')")
        self.share(f"APPLICATION_PROTOCOL_DEFINITION('international standard','{schema.protocol}',{schema.year},#{of})")
        mechanical = self.share(f"PRODUCT_CONTEXT('',#{of},'mechanical')")
        stage = self.share(f"PRODUCT_DEFINITION_CONTEXT('part definition',#{of},'design')")
        product = self.add(f"PRODUCT({quoted(name)},{quoted(name)},'',(#{mechanical}))")
        self.add(f"PRODUCT_RELATED_PRODUCT_CATEGORY('part',$,(#{product}))")
        formation = self.add(f"PRODUCT_DEFINITION_FORMATION('','',#{product})")
        definition = self.add(f"PRODUCT_DEFINITION('design','',#{formation},#{stage})")
        meaning = self.add(f"PRODUCT_DEFINITION_SHAPE('','',#{definition})")
        self.add(f"SHAPE_DEFINITION_REPRESENTATION(#{meaning},#{shape})")
        self.add(f"MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',({listed(styled)}),#{context})")

    def _geometric_context(self, tolerance: float) -> int:
        """Number of the context that says mm, radians, and how exactly edges and vertices lie on their faces."""
        mm = self.share("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))")
        radian = self.share("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))")
        steradian = self.share("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())")
        accuracy = self.share(
            f"UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE({_real(tolerance, DIGITS)}),#{mm},"
            "'distance_accuracy_value','confusion accuracy')"
        )
        return self.share(
            f"(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT((#{accuracy}))"
            f"GLOBAL_UNIT_ASSIGNED_CONTEXT((#{mm},#{radian},#{steradian}))"
            "REPRESENTATION_CONTEXT('3D','model'))"
        )


def _real(value: float, decimals: int) -> str:
    """A real number as STEP wants it: with a point, without zeros at its end."""
    text = f"{value:.{decimals}f}".rstrip("0")
    return "0." if text == "-0." else text


def reals(values: Iterable[float]) -> str:
    """Weights or knots."""
    return ",".join([_real(value, DIGITS) for value in values])


def listed(numbers: Sequence[int]) -> str:
    """References to records; long lists go over several lines, as some programs read files line by line."""
    refs = [f"#{number}" for number in numbers]
    if len(refs) <= LISTED:
        return ",".join(refs)
    return ",\n".join(",".join(refs[i : i + LISTED]) for i in range(0, len(refs), LISTED))


def quoted(text: str) -> str:
    """A string of ISO 10303-21: quotes and backslashes doubled, other letters than ASCII by their code points."""
    return "'" + "".join(_letters(text)) + "'"


def _letters(text: str) -> Iterator[str]:
    for letter in text:
        if letter in "'\\":
            yield 2 * letter
        elif " " <= letter <= "~":
            yield letter
        elif ord(letter) < 0x10000:
            yield f"\\X2\\{ord(letter):04X}\\X0\\"
        else:
            yield f"\\X4\\{ord(letter):08X}\\X0\\"
