"""How thick: radius and entasis by selection, constant or varying along the curve, with the stress, or with the depth.

Where two edits speak of the same member the later one holds. Members of which no edit speaks follow the knobs.
"""

from dataclasses import replace
from typing import Annotated, Literal

import igl
import numpy as np
from jaxtyping import Float, Int
from pydantic import Field, model_validator
from scipy.spatial import KDTree

from michell_cad.arrays import require
from michell_cad.edits.structure import DesignFields, SelectingEdit, Structure
from michell_cad.knobs import LARGEST_RADIUS_RATIO, Knobs, arc_fractions, default_radius, entasis_weights
from michell_cad.truss import SizedTruss, Truss

STRONG_STRESS = 0.95
"""Quantile over the tets of the largest principal stress that counts as 1: a peak in a corner must not rule."""

NEIGHBOURS = 9
"""Tets whose stress is interpolated at a point; the farthest has no weight."""

Factor = Annotated[float, Field(gt=0, le=10)]

THICKER_THAN_SIZED = 1.5
"""Edits may make a member that was sized for its loads so many times as thick, even where that is more than cells of
equal members have room for: sizing knows where there is room."""


class Radius(SelectingEdit):
    """Members of another radius: in mm, or as a multiple of the knob's; constant, or varying over something."""

    do: Literal["radius"] = "radius"
    to: float | None = Field(default=None, gt=0, description="Radius, mm.")
    times: Factor | None = Field(default=None, description="Or: over the radius that the knobs, or the loads, give.")
    over: Literal["length", "stress", "depth"] | None = Field(
        default=None,
        description="What the radius varies with: the length along each curve, the axial stress (1: the 95 per cent "
        "quantile of the part's principal stresses), the depth below the surface (1: the deepest place).",
    )
    values: tuple[Factor, ...] = Field(
        default=(), description="Factors at equal steps from 0 to 1 of what it varies with, linear in between."
    )

    @model_validator(mode="after")
    def _whole(self) -> "Radius":
        if self.to is not None and self.times is not None:
            raise ValueError("give to (mm) or times (a factor), not both")
        if self.to is None and self.times is None and self.over is None:
            raise ValueError("say how thick: to = ... (mm), times = ... (a factor), or over = ... with values")
        if (self.over is None) != (len(self.values) < 2):
            raise ValueError("over and at least two values go together")
        return self

    def apply(self, structure: Structure) -> Structure:
        self.members(structure.truss)
        return structure.with_note(self)

    def resized(self, radii: np.ndarray, given: np.ndarray, structure: Structure) -> np.ndarray:
        """The radii (n_m, 3) with those of the selected members replaced; `given` are those before any edit."""
        mine = self.members(structure.truss)
        base = self.to if self.to is not None else (self.times or 1.0) * given[mine]
        factor = np.ones((int(mine.sum()), 3))
        if self.over is not None:
            part = part_of_member(structure.truss)
            x = np.zeros((len(part), 3))
            for number in np.unique(part[mine]):
                x[part == number] = _MEASURES[self.over](structure.truss, structure.pieces[number].fields)[
                    part == number
                ]
            factor = np.interp(x[mine], np.linspace(0, 1, len(self.values)), self.values)
        radii = radii.copy()
        radii[mine] = base * factor
        return radii


class Entasis(SelectingEdit):
    """Curves of another entasis."""

    do: Literal["entasis"] = "entasis"
    to: float = Field(ge=-0.5, le=2.0, description="Members are thicker by this fraction in the middle of each curve.")

    def apply(self, structure: Structure) -> Structure:
        self.curves(structure.truss)
        return structure.with_note(self)


def size_structure(structure: Structure, knobs: Knobs | None = None) -> SizedTruss:
    """Give every member of a structure its radius, by the knobs of its part and then the edits.

    Parameters
    ----------
    structure : Structure
    knobs : of the structure itself; default: its own. Parts that were joined to it have knobs of their own.

    Raises
    ------
    InvalidInputError
        If a selection is empty by now, or a radius is too large for the cell edge of the truss.
    """
    structure = structure if knobs is None else replace(structure, knobs=knobs)
    truss, part = structure.truss, part_of_member(structure.truss)
    radius = np.array([default_radius(piece.fields.spacing, piece.knobs) for piece in structure.pieces])
    entasis = np.array([piece.knobs.entasis for piece in structure.pieces])
    given = np.repeat(radius[part, None], 3, axis=1)
    granted = np.zeros(len(truss.members))
    return _edit_radii(structure, SizedTruss(truss, given), entasis[[curve.part for curve in truss.curves]], granted)


