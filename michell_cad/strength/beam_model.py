"""The truss as a frame of beams: circular sections that may taper, along chords or along the curves of the truss.

An element of a beam is known by its sections at the points of a Gauss-Lobatto rule along its centre line. They serve
twice: its flexibility is an integral over them (see `beam_solver`), and as they include both ends they are also where
forces and stresses are looked at (see `beam_solution`).

The centre lines alone are softer than the solid, whose nodes are balls thicker than the members: by a quarter in
compliance where members are ten radii long. Given the balls' radii, members are as thick as the balls within them.
"""

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from jaxtyping import Float, Int

from michell_cad.arrays import freeze, require
from michell_cad.problem import Material
from michell_cad.splines import MemberSplines, fit_splines
from michell_cad.truss import SizedTruss, Truss, member_radius

PRISMATIC_SECTIONS = 3
"""Sections of a straight element of constant radius: its flexibility is the integral of a quadratic polynomial, which
Lobatto's rule of three points (Simpson's) integrates exactly."""

TAPERED_SECTIONS = 21
"""Sections of a curved or tapered element. The integrand of a taper holds 1 / r^4 with the quartic r of
`member_radius`: this rule errs by 3e-11 where the radius doubles towards the middle, by 2e-8 where it halves."""

JOINT_SECTIONS = 9
"""Further sections at either end within the ball of a node; the rule errs by 1e-6 for balls of 1.8 member radii."""

LARGEST_JOINTS = 0.98
"""Balls at the two ends take at most this share of a member's length; larger ones are cut in proportion."""

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
    stations : (n_e, k) float, where on its member each section is, as a fraction of the arc length.
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
    stations: Float[np.ndarray, "n_e k"]
    radii: Float[np.ndarray, "n_e k"]
    weights: Float[np.ndarray, "n_e k"]
    shear_coefficient: float

    def __post_init__(self) -> None:
        freeze(self, nodes=np.float64, elements=np.int64, member_of_element=np.int64)
        freeze(self, points=np.float64, tangents=np.float64, stations=np.float64, radii=np.float64, weights=np.float64)
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
    joints: Float[np.ndarray, " n_n"] | None = None,
    splines: MemberSplines | None = None,
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
    joints : radius of the ball at each node, mm: members are as thick as the ball within it. Default: no balls.
    splines : of members along their curves, if there are some already.

    Raises
    ------
    InvalidInputError
        For joints of members of several pieces.
    """
    require(pieces >= 1, f"pieces must be at least 1, found {pieces}")
    require(joints is None or pieces == 1, "joints belong to whole members: give pieces = 1")
    truss = sized.truss
    kappa = circle_shear_coefficient(material.poisson_ratio) if shear_coefficient is None else shear_coefficient
    prismatic = straight and bool((sized.radii == sized.radii[:, :1]).all())
    rule = lobatto_rule(PRISMATIC_SECTIONS if prismatic else TAPERED_SECTIONS)
    lines = _Chords(truss) if straight else splines or fit_splines(truss)
    if joints is None:
        s, shares = (np.broadcast_to(x, (len(truss.members), *x.shape)) for x in _equal_pieces(rule, pieces))
        radii = member_radius(sized.radii[:, None, None], s)
    else:
        s, shares, radii = _joined_sections(rule, sized, lines.lengths, joints)
    n_m, k = len(s), s.shape[-1]
    points = lines.positions(s.reshape(n_m, -1)).reshape(n_m, pieces, k, 3)
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
        points=points.reshape(-1, k, 3),
        tangents=lines.tangents(s.reshape(n_m, -1)).reshape(-1, k, 3),
        stations=s.reshape(-1, k),
        radii=radii.reshape(-1, k),
        weights=(lines.lengths[:, None, None] * shares).reshape(-1, k),
        shear_coefficient=float(kappa),
    )


@dataclass(frozen=True, eq=False)
class _Chords:
    """Straight centre lines, with what is asked of `MemberSplines`: these look for the place of an arc length."""

    truss: Truss

    @cached_property
    def ends(self) -> np.ndarray:
        return self.truss.nodes[self.truss.members]

    @cached_property
    def lengths(self) -> np.ndarray:
        return np.linalg.norm(self.ends[:, 1] - self.ends[:, 0], axis=1)

    def positions(self, s: np.ndarray) -> np.ndarray:
        return self.ends[:, None, 0] + s[..., None] * (self.ends[:, 1] - self.ends[:, 0])[:, None]

    def tangents(self, s: np.ndarray) -> np.ndarray:
        direction = (self.ends[:, 1] - self.ends[:, 0]) / self.lengths[:, None]
        return np.repeat(direction[:, None], s.shape[1], axis=1)


def _equal_pieces(rule: tuple[np.ndarray, np.ndarray], pieces: int) -> tuple[np.ndarray, np.ndarray]:
    """Stations and shares of the length of the sections of a member of equal pieces, (pieces, k)."""
    x, w = rule
    return (np.arange(pieces)[:, None] + x) / pieces, np.broadcast_to(w / pieces, (pieces, len(w)))


def _joined_sections(
    rule: tuple[np.ndarray, np.ndarray], sized: SizedTruss, lengths: np.ndarray, joints: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stations, shares of the length and radii of members within balls at their ends, (n_m, 1, k).

    A ball of radius R hides a tube of radius r up to (R^2 - r^2)^(1/2) from its centre; at x its section has the radius
    (R^2 - x^2)^(1/2).
    """
    R, r, L = joints[sized.truss.members], sized.radii[:, [0, 2]], lengths[:, None]
    zones = np.sqrt(np.maximum(R**2 - r**2, 0)) / L
    zones /= np.maximum(zones.sum(1, keepdims=True) / LARGEST_JOINTS, 1)
    first, last = zones[:, :1], zones[:, 1:]
    (x, w), (y, v) = rule, lobatto_rule(JOINT_SECTIONS)
    s = np.concatenate([first * y, first + (1 - first - last) * x, 1 - last * y[::-1]], axis=1)
    shares = np.concatenate([first * v, (1 - first - last) * w, last * v], axis=1)
    radii = member_radius(sized.radii[:, None], s)
    k = JOINT_SECTIONS
    radii[:, :k] = np.maximum(radii[:, :k], np.sqrt(np.maximum(R[:, :1] ** 2 - (s[:, :k] * L) ** 2, 0)))
    radii[:, -k:] = np.maximum(radii[:, -k:], np.sqrt(np.maximum(R[:, 1:] ** 2 - ((1 - s[:, -k:]) * L) ** 2, 0)))
    return s[:, None], shares[:, None], radii[:, None]


@cache
def lobatto_rule(count: int) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
    """Abscissae in [0, 1] and weights of the Gauss-Lobatto rule, which holds both ends; exact to degree 2 k - 3.

    The inner abscissae are the roots of P'_{k-1}, the weights 2 / (k (k - 1) P_{k-1}(x)^2) on [-1, 1] (Abramowitz and
    Stegun, Eq. 25.4.32).
    """
    legendre = np.polynomial.legendre.Legendre.basis(count - 1)
    x = np.concatenate([[-1.0], np.sort(legendre.deriv().roots().real), [1.0]])
    rule = (x + 1) / 2, 1 / (count * (count - 1) * legendre(x) ** 2)
    for array in rule:
        array.flags.writeable = False
    return rule
