"""The knobs of a finished structure: the one schema of what a designer may turn, shown alike by every host.

Applying knobs never touches what lies upstream (stress, parametrization, isocurves): `apply_knobs` takes the whole
truss and returns the chosen part of it with a radius for every member.
"""

from collections.abc import Mapping
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
from jaxtyping import Float
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from michell_cad.arrays import require
from michell_cad.profiles import PROFILE_NAMES, Profile, ProfileName, named_profile, outline_profile
from michell_cad.truss import Curve, SizedTruss, Truss, keep_curves

FamilyName = Literal["tension", "compression", "third"]
FAMILY_ORDER: tuple[FamilyName, ...] = ("tension", "compression", "third")

DEFAULT_RADIUS_RATIO = 0.08
"""Default radius over cell edge: three members a cell of this radius fill 3 pi 0.08^2 = 6 % of the part; the curves on
its surface and the nodes make it about 10 %."""

LARGEST_RADIUS_RATIO = 0.25
"""Largest radius (entasis included) over cell edge: beyond it two nodes of a cell leave no tube between them."""

SIZES = ("radius", "volume_fraction", "mass")
"""Knobs of which one says how thick the members are."""

Stride = Annotated[int, Field(ge=1, le=1000)]
Shift = Annotated[int, Field(ge=0, le=1000)]
Row = Annotated[tuple[float, ...], Field(min_length=2, max_length=6)]


