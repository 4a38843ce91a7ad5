"""How near a frame is to failure, as one smooth number with its derivatives by the areas of all sections.

The largest of many indices has a kink wherever two of them are equal, and at the strongest design many are. Its place
takes the norm (Duysinx and Sigmund 1998, doi:10.2514/6.1998-4906)

    J = (sum over load cases and sections of w s^p + sum over load cases and members of w b^p)^(1/p),

s the von Mises stress at the extreme fibre over the yield strength, b the compression over the force at which the
member buckles by itself, w the share of the length: J tends to the largest index as p grows.

One further solution with the same factor gives all derivatives. With h the force and moment on the second end of an
element, F its flexibility, G u its deformation, and g = dJ/dh at given radii,

    dJ/da = (dJ/da at given forces) - k' (dF/da) h,   k = F^-1 (g - G l),   K l = sum of G' F^-1 g,

and k' F h is the work of one set of forces on the strain of the other: sections of area A give it with 1 / A from axial
and transverse force, and with 1 / A^2 from bending and torsion.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from michell_cad.compiled import compiled
from michell_cad.strength.beam_solution import BeamSolution
from michell_cad.strength.beam_solver import BeamSystem


@dataclass(frozen=True, eq=False)
class FailureNorm:
    """J and its derivatives.

    Parameters
    ----------
    value : J.
    largest : the largest index.
    by_section : (n_e, k), dJ / d log A of every section.
    by_column : (n_e,), dJ / d log of the force at which each element buckles.
    """

    value: float
    largest: float
    by_section: Float[np.ndarray, "n_e k"]
    by_column: Float[np.ndarray, " n_e"]


def failure_norm(
    system: BeamSystem,
    solution: BeamSolution,
    power: float,
    columns: Float[np.ndarray, " n_e"] | None = None,
) -> FailureNorm:
    """J of a solved frame with one element for each member.

    Parameters
    ----------
    system, solution : the frame, and its solution for some load cases.
    power : p.
    columns : compression at which each element buckles, N; default: none does.
    """
    model = solution.model
    critical = np.full(len(model.elements), np.inf) if columns is None else columns
    h = np.ascontiguousarray(solution.end_forces[:, :, 1])
    geometry = (model.nodes[model.elements[:, 1]], model.points, model.tangents, model.radii)
    share = model.weights / model.weights.sum()
    strength = model.material.yield_strength
    top = largest_index(h, *geometry, strength, critical)
    g = np.zeros(h.shape)
    by_section, by_column = np.zeros(model.radii.shape), np.zeros(len(h[0]))
    total = add_indices(h, *geometry, share, strength, critical, top, power, g, by_section, by_column)
    value = top * total ** (1 / power)
    scale = total ** (1 / power - 1)
    forces = np.zeros((len(h), len(model.nodes), 6))
    on_ends = np.einsum("eij,cei->cej", system.end_force, g).reshape(len(h), -1, 2, 6)
    for case, ends in zip(forces, on_ends, strict=True):
        np.add.at(case, model.elements, ends)
    moved = system.of_elements(system.displacements(forces))
    k = np.linalg.solve(system.flexibility, g.transpose(1, 2, 0)).transpose(2, 0, 1)
    k = np.ascontiguousarray(k - np.einsum("eij,cej->cei", system.end_force, moved))
    E, nu = model.material.youngs_modulus, model.material.poisson_ratio
    G = E / (2 * (1 + nu))
    add_work(h, k, *geometry, model.weights, E, G, model.shear_coefficient, by_section)
    return FailureNorm(float(value), float(top), scale * by_section, scale * by_column)


def _section(h: Any, b: Any, x: Any, t: Any) -> Any:
    """Axial force, torque and bending moment (three components) at a section, of the forces on the second end."""
    dx, dy, dz = b[0] - x[0], b[1] - x[1], b[2] - x[2]
    mx = h[3] + dy * h[2] - dz * h[1]
    my = h[4] + dz * h[0] - dx * h[2]
    mz = h[5] + dx * h[1] - dy * h[0]
    N = h[0] * t[0] + h[1] * t[1] + h[2] * t[2]
    T = mx * t[0] + my * t[1] + mz * t[2]
    return N, T, mx - T * t[0], my - T * t[1], mz - T * t[2]


def _largest_index(h: Any, b: Any, x: Any, t: Any, r: Any, strength: float, critical: Any) -> float:
    """Largest of all s and b."""
    top = 0.0
    for c in range(h.shape[0]):
        for e in range(h.shape[1]):
            for k in range(r.shape[1]):
                N, T, mx, my, mz = section(h[c, e], b[e], x[e, k], t[e, k])
                area, modulus = np.pi * r[e, k] ** 2, np.pi * r[e, k] ** 3 / 4
                sigma = abs(N) / area + np.sqrt(mx * mx + my * my + mz * mz) / modulus
                top = max(top, np.sqrt(sigma**2 + 3 * (T / (2 * modulus)) ** 2) / strength, -N / critical[e])
    return top


def _add_indices(
    h: Any,
    b: Any,
    x: Any,
    t: Any,
    r: Any,
    share: Any,
    strength: float,
    critical: Any,
    top: float,
    power: float,
    g: Any,
    by_section: Any,
    by_column: Any,
) -> float:
    """Sum of w (s / top)^p and w (b / top)^p; adds (apart from `scale`) its derivatives at given end forces, and g."""
    total = 0.0
    for e in range(h.shape[1]):
        length = share[e].sum()
        for c in range(h.shape[0]):
            pressed, at = 0.0, 0
            for k in range(r.shape[1]):
                N, T, mx, my, mz = section(h[c, e], b[e], x[e, k], t[e, k])
                if -N > pressed:
                    pressed, at = -N, k
                area, modulus = np.pi * r[e, k] ** 2, np.pi * r[e, k] ** 3 / 4
                M = np.sqrt(mx * mx + my * my + mz * mz)
                axial, bending, tau = abs(N) / area, M / modulus, T / (2 * modulus)
                stress = np.sqrt((axial + bending) ** 2 + 3 * tau**2)
                if stress == 0:
                    continue
                index = stress / strength / top
                slope = share[e, k] * index ** (power - 1)
                total += slope * index
                d_sigma = slope * (axial + bending) / (stress * strength)
                d_tau = slope * 3 * tau / (stress * strength)
                by_section[e, k] -= d_sigma * (axial + 1.5 * bending) + d_tau * 1.5 * tau
                push = d_sigma * np.sign(N) / area
                bend = d_sigma / (modulus * M) if M > 0 else 0.0
                twist = d_tau / (2 * modulus)
                m = (bend * mx + twist * t[e, k, 0], bend * my + twist * t[e, k, 1], bend * mz + twist * t[e, k, 2])
                dx, dy, dz = b[e, 0] - x[e, k, 0], b[e, 1] - x[e, k, 1], b[e, 2] - x[e, k, 2]
                g[c, e, 0] += push * t[e, k, 0] + m[1] * dz - m[2] * dy
                g[c, e, 1] += push * t[e, k, 1] + m[2] * dx - m[0] * dz
                g[c, e, 2] += push * t[e, k, 2] + m[0] * dy - m[1] * dx
                for i in range(3):
                    g[c, e, 3 + i] += m[i]
            index = pressed / critical[e] / top
            slope = length * index ** (power - 1)
            total += slope * index
            by_column[e] -= slope * index * top
            for i in range(3):
                g[c, e, i] -= slope / critical[e] * t[e, at, i]
    return total


def _add_work(
    h: Any, k: Any, b: Any, x: Any, t: Any, r: Any, weights: Any, E: float, G: float, kappa: float, by_section: Any
) -> None:
    """Add -k' (dF / d log A) h of every section: once the work of axial and transverse force, twice that of moments."""
    for e in range(h.shape[1]):
        for c in range(h.shape[0]):
            f, q = h[c, e], k[c, e]
            across = f[0] * q[0] + f[1] * q[1] + f[2] * q[2]
            for j in range(r.shape[1]):
                N, T, mx, my, mz = section(f, b[e], x[e, j], t[e, j])
                n, v, ux, uy, uz = section(q, b[e], x[e, j], t[e, j])
                area = np.pi * r[e, j] ** 2
                inertia = area * r[e, j] ** 2 / 4
                stretching = N * n / (E * area) + (across - N * n) / (kappa * G * area)
                bending = (mx * ux + my * uy + mz * uz) / (E * inertia) + T * v / (2 * G * inertia)
                by_section[e, j] += weights[e, j] * (stretching + 2 * bending)


section = compiled(_section, inline=True)
largest_index = compiled(_largest_index)
add_indices = compiled(_add_indices)
add_work = compiled(_add_work)
