"""Attachments: a part repeated along curves at equal spacing, carried along without twist (Arora et al. 2019, Fig. 19).

The frames are rotation-minimising, by the double reflection of Wang, Jüttler, Zheng and Liu 2008, Computation of
rotation minimizing frames, ACM Trans. Graph. 27(1), doi:10.1145/1330511.1330513.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float
from pydantic import Field

from michell_cad.arrays import freeze, require
from michell_cad.curves import Curve
from michell_cad.edits.selections import Point
from michell_cad.edits.structure import SelectingEdit, Structure
from michell_cad.splines import MemberSplines, bezier, curve_spline, fit_splines
from michell_cad.truss import Truss

SAMPLES = 64
"""Points on each piece of a spline; the arc length of a piece that turns by 60 degrees then errs by 1e-5."""


MOST_COPIES = 20_000
"""Copies of one attachment: a part of ten faces then fills a STEP file of hundreds of MB."""


@dataclass(frozen=True, eq=False)
class Frames:
    """Places with axes.

    Parameters
    ----------
    origins : (n, 3) float, mm.
    axes : (n, 3, 3) float, columns x, y and z: z along the curve, x carried along it without twist.
    """

    origins: Float[np.ndarray, "n 3"]
    axes: Float[np.ndarray, "n 3 3"]

    def __post_init__(self) -> None:
        freeze(self, origins=np.float64, axes=np.float64)


class Attach(SelectingEdit):
    """A part repeated along each of the selected curves: its z axis along the curve, its x axis towards `up`."""

    do: Literal["attach"] = "attach"
    part: str = Field(description="A CAD file (.step, .brep) with the part at its origin.")
    spacing: float = Field(gt=0, description="Arc length from one to the next, mm; the rest is left at both ends.")
    up: Point = Field(default=(0.0, 0.0, 1.0), description="Where the part's x axis points at the start of a curve.")

    def apply(self, structure: Structure) -> Structure:
        require(any(self.up), "edit 'attach': up must not be the zero vector")
        truss, mine = structure.truss, self.curves(structure.truss)
        along = sum(truss.lengths[c.members].sum() for c, chosen in zip(truss.curves, mine, strict=True) if chosen)
        require(
            along / self.spacing <= MOST_COPIES,
            f"edit 'attach': a spacing of {self.spacing:.3g} mm along {along:.4g} mm of curves makes "
            f"{along / self.spacing:.3g} copies, more than {MOST_COPIES}; use a larger spacing or fewer curves",
        )
        return structure.with_note(self)


def attachment_frames(structure: Structure, edit: Attach, truss: Truss | None = None) -> Frames:
    """The places of all copies, curve after curve.

    Parameters
    ----------
    structure : Structure
    edit : one of its attachments.
    truss : what to look at instead of the structure's own truss, for example the truss as it was built.
    """
    truss = structure.truss if truss is None else truss
    splines = fit_splines(truss)
    chosen = edit.where.curves(truss)
    made = [
        frames_along(truss, splines, curve, edit.spacing, np.array(edit.up))
        for curve, mine in zip(truss.curves, chosen, strict=True)
        if mine
    ]
    return Frames(
        np.concatenate([np.zeros((0, 3)), *(f.origins for f in made)]),
        np.concatenate([np.zeros((0, 3, 3)), *(f.axes for f in made)]),
    )


def frames_along(truss: Truss, splines: MemberSplines, curve: Curve, spacing: float, up: np.ndarray) -> Frames:
    """Frames at equal arc lengths along a curve.

    An open curve has them at both sides of its middle, so that equal rests are left at its ends (one that is shorter
    than the spacing has one, in its middle); a closed one has a
    whole number of them all around, as near to the spacing as that allows.
    """
    points = _polyline(truss, splines, curve)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    arc = np.concatenate([[0.0], np.cumsum(steps)])
    if curve.closed:
        count = max(round(arc[-1] / spacing), 1)
        s = np.arange(count) * arc[-1] / count
    else:
        count = int(np.floor(arc[-1] / spacing + 1e-9))
        s = (arc[-1] - count * spacing) / 2 + np.arange(count + 1) * spacing
    tangents, normals = transport(points, up)
    at = np.clip(np.searchsorted(arc, s, side="right") - 1, 0, len(steps) - 1)
    share = ((s - arc[at]) / steps[at])[:, None]
    origins = points[at] + share * (points[at + 1] - points[at])
    z = _unit(tangents[at] + share * (tangents[at + 1] - tangents[at]))
    x = normals[at] + share * (normals[at + 1] - normals[at])
    x = _unit(x - (x * z).sum(1, keepdims=True) * z)
    return Frames(origins, np.stack([x, np.cross(z, x), z], axis=2))


def transport(points: Float[np.ndarray, "n 3"], up: Float[np.ndarray, " 3"]) -> tuple[np.ndarray, np.ndarray]:
    """Tangents of a polyline and normals carried along it by double reflection; the first one is towards `up`."""
    chords = _unit(np.diff(points, axis=0))
    tangents = _unit(np.concatenate([chords[:1], chords[:-1] + chords[1:], chords[-1:]]))
    first = up - (up @ tangents[0]) * tangents[0]
    if np.linalg.norm(first) < 1e-6 * np.linalg.norm(up):  # a curve that starts along `up`: any normal is as good
        first = np.cross(tangents[0], np.roll(tangents[0], 1) + np.array([0.0, 0.0, 1e-3]))
    normals = [first / np.linalg.norm(first)]
    for k in range(len(points) - 1):
        v = points[k + 1] - points[k]
        reflected = normals[-1] - 2 * (v @ normals[-1]) / (v @ v) * v
        tangent = tangents[k] - 2 * (v @ tangents[k]) / (v @ v) * v
        w = tangents[k + 1] - tangent
        length = w @ w
        normals.append(reflected - (2 * (w @ reflected) / length * w if length > 0 else 0))
    return tangents, np.array(normals)


def _polyline(truss: Truss, splines: MemberSplines, curve: Curve) -> np.ndarray:
    spline = curve_spline(truss, splines, curve).control_points
    pieces = np.stack([spline[0:-1:3], spline[1::3], spline[2::3], spline[3::3]], axis=1)
    t = np.arange(SAMPLES) / SAMPLES
    points = bezier(pieces[:, None], np.broadcast_to(t, (len(pieces), SAMPLES))).reshape(-1, 3)
    return np.concatenate([points, spline[-1:]])


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), np.finfo(float).tiny)