class Knobs(BaseModel):
    """What may be turned on a finished truss; names, units, bounds, defaults and help texts for every host."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    family: Literal["all"] | FamilyName | tuple[FamilyName, ...] = Field(
        default="all",
        description="Families of curves to build; boundary curves go with their family, sharp edges stay.",
    )
    radius: float | None = Field(
        default=None,
        gt=0,
        description="Radius of the members; default: 0.08 of the cell edge.",
        json_schema_extra={"unit": "mm"},
    )
    volume_fraction: float | None = Field(
        default=None,
        gt=0,
        lt=1,
        description="Instead of a radius: volume of the truss over volume of the part.",
        json_schema_extra={"unit": "1"},
    )
    mass: float | None = Field(
        default=None,
        gt=0,
        description="Instead of a radius: mass of the truss.",
        json_schema_extra={"unit": "g"},
    )
    smallest_radius: float = Field(
        default=0.0,
        ge=0,
        description="No member is thinner than this, whatever else says so: what the printer can make.",
        json_schema_extra={"unit": "mm"},
    )
    entasis: float = Field(
        default=0.0,
        ge=-0.5,
        le=2.0,
        description="Members are thicker by this fraction in the middle of each curve.",
        json_schema_extra={"unit": "1"},
    )
    every: Stride | tuple[Stride, Stride, Stride] = Field(
        default=1,
        description="Density: keep every n-th curve; one number, or one each for tension, compression and third.",
        json_schema_extra={"unit": "1"},
    )
    offset: Shift | tuple[Shift, Shift, Shift] = Field(
        default=0,
        description="Which of the n curves to keep: those whose isovalue plus offset is a multiple of n.",
        json_schema_extra={"unit": "1"},
    )
    node_ratio: float = Field(
        default=1.8,
        ge=1.2,
        le=4.0,
        description="Smallest radius of a node over the radius of its members; tight nodes take more.",
        json_schema_extra={"unit": "1"},
    )
    fillet_ratio: float = Field(
        default=0.4,
        ge=0.0,
        le=1.0,
        description="Radius of the fillet between node and member over the radius of the member; 0: no fillets.",
        json_schema_extra={"unit": "1"},
    )

    profile: ProfileName | tuple[Row, ...] = Field(
        default="round",
        description="Cross-section of the members, of the area of the circle of the radius; or the points (x, y) of an "
        "outline of one's own, as read from a .dxf, .svg, .step or .brep file if the name of one is given.",
    )
    profile_aspect: float = Field(
        default=1.0,
        ge=0.1,
        le=10.0,
        description="Stretches the profile along its x axis, which points along the curves of the next family: a "
        "square of 2 is a rectangle twice as long as wide. The area stays.",
        json_schema_extra={"unit": "1"},
    )
    node_form: Literal["sphere", "hull"] = Field(
        default="sphere",
        description="Nodes as spheres, or as convex hulls of the profiles that meet; hulls have no fillets, like all "
        "nodes of profiles that are not round.",
    )

    @field_validator("profile", mode="before")
    @classmethod
    def _known_profile(cls, value: Any) -> Any:
        if isinstance(value, str) and value not in PROFILE_NAMES:
            raise ValueError(
                f"unknown profile {value!r}; expected one of {', '.join(PROFILE_NAMES)} (a rectangle is a square with "
                "profile_aspect), a file .dxf .svg .step .brep, or points [[x, y], ...]"
            )
        return value

    @field_validator("profile")
    @classmethod
    def _outline(cls, value: ProfileName | tuple[Row, ...]) -> ProfileName | tuple[Row, ...]:
        if not isinstance(value, str):
            outline_profile(value)
        return value

    @model_validator(mode="after")
    def _some_family(self) -> "Knobs":
        if isinstance(self.family, tuple) and not self.family:
            raise ValueError("family must name at least one of tension, compression, third, or be 'all'")
        return self

    @model_validator(mode="after")
    def _one_size(self) -> "Knobs":
        given = [name for name in SIZES if getattr(self, name) is not None]
        if len(given) > 1:
            raise ValueError(f"give one of {', '.join(SIZES)}, found {' and '.join(given)}")
        return self

    @property
    def families(self) -> tuple[FamilyName, ...]:
        """The chosen families."""
        if self.family == "all":
            return FAMILY_ORDER
        return (self.family,) if isinstance(self.family, str) else self.family

    @property
    def swept(self) -> bool:
        """Whether members are swept profiles (see `cad.swept_solid`), and not the round ones of the direct shell."""
        return self.profile != "round" or self.profile_aspect != 1.0 or self.node_form != "sphere"

    @cached_property
    def shape(self) -> Profile:
        """The profile as a value."""
        if isinstance(self.profile, str):
            return named_profile(self.profile, self.profile_aspect)
        return outline_profile(self.profile, self.profile_aspect)


def apply_knobs(truss: Truss, knobs: Knobs) -> SizedTruss:
    """Choose curves by family and density, and give every member of what remains its radius.

    Raises
    ------
    InvalidInputError
        See `choose_curves` and `size_members`.
    """
    return size_members(choose_curves(truss, knobs), knobs)


def choose_curves(truss: Truss, knobs: Knobs) -> Truss:
    """Keep the curves of the chosen families and density.

    A curve of a family with stride n and offset o is kept if (v + o) mod n = 0 for each of its isovalues v (the
    reference's rule). Feature curves stay, and so do added ones.

    Raises
    ------
    InvalidInputError
        If nothing remains.
    """
    stride = dict(zip(FAMILY_ORDER, _per_family(knobs.every), strict=True))
    offset = dict(zip(FAMILY_ORDER, _per_family(knobs.offset), strict=True))

    def kept(curve: Curve) -> bool:
        if curve.family not in FAMILY_ORDER:
            return True
        return curve.family in knobs.families and on_stride(curve, stride[curve.family], offset[curve.family])

    mask = np.array([kept(curve) for curve in truss.curves], bool)
    left = sum(curve.family in FAMILY_ORDER for curve, keep in zip(truss.curves, mask, strict=True) if keep)
    require(
        left,
        f"no curve is left for family = {knobs.family!r}, every = {knobs.every}, offset = {knobs.offset}; there are "
        + ", ".join(f"{sum(c.family == name for c in truss.curves)} {name}" for name in FAMILY_ORDER)
        + " curves: choose another family or a smaller stride",
    )
    return truss if mask.all() else keep_curves(truss, mask)


def on_stride(curve: Curve, every: int, offset: int) -> bool:
    """Whether (v + offset) mod every = 0 for each of the curve's isovalues v."""
    return all(value is None or (value + offset) % every == 0 for value in curve.isovalues)


def default_radius(spacing: float, knobs: Knobs) -> float:
    """The radius that the knobs ask for, mm, at a cell edge of `spacing` mm.

    Raises
    ------
    InvalidInputError
        If they ask for a volume or a mass: the radius for it needs the solid, see `cad.radius_for_volume`.
    """
    require(
        knobs.volume_fraction is None and knobs.mass is None,
        "knobs.volume_fraction and knobs.mass need the solid: find the radius by michell_cad.resolve_radius first",
    )
    return DEFAULT_RADIUS_RATIO * spacing if knobs.radius is None else knobs.radius


def size_members(truss: Truss, knobs: Knobs) -> SizedTruss:
    """Give every member its radius.

    Along a whole curve of length L the radius is r (1 + e w(l/L)) at distance l from its start, with the entasis e and
    w(x) = 16 x^2 (1 - x)^2; a closed curve, having no ends, keeps r. No radius is below the smallest one.

    Raises
    ------
    InvalidInputError
        If the radius is too large for the cell edge of the truss.
    """
    radius = default_radius(truss.spacing, knobs)
    largest = LARGEST_RADIUS_RATIO * truss.spacing / (1 + max(knobs.entasis, 0.0))
    name, found = ("radius", radius) if radius >= knobs.smallest_radius else ("smallest_radius", knobs.smallest_radius)
    require(
        found <= largest,
        f"knobs.{name} = {found:.4g} mm with entasis {knobs.entasis:g} is too large for a cell edge of "
        f"{truss.spacing:.4g} mm: use at most {largest:.4g} mm, a larger spacing or a smaller resolution",
    )
    radii = radius * (1 + knobs.entasis * entasis_weights(truss))
    return SizedTruss(truss, np.maximum(radii, knobs.smallest_radius))


def entasis_weights(truss: Truss) -> Float[np.ndarray, "n_m 3"]:
    """w at the first node, middle and second node of each member: 0 at the ends of its curve, 1 in the middle."""
    x = arc_fractions(truss)
    return 16 * (x * (1 - x)) ** 2


def arc_fractions(truss: Truss) -> Float[np.ndarray, "n_m 3"]:
    """Where each member lies on the curve that names it: 0 at the curve's start, 1 at its end, by chord length.

    At the first node, the middle and the second node of the member. A closed curve has no ends: 0 all along.
    """
    fractions = np.zeros((len(truss.members), 3))
    owner = truss.curve_of_member
    for number, curve in enumerate(truss.curves):
        if curve.closed:
            continue
        ends = np.concatenate([[0.0], np.cumsum(truss.lengths[curve.members])])
        x = np.stack([ends[:-1], (ends[:-1] + ends[1:]) / 2, ends[1:]], axis=1) / ends[-1]
        reverse = truss.members[curve.members, 0] != curve.nodes[:-1]
        x[reverse] = x[reverse, ::-1]
        mine = owner[curve.members] == number
        fractions[curve.members[mine]] = x[mine]
    return fractions


def _per_family(value: int | tuple[int, int, int]) -> tuple[int, int, int]:
    return value if isinstance(value, tuple) else (value, value, value)


def describe_knob(name: str) -> str:
    """A knob in one line, from the schema: what it does, and in brackets its unit, choices and bounds."""
    field = Knobs.model_json_schema()["properties"][name]
    unit, choices, bounds = field.get("unit", "1"), ", ".join(knob_choices(field)), " ".join(knob_bounds(field)).strip()
    limits = [text for text in ("" if unit == "1" else unit, choices, bounds) if text]
    return field["description"] + (f" [{'; '.join(limits)}]" if limits else "")


def knob_bounds(field: Mapping[str, Any]) -> tuple[str, str]:
    """The bounds that a knob's entry in the schema states, as text, such as "above 0" and "to 4"; empty: none."""
    words = {"minimum": "from", "exclusiveMinimum": "above", "maximum": "to", "exclusiveMaximum": "below"}
    forms = [field, *field.get("anyOf", [])]
    found = [(key, f"{word} {form[key]:g}") for key, word in words.items() for form in forms if key in form]
    low, high = (next((text for key, text in found if end in key.lower()), "") for end in ("minimum", "maximum"))
    return low, high


def knob_choices(field: Mapping[str, Any]) -> list[str]:
    """The texts of which a knob's entry in the schema takes one; none for a number."""
    forms = [field, *field.get("anyOf", [])]
    return [value for form in forms for value in form.get("enum", [form["const"]] if "const" in form else [])]