def resize_structure(structure: Structure, sized: SizedTruss) -> SizedTruss:
    """A truss whose radii suit its loads, with those that the edits of its structure want; see `size_structure`.

    `times` and `values` of an edit are over the radii that the members have, and so is entasis.
    """
    granted = THICKER_THAN_SIZED * sized.radii.max(1)
    return _edit_radii(replace(structure, truss=sized.truss), sized, np.zeros(len(sized.truss.curves)), granted)


def part_of_member(truss: Truss) -> Int[np.ndarray, " n_m"]:
    """Which of several joined parts each member is of, by the curve that names it."""
    return np.array([curve.part for curve in truss.curves], np.int64)[truss.curve_of_member]


def _edit_radii(
    structure: Structure, sized: SizedTruss, entasis: Float[np.ndarray, " n_c"], granted: Float[np.ndarray, " n_m"]
) -> SizedTruss:
    """The radii by the edits, from those before any and the entasis of the curves of which no edit speaks.

    No radius may be too large for the cells of the truss, but for what is granted to each member, mm.
    """
    truss, radii, entasis = sized.truss, np.array(sized.radii), entasis.copy()
    for edit in structure.noted:
        if isinstance(edit, Radius):
            radii = edit.resized(radii, sized.radii, structure)
        elif isinstance(edit, Entasis):
            entasis[edit.curves(truss)] = edit.to
    radii = radii * (1 + entasis[truss.curve_of_member, None] * entasis_weights(truss))
    pieces, part = structure.pieces, part_of_member(truss)
    smallest = np.array([max(piece.knobs.smallest_radius, structure.knobs.smallest_radius) for piece in pieces])
    radii = np.maximum(radii, smallest[part, None])
    spacing = np.array([piece.fields.spacing for piece in pieces])[part]
    bounds = np.maximum(LARGEST_RADIUS_RATIO * spacing, granted)
    worst = int(np.argmax(radii.max(1) / bounds))
    largest = bounds[worst]
    require(
        radii[worst].max() <= largest,
        f"a radius of {radii[worst].max():.4g} mm (on {truss.curves[truss.curve_of_member[worst]].name}, entasis "
        f"included) is too large for a cell edge of {spacing[worst]:.4g} mm: use at most {largest:.4g} mm",
    )
    return SizedTruss(truss, radii)


def _samples(truss: Truss) -> Float[np.ndarray, "n_m 3 3"]:
    """First node, middle of the chord, and second node of each member."""
    a, b = truss.nodes[truss.members].transpose(1, 0, 2)
    return np.stack([a, (a + b) / 2, b], axis=1)


def _relative_stress(truss: Truss, fields: DesignFields) -> np.ndarray:
    """|t . sigma t| in the direction t of each member over the stress that counts as 1, at most 1."""
    principal = np.abs(np.linalg.eigvalsh(fields.stress)).max(1)
    strong = max(float(np.quantile(principal, STRONG_STRESS)), np.finfo(float).tiny)
    points = _samples(truss)
    t = points[:, 2] - points[:, 0]
    t = t / np.linalg.norm(t, axis=1, keepdims=True)
    sigma = interpolate_stress(fields, points.reshape(-1, 3)).reshape(-1, 3, 3, 3)
    axial = np.einsum("mi,msij,mj->ms", t, sigma, t)
    return np.minimum(np.abs(axial) / strong, 1)


def interpolate_stress(fields: DesignFields, points: Float[np.ndarray, "k 3"]) -> Float[np.ndarray, "k 3 3"]:
    """Stress at points between the centroids of the tets, MPa.

    Means over the nearest centroids with the weights ((R - d) / (R d))^2 of Franke and Little (R the distance of the
    farthest, d of each): the result is continuous, so that it does not matter which of two equally near tets is found.
    """
    d, tet = KDTree(fields.mesh.centroids).query(points, k=min(NEIGHBOURS, len(fields.stress)))
    d, tet = d.reshape(len(points), -1), tet.reshape(len(points), -1)
    R = d.max(1, keepdims=True) * (1 + 1e-9)
    weights = ((R - d) / (R * np.maximum(d, 1e-9 * R))) ** 2
    return np.einsum("kn,knij->kij", weights / weights.sum(1, keepdims=True), fields.stress[tet])


def _relative_depth(truss: Truss, fields: DesignFields) -> np.ndarray:
    """Distance below the surface over that of the deepest tet."""
    mesh = fields.mesh

    def depth(points: np.ndarray) -> np.ndarray:
        return -np.asarray(igl.signed_distance(points, mesh.vertices, mesh.boundary_triangles)[0])

    return np.clip(depth(_samples(truss).reshape(-1, 3)).reshape(-1, 3) / depth(mesh.centroids).max(), 0, 1)


_MEASURES = {
    "length": lambda truss, fields: arc_fractions(truss),
    "stress": _relative_stress,
    "depth": _relative_depth,
}
