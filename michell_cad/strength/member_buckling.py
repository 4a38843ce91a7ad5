"""Buckling of the members of a frame one by one, as columns with guided ends.

A column of length L whose ends cannot turn but may shift sideways (both nodes are stiff, one moves) buckles at the same
force as one whose ends turn but do not shift, pi^2 E I / L^2 (Timoshenko and Gere, Theory of Elastic Stability, 1961,
Section 2.1). Where the radius varies the two differ; each is the quotient of Timoshenko's energy method for the mode of
the prismatic column (Section 2.8),

    P = (pi / L)^2 * integral of m^2 / integral of m^2 / (E I),

with the bending moment m = sin(pi s) for pinned ends; for guided ones m = cos(pi s) - c, with c such that the ends have
turned by nothing, integral of m / (E I) = 0, and the mean square of cos(pi s) above. The lower of the two counts; it is
at most a few per cent too high for the tapers that the knobs allow.
"""

import numpy as np
from jaxtyping import Float

from michell_cad.strength.beam_model import BeamModel
from michell_cad.strength.beam_solution import BeamSolution


def critical_forces(model: BeamModel) -> Float[np.ndarray, " n_m"]:
    """Compressive force at which each member buckles by itself, N."""
    return _columns(model)[0]


def critical_force_slopes(model: BeamModel) -> Float[np.ndarray, "n_e k"]:
    """Derivatives of the logarithm of the force at which each member buckles by that of the area of each section.

    The force goes with the quotient's denominator alone, the constant c of the guided column being where it is least:
    a section has a part in it as it has in the integral of m^2 / (E I), and E I goes with the square of the area.
    """
    return 2 * _columns(model)[1]


def _columns(model: BeamModel) -> tuple[Float[np.ndarray, " n_m"], Float[np.ndarray, "n_e k"]]:
    """Critical forces, and the parts of the sections in the integral of m^2 / (E I) of the lower mode."""
    first = model.first_elements
    length = np.add.reduceat(model.lengths, first)
    s = model.stations
    EI = model.material.youngs_modulus * np.pi * model.radii**4 / 4

    def summed(density: np.ndarray) -> np.ndarray:
        return np.add.reduceat((model.weights * density).sum(1), first)

    def of_elements(value: np.ndarray) -> np.ndarray:
        return value[model.member_of_element, None]

    # Integrated alike above and below, so that the result is exact where the radius is constant.
    c, w = np.cos(np.pi * s), np.sin(np.pi * s)
    turned = c - of_elements(summed(c / EI) / summed(1 / EI))
    guided, pinned = summed(c**2) / summed(turned**2 / EI), summed(w**2) / summed(w**2 / EI)
    moment = np.where(of_elements(guided < pinned), turned, w) ** 2 / EI
    share = model.weights * moment / of_elements(summed(moment))
    return (np.pi / length) ** 2 * np.minimum(guided, pinned), share


def member_buckling_factors(solution: BeamSolution, columns: BeamModel | None = None) -> Float[np.ndarray, "n_c n_m"]:
    """Factor of the loads at which each member buckles; inf for members without compression.

    `columns` is the model of the members as columns; default: that of the solution. Members that are thick within the
    balls of their nodes are stiffer columns, but the energy method is good for smooth changes only.
    """
    compression = np.maximum(-solution.axial_force.min(2), 0)
    worst = np.maximum.reduceat(compression, solution.model.first_elements, axis=1)
    with np.errstate(divide="ignore"):
        return critical_forces(columns or solution.model) / worst
