"""The truss as a frame of beams: circular sections that may taper, along chords or along the curves of the truss.

An element of a beam is known by its sections at the points of a Gauss-Lobatto rule along its centre line. They serve
twice: its flexibility is an integral over them (see `beam_solver`), and as they include both ends they are also where
forces and stresses are looked at (see `beam_solution`).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from michell_cad.arrays import freeze, require
from michell_cad.problem import Material
from michell_cad.splines import fit_splines
from michell_cad.truss import SizedTruss, Truss, member_radius

PRISMATIC_SECTIONS = 3
"""Sections of a straight element of constant radius: its flexibility is the integral of a quadratic polynomial, which
Lobatto's rule of three points (Simpson's) integrates exactly."""

TAPERED_SECTIONS = 21
"""Sections of a curved or tapered element. The integrand of a taper holds 1 / r^4 with the quartic r of
`member_radius`: this rule errs by 3e-11 where the radius doubles towards the middle, by 2e-8 where it halves."""

END_TOLERANCE = 1e-9
"""Largest distance between the end of a centre line and its node (relative to the size of the truss)."""


@dataclass(frozen=True, eq=False)
class BeamModel:
    """Elements of circular section with rigid joints.

    Parameters
    ----------
    truss : Truss
    material : Material
    nodes : (n_n, 3) float, mm: the nodes of the truss, then those within its members.
    elements : (n_e, 2) int, first and second node of each element.
    member_of_element : (n_e,) int, ascending. The elements of a member follow one another from its first node to its
        second.
    points : (n_e, k, 3) float, mm, centres of the sections; the first and the last are the two nodes.
    tangents : (n_e, k, 3) float, unit vectors normal to the sections, towards the second node.
    radii : (n_e, k) float, mm.
    weights : (n_e, k) float, mm, of the quadrature over the sections; they add up to the length of the element.
    shear_coefficient : dimensionless, the effective share kappa of the section in transverse shear; inf for beams that
        do not deform in shear (Euler-Bernoulli).
    """

    truss: Truss
    material: Material
    nodes: Float[np.ndarray, "n_n 3"]
    elements: Int[np.ndarray, "n_e 2"]
    member_of_element: Int[np.ndarray, " n_e"]
    points: Float[np.ndarray, "n_e k 3"]
    tangents: Float[np.ndarray, "n_e k 3"]
    radii: Float[np.ndarray, "n_e k"]
    weights: Float[np.ndarray, "n_e k"]
    shear_coefficient: float

    def __post_init__(self) -> None:
        freeze(self, nodes=np.float64, elements=np.int64, member_of_element=np.int64)
        freeze(self, points=np.float64, tangents=np.float64, radii=np.float64, weights=np.float64)
        require(len(self.elements), "a beam model needs at least one member")
        require(self.shear_coefficient > 0, f"shear_coefficient must be positive, found {self.shear_coefficient}")
        require((self.radii > 0).all(), "the radii of a beam must be positive")
        steps = np.diff(self.member_of_element, prepend=-1, append=len(self.truss.members))
        require((steps >= 0).all() and (steps <= 1).all(), "every member needs elements, in the order of the members")
        gap = np.abs(self.points[:, [0, -1]] - self.nodes[self.elements]).max()
        require(gap <= END_TOLERANCE * max(np.ptp(self.nodes, axis=0).max(), gap), "beams must end at their nodes")

    @cached_property
    def lengths(self) -> Float[np.ndarray, " n_e"]:
        """Lengths of the elements along their centre lines, mm."""
        return self.weights.sum(1)

    @cached_property
    def first_elements(self) -> Int[np.ndarray, " n_m"]:
        """The first element of every member."""
        return np.searchsorted(self.member_of_element, np.arange(len(self.truss.members)))

    @cached_property
    def volume(self) -> float:
        """Sum over the members of the integral of pi r^2, mm^3; what members share at nodes counts for each of them."""
        return float(np.pi * (self.weights * self.radii**2).sum())


def circle_shear_coefficient(poisson_ratio: float) -> float:
    """kappa = 6 (1 + nu) / (7 + 6 nu) of a solid circle (Cowper 1966, doi:10.1115/1.3625046, Table 1)."""
    return 6 * (1 + poisson_ratio) / (7 + 6 * poisson_ratio)


def build_beam_model(
    sized: SizedTruss,
    material: Material,
    straight: bool = True,
    pieces: int = 1,
    shear_coefficient: float | None = None,
) -> BeamModel:
    """Make beams of the members of a truss.

    Parameters
    ----------
    sized : SizedTruss
    material : Material
    straight : whether members run along the chords between their nodes, or along their curves.
    pieces : elements of each member, of equal length. One is exact for loads at nodes; more show what happens within
        members (vibration, buckling).
    shear_coefficient : default: `circle_shear_coefficient`.
    """
    require(pieces >= 1, f"pieces must be at least 1, found {pieces}")
    truss = sized.truss
    kappa = circle_shear_coefficient(material.poisson_ratio) if shear_coefficient is None else shear_coefficient
    prismatic = straight and bool((sized.radii == sized.radii[:, :1]).all())
    abscissae, weights = lobatto_rule(PRISMATIC_SECTIONS if prismatic else TAPERED_SECTIONS)
    s = (np.arange(pieces)[:, None] + abscissae) / pieces
    splines = fit_splines(truss, straight)
    n_m, shape = len(truss.members), (len(truss.members) * pieces, len(abscissae))
    points = splines.positions(s.ravel()).reshape(n_m, pieces, -1, 3)
    points[:, 0, 0], points[:, -1, -1] = truss.nodes[truss.members].transpose(1, 0, 2)
    points[:, 1:, 0] = points[:, :-1, -1]
    inner = len(truss.nodes) + np.arange(n_m * (pieces - 1)).reshape(n_m, -1)
    chain = np.concatenate([truss.members[:, :1], inner, truss.members[:, 1:]], axis=1)
    return BeamModel(
        truss=truss,
        material=material,
        nodes=np.concatenate([truss.nodes, points[:, 1:, 0].reshape(-1, 3)]),
        elements=np.stack([chain[:, :-1], chain[:, 1:]], axis=2).reshape(-1, 2),
        member_of_element=np.repeat(np.arange(n_m), pieces),
        points=points.reshape(*shape, 3),
        tangents=splines.tangents(s.ravel()).reshape(*shape, 3),
        radii=member_radius(sized.radii[:, None, None], s).reshape(shape),
        weights=np.repeat(splines.lengths / pieces, pieces)[:, None] * weights,
        shear_coefficient=float(kappa),
    )


def lobatto_rule(count: int) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
    """Abscissae in [0, 1] and weights of the Gauss-Lobatto rule, which holds both ends; exact to degree 2 k - 3.

    The inner abscissae are the roots of P'_{k-1}, the weights 2 / (k (k - 1) P_{k-1}(x)^2) on [-1, 1] (Abramowitz and
    Stegun, Eq. 25.4.32).
    """
    legendre = np.polynomial.legendre.Legendre.basis(count - 1)
    x = np.concatenate([[-1.0], np.sort(legendre.deriv().roots().real), [1.0]])
    return (x + 1) / 2, 1 / (count * (count - 1) * legendre(x) ** 2)
