"""Node spheres: how large a sphere each node needs so that its members leave it side by side, or joined by creases.

At a node with a sphere of radius R, a member of radius r with a fillet of radius f takes a cap of half-angle
a = asin((r + f) / (R + f)); its tube begins at the distance H = sqrt((R + f)^2 - (r + f)^2) along its direction, where
the torus that a ball of radius f rolls between sphere and tube ends. Two members at an angle alpha leave side by side
if alpha >= a_1 + a_2 + `MARGIN`. R grows to make that true, up to `Level.largest_ratio` times the largest radius at the
node. Beyond, the two members are *creased*: both get the same radius r (the largest of the creased ones there), and
their tubes meet in the plane that bisects their directions, where the same ball of radius f rolls along both tubes (see
`creases`; without fillets the edge stays sharp). Their offsets r + f meet in an ellipse whose tip lies
(r + f) / tan(alpha / 2) from the node. Of several equal tubes through one point, the one whose direction is nearest
bounds their union, so that any number of members can be creased.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from michell_cad.arrays import freeze

MARGIN = np.radians(1.0)
"""Angle left free between two caps."""

OVERLAP = np.radians(2.0)
"""Two creased caps overlap by at least this angle: a crease of caps that just touch has edges too short to build."""

SHARPEST_TURN = 0.7
"""The ball that fillets a crease has at most this share of the smallest radius of curvature on its way, which is
(r + f) sin(alpha / 2) at the tip (relative): at 1 its surface would have a cusp."""

CREASE_CLEARANCE = 0.1
"""A creased tube begins this far beyond the tip of its crease (relative to its radius), so that no edge touches it."""

SETTLE = 1.3
"""R of a creased node may grow by this factor until no two of its caps just touch (relative)."""

SMALLEST_RATIO = 1.15
"""Smallest R / r: below it the sphere of a node hardly covers the start of its tubes (relative)."""


@dataclass(frozen=True)
class Level:
    """How much room a node may take: R / r at rest, largest R / r, largest fraction of the wanted fillet."""

    smallest_ratio: float
    largest_ratio: float
    largest_fillet: float


LARGEST_RATIO = 2.5
"""Largest R / r: with the full fillet of 0.4 r enough for 60 degrees. A sphere of 2.5 r weighs as much as 21 r of
member; members at more acute angles are creased, which takes less room and less material."""


def node_levels(node_ratio: float) -> tuple[Level, ...]:
    """From the wanted node to the smallest one, for nodes between which a member has too little room."""
    largest = max(LARGEST_RATIO, node_ratio)
    return (
        Level(node_ratio, largest, 1.0),
        Level(min(node_ratio, 1.5), min(largest, 2.0), 0.5),
        Level(1.25, 1.6, 0.25),
        Level(SMALLEST_RATIO, 1.3, 0.1),
    )


@dataclass(frozen=True, eq=False)
class NodeSizes:
    """Spheres of the nodes and how the ends of the members sit on them; end 2 m + i is at node i of member m.

    Parameters
    ----------
    radius : (n_n,) float, mm, R of the sphere.
    end_radius : (n_e,) float, mm, r of the tube where it leaves the node: larger than wanted at some creased ends.
    fillet : (n_e,) float, mm, f.
    reach : (n_e,) float, mm, distance along the direction of the end at which the tube begins; inf if no sphere fits.
    creased : (n_e,) bool.
    rival : (n_e,) int, the creased end that decides the reach; -1 if the sphere does.
    """

    radius: Float[np.ndarray, " n_n"]
    end_radius: Float[np.ndarray, " n_e"]
    fillet: Float[np.ndarray, " n_e"]
    reach: Float[np.ndarray, " n_e"]
    creased: Bool[np.ndarray, " n_e"]
    rival: Int[np.ndarray, " n_e"]

    def __post_init__(self) -> None:
        freeze(self, radius=np.float64, end_radius=np.float64, fillet=np.float64, reach=np.float64)
        freeze(self, creased=bool, rival=np.int64)


def angles_between(a: Float[np.ndarray, "*i 3"], b: Float[np.ndarray, "*j 3"]) -> Float[np.ndarray, "*k"]:
    """Angles between unit vectors, accurate near 0 and near pi."""
    return 2 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))


def cap_angle(R: np.ndarray | float, r: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Half-angle of the cap that a member takes from the sphere, fillet included."""
    return np.arcsin(np.minimum((r + f) / (R + f), 1.0))
