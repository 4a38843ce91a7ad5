"""Input decks of a frame for those who want their own solver: CalculiX, and programs that read Abaqus' beams.

Three kinds of elements. Units: mm, N, MPa.

`B32R`, `B32`: two elements of the beam model become one quadratic beam with a circular section, whose radius has the
same bending flexibility; tapered and curved members want several of them. CalculiX expands these beams into solid
elements, which agree with beams to a per cent or two.

`U1`: CalculiX's own beam of two nodes with six components each (Luo 2008), to all its printed digits. Version 2.20 has
two faults in it, both avoided here:

1. In the plane of its second moment I22 the stiffness between the transverse displacements of the ends has the wrong
   sign. So every beam becomes two elements on the same nodes, each with half the area, all of I11 and next to no I22,
   turned by a quarter against each other: each bends in its sound plane only, and the torsional stiffness, which U1
   takes from I11 + I22, is right in sum.
2. Shear enters by 12 E I - k G A L^2 instead of the sum of the two. So k is very large: Euler-Bernoulli beams.
"""

from pathlib import Path
from typing import Literal, get_args

import numpy as np

from michell_cad.arrays import require
from michell_cad.files import writing
from michell_cad.strength.beam_model import BeamModel
from michell_cad.strength.loads import TrussLoading

BeamElement = Literal["B32R", "B32", "U1"]
"""B32R is what CalculiX recommends, with circles given by two diameters; B32 is what Abaqus knows, with circles given
by the radius; U1 is CalculiX's user element."""

RADIUS_DIGITS = 6
"""Significant digits of the radii; beams whose radii agree to these share a section."""

NO_SHEAR, NO_MOMENT = 1e12, 1e-12
"""Shear coefficient, and I22 over I11, of the elements U1: their errors are of these orders, far below seven digits."""


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
        element == "U1" or not odd.any(),
        f"decks of quadratic beams need an even number of pieces; {odd.sum()} members have an odd one",
    )
    used = np.unique(model.elements)
    lines = ["** rigid-jointed truss; mm, N, MPa", "*NODE, NSET=NALL"]
    lines += [f"{n + 1}, {x:.12g}, {y:.12g}, {z:.12g}" for n, (x, y, z) in zip(used, model.nodes[used], strict=True)]
    lines += _user_beams(model) if element == "U1" else _quadratic_beams(model, element)
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


def _quadratic_beams(model: BeamModel, element: str) -> list[str]:
    """Beams and their sections: those of one radius and one direction across make a set."""
    ends = np.concatenate([model.elements[::2], model.elements[1::2, 1:]], axis=1)
    sections = model.radii.shape[1]
    r = _equal_radii(model.weights.reshape(-1, 2 * sections), model.radii.reshape(-1, 2 * sections))
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


def _user_beams(model: BeamModel) -> list[str]:
    """Two elements U1 for each element of the model, with sections of their own, see the module's docstring."""
    r = _equal_radii(model.weights, model.radii)
    area, moment = np.pi * r**2, np.pi * r**4 / 4
    a, b = model.nodes[model.elements].transpose(1, 0, 2)
    x = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
    y = np.cross(np.eye(3)[np.abs(x).argmin(1)], x)
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    lines = ["*USER ELEMENT, TYPE=U1, NODES=2, INTEGRATION POINTS=2, MAXDOF=6"]
    for e, (first, second) in enumerate((model.elements + 1).tolist()):
        for half, axis in enumerate((y[e], np.cross(x[e], y[e])), 1):
            name = f"E{e + 1}_{half}"
            lines += [f"*ELEMENT, TYPE=U1, ELSET={name}", f"{2 * e + half}, {first}, {second}"]
            lines += [f"*BEAM SECTION, ELSET={name}, MATERIAL=TRUSS, SECTION=GENERAL"]
            lines += [f"{area[e] / 2:.12g}, {moment[e]:.12g}, 0., {NO_MOMENT * moment[e]:.12g}, {NO_SHEAR:g}"]
            lines += [", ".join(f"{value:.12g}" for value in axis)]
    return lines


def _equal_radii(weights: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Radii of prismatic beams of the same bending flexibility: the mean of r^-4 along each."""
    return (weights.sum(1) / (weights / radii**4).sum(1)) ** 0.25
