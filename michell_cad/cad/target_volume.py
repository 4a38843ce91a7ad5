"""The radius at which a truss has a wanted volume or mass, by its direct mesh.

The members alone, as cylinders from node to node, have the volume of the solid within a few per cent as long as they
are slender (nodes and fillets add what the overlaps of the members take away). They give the first radius; from there
on it is a secant between the logarithms of radius and meshed volume, two or three meshes in all. Where the solid has to
change at some radius (members merged) the volume jumps a little, hence the two tolerances.
"""

from collections.abc import Callable

import numpy as np
from scipy.optimize import root_scalar

from michell_cad.arrays import require
from michell_cad.cad.mesh import mesh_truss
from michell_cad.cad.prepare import prepare_truss
from michell_cad.cad.swept_solid import swept_volume
from michell_cad.errors import GeometryKernelError, InvalidInputError
from michell_cad.knobs import LARGEST_RADIUS_RATIO, Knobs
from michell_cad.truss import SizedTruss

CLOSE = 2e-3
"""The volume is met when it is nearer than this (relative)."""

FAIR = 1e-2
"""... and this near is good enough where it jumps (relative)."""

MOST_MESHES = 8

SMALLEST_RADIUS_RATIO = 2e-3
"""Smallest radius that is tried, over the cell edge: thinner members are no structure."""

LEAST_EXPONENT, EXPONENT = 0.5, 2.0
"""Of the volume as a power of the radius: least (some members have radii of their own), and of cylinders."""


def resolve_radius(
    knobs: Knobs, size: Callable[[Knobs], SizedTruss], spacing: float, part_volume: float, density: float
) -> Knobs:
    """Replace a wanted volume fraction or mass by the radius that gives it; other knobs stay as they are.

    Parameters
    ----------
    knobs : Knobs
    size : gives every member its radius by knobs that state a radius, for example ``apply_knobs`` of a truss.
    spacing : mm, edge of a typical truss cell.
    part_volume : mm^3, of which the volume fraction is one.
    density : g/mm^3.

    Raises
    ------
    InvalidInputError
        If no radius gives it; the message says what the thinnest and the thickest members give.
    """
    if knobs.volume_fraction is not None:
        goal, unit, said = knobs.volume_fraction * part_volume, part_volume, "knobs.volume_fraction"
    elif knobs.mass is not None:
        require(density > 0, f"knobs.mass = {knobs.mass:g} g: the material has no density")
        goal, unit, said = knobs.mass / density, 1 / density, "knobs.mass"
    else:
        return knobs

    def with_radius(radius: float) -> Knobs:
        return knobs.model_copy(update={"radius": float(radius), "volume_fraction": None, "mass": None})

    def estimate(radius: float) -> float:
        return member_volume(size(with_radius(radius)))

    def meshed(radius: float) -> float:
        sized = size(with_radius(radius))
        return swept_volume(sized, knobs) if knobs.swept else mesh_truss(prepare_truss(sized, knobs)).volume

    low = SMALLEST_RADIUS_RATIO * spacing
    high = largest_size(size, with_radius, low, LARGEST_RADIUS_RATIO * spacing)
    thin, thick = estimate(low), estimate(high)
    require(
        thin < goal < thick,
        f"{said} = {goal / unit:.4g} cannot be met: members of {low:.3g} mm give about {thin / unit:.3g}, of "
        f"{high:.3g} mm {thick / unit:.3g}; choose a value in between, or other families and density",
    )
    start = float(root_scalar(lambda r: estimate(r) - goal, bracket=(low, high), rtol=0.1 * CLOSE).root)
    found = solve_radius(meshed, goal, start)
    if found is None:
        raise InvalidInputError(
            f"{said} = {goal / unit:.4g} cannot be met by a solid: the members would have radii of about {start:.3g} "
            f"mm at a cell edge of {spacing:.3g} mm; choose a smaller value, or other families and density"
        )
    return with_radius(found)


def member_volume(sized: SizedTruss) -> float:
    """Volume of the members from node to node, mm^3: sum of pi L <r^2>, by Simpson's rule over start, middle, end."""
    return float(np.pi * (sized.truss.lengths * (sized.radii**2 @ [1, 4, 1]) / 6).sum())


def largest_size(
    size: Callable[[Knobs], SizedTruss], with_radius: Callable[[float], Knobs], low: float, high: float
) -> float:
    """The largest radius that the cell edge allows, entasis included, to 1 per cent; between `low` and `high`."""
    while high > 1.01 * low:
        middle = np.sqrt(low * high)
        try:
            size(with_radius(middle))
            low = middle
        except InvalidInputError:
            high = middle
    return low


def solve_radius(volume: Callable[[float], float], goal: float, start: float) -> float | None:
    """The radius at which a growing `volume` is the goal; None if it is not found within `FAIR`."""
    known: dict[float, float] = {}
    radius = start
    for _ in range(MOST_MESHES):
        try:
            known[radius] = volume(radius)
        except (GeometryKernelError, InvalidInputError):
            return None
        if abs(known[radius] / goal - 1) < CLOSE:
            return radius
        near = sorted(known, key=lambda r: abs(np.log(known[r] / goal)))[:2]
        exponent = EXPONENT
        if len(near) > 1 and known[near[0]] != known[near[1]]:
            slope = np.log(known[near[1]] / known[near[0]]) / np.log(near[1] / near[0])
            exponent = max(slope, LEAST_EXPONENT)
        radius = float(near[0] * (goal / known[near[0]]) ** (1 / exponent))
    best = min(known, key=lambda r: abs(known[r] / goal - 1))
    return best if abs(known[best] / goal - 1) < FAIR else None
