"""How far the centre lines as built run from the design curves, and what the changes to the truss moved.

A centre line runs straight from its node to the circle where its tube begins, then along the spine of the tube.
"""

import numpy as np
from jaxtyping import Float
from scipy.spatial import KDTree

from michell_cad.cad.centerlines import sample_splines
from michell_cad.cad.prepared import PreparedTruss
from michell_cad.splines import fit_splines
from michell_cad.truss import SizedTruss

STEM_POINTS = 4
"""Points on each straight piece between node and circle."""


def built_lines(prepared: PreparedTruss, spine_points: int) -> Float[np.ndarray, "n_m k 3"]:
    """Points along the centre lines as built, from the first node of each member to the second."""
    nodes = prepared.sized.truss.nodes[prepared.sized.truss.members]
    spines = prepared.tubes.spine_points(np.linspace(0, 1, spine_points))
    t = np.arange(STEM_POINTS)[:, None] / STEM_POINTS
    first = nodes[:, :1] + t * (spines[:, :1] - nodes[:, :1])
    last = nodes[:, 1:] + t * (spines[:, -1:] - nodes[:, 1:])
    return np.concatenate([first, spines, last[:, ::-1]], axis=1)


def curve_deviation(prepared: PreparedTruss) -> Float[np.ndarray, " n_m"]:
    """Largest distance of each centre line as built from the design curve of its member, mm, by samples on both.

    The design curves are those of the truss as built; `design_gaps` measures what merging nodes moved before.
    """
    design = prepared.design.points
    built = built_lines(prepared, design.shape[1] // 2 + 1)
    worst = np.zeros(len(design))
    for k in range(built.shape[1]):
        away = np.full(len(design), np.inf)
        for a, b in zip(design[:, :-1].transpose(1, 0, 2), design[:, 1:].transpose(1, 0, 2), strict=True):
            away = np.minimum(away, _from_segments(built[:, k], a, b))
        worst = np.maximum(worst, away)
    return worst


def design_gaps(sized: SizedTruss, prepared: PreparedTruss) -> Float[np.ndarray, " n_m"]:
    """Largest distance of each design curve of a truss from the nearest centre line of the solid, mm.

    It covers what `curve_deviation` does not see: nodes that were merged and members that were led another way. The
    nearest point built may be on another member.
    """
    design = sample_splines(fit_splines(sized.truss)).points.reshape(-1, 3)
    built = built_lines(prepared, prepared.design.points.shape[1])
    k = built.shape[1]
    nearest = KDTree(built.reshape(-1, 3)).query(design)[1]
    m, at = nearest // k, nearest % k
    before, behind = (
        _from_segments(design, built[m, i], built[m, i + 1]) for i in (np.maximum(at - 1, 0), np.minimum(at, k - 2))
    )
    return np.minimum(before, behind).reshape(len(sized.truss.members), -1).max(1)


def _from_segments(points: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Distance of each point from its segment a-b."""
    edge = b - a
    t = np.clip(((points - a) * edge).sum(1) / np.maximum((edge**2).sum(1), 1e-300), 0, 1)
    return np.linalg.norm(points - a - t[:, None] * edge, axis=1)
