"""Input decks of a frame for those who want their own solver: CalculiX, and programs that read Abaqus' beams.

Two elements of the beam model become one quadratic beam with a circular section, whose radius has the same bending
flexibility; tapered and curved members want several of them. Units: mm, N, MPa.

CalculiX expands its beams into solid elements, which agree with beams to a per cent or two. Its own six-component
element, U1, is not used: in version 2.20 it is exact (to its seven printed digits) for bending in one of its two planes
only; in the other it couples the ends with a wrong sign, and it counts shear deflection negatively.
"""

from pathlib import Path
from typing import Literal, get_args

import numpy as np

from michell_cad.arrays import require
from michell_cad.files import writing
from michell_cad.strength.beam_model import BeamModel
from michell_cad.strength.loads import TrussLoading

BeamElement = Literal["B32R", "B32"]
"""Quadratic beams: B32R is what CalculiX recommends, with circles given by two diameters; B32 is what Abaqus knows,
with circles given by the radius."""

RADIUS_DIGITS = 6
"""Significant digits of the radii; beams whose radii agree to these share a section."""


def write_beam_deck(path: str | Path, model: BeamModel, loading: TrussLoading, element: BeamElement = "B32R") -> None:
    """Write a frame with its supports and one step for each load case; the file is there whole or not at all.

    Raises
    ------
    InvalidInputError
        If the members of the model do not have an even number of pieces each.
    """
    require(element in get_args(BeamElement), f"element must be one of {get_args(BeamElement)}, found {element!r}")
    odd = np.bincount(model.member_of_element) % 2 == 1
    require(
        not odd.any(), f"decks of quadratic beams need an even number of pieces; {odd.sum()} members have an odd one"
    )
    used = np.unique(model.elements)
    lines = ["** rigid-jointed truss; mm, N, MPa", "*NODE, NSET=NALL"]
    lines += [f"{n + 1}, {x:.12g}, {y:.12g}, {z:.12g}" for n, (x, y, z) in zip(used, model.nodes[used], strict=True)]
    lines += _beams(model, element)
    lines += ["*MATERIAL, NAME=TRUSS", "*ELASTIC"]
    lines.append(f"{model.material.youngs_modulus:.12g}, {model.material.poisson_ratio:.12g}")
    lines += ["*BOUNDARY"]
    lines += [f"{n + 1}, {d + 1}, {d + 1}" for n, d in np.argwhere(loading.held)]
    for name, forces in zip(loading.names, loading.forces, strict=True):
        lines += [f"** load case {name}", "*STEP", "*STATIC", "*CLOAD, OP=NEW"]
        acting = np.argwhere((forces != 0) & ~loading.held)
        lines += [f"{n + 1}, {d + 1}, {forces[n, d]:.12g}" for n, d in acting]
        lines += ["*NODE PRINT, NSET=NALL", "U", "*END STEP"]
    with writing(Path(path)) as partial:
        partial.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _beams(model: BeamModel, element: str) -> list[str]:
    """Beams and their sections: those of one radius and one direction across make a set."""
    ends = np.concatenate([model.elements[::2], model.elements[1::2, 1:]], axis=1)
    sections = model.radii.shape[1]
    weights, radii = model.weights.reshape(-1, 2 * sections), model.radii.reshape(-1, 2 * sections)
    r = (weights.sum(1) / (weights / radii**4).sum(1)) ** 0.25
    r = np.array([float(f"{x:.{RADIUS_DIGITS}g}") for x in r])
    # A section states a direction across its beams: of the global axes the one farthest from them.
    across = np.abs(model.nodes[ends[:, 2]] - model.nodes[ends[:, 0]]).argmin(1)
    lines = []
    for number, (radius, axis) in enumerate(sorted(set(zip(r.tolist(), across.tolist(), strict=True))), 1):
        lines.append(f"*ELEMENT, TYPE={element}, ELSET=E{number}")
        for e in np.flatnonzero((r == radius) & (across == axis)).tolist():
            a, middle, b = ends[e] + 1
            lines.append(f"{e + 1}, {a}, {middle}, {b}")
        lines.append(f"*BEAM SECTION, ELSET=E{number}, MATERIAL=TRUSS, SECTION=CIRC")
        size = f"{2 * radius:.12g}, {2 * radius:.12g}" if element == "B32R" else f"{radius:.12g}"
        lines += [size, ", ".join("1." if k == axis else "0." for k in range(3))]
    return lines
