"""How well frames, curves and trusses follow the stress: every figure of the report that is not a count.

The paper's Table 2 (Arora et al. 2019, Section 5.1 and 5.2), and beside each of its figures an honest one: its
misalignment measures noise where two principal stresses coincide, its mean angle is 90 degrees always. All means over
the part are weighted by volume times |dev sigma|, so that tets without a direction have no say.
"""

from dataclasses import dataclass
from itertools import permutations, product
from typing import Any

import numpy as np
from jaxtyping import Float

from michell_cad.compiled import compiled
from michell_cad.curves import KINDS, CurveKind, NodeKind
from michell_cad.deviator import deviator
from michell_cad.frame_field import FrameField
from michell_cad.isocurves import CurveNetwork
from michell_cad.parametrization import Parametrization
from michell_cad.tet_mesh import TetMesh

DISTINCT_GAP = 0.1
"""Principal stresses count as distinct when both gaps exceed this fraction of |dev sigma| (Frobenius)."""

_MANDEL = (((0, 0), 1.0), ((1, 1), 1.0), ((2, 2), 1.0), ((1, 2), 2**0.5), ((0, 2), 2**0.5), ((0, 1), 2**0.5))
"""Components of a symmetric tensor and their factors in Mandel's notation, which keeps the Frobenius product."""


@dataclass(frozen=True)
class Alignment:
    """The `alignment` block of the report; each pair is mean and standard deviation, in degrees."""

    frame_shear_residual: float
    curve_shear_residual: float
    uncarried_stress: float
    spacing_p99: float
    misalignment_deg: tuple[float, float]
    misalignment_distinct_deg: tuple[float, float] | None
    angle_deg: tuple[float, float] | None


def measure_alignment(
    stress: Float[np.ndarray, "n_t 3 3"],
    frame_field: FrameField,
    parametrization: Parametrization,
    network: CurveNetwork,
) -> Alignment:
    """Measure how frames and curves follow the stress; see the functions of this module."""
    mesh = parametrization.mesh
    angles = misalignment(stress, frame_field.frames)
    distinct = angles[distinct_directions(stress)]
    between = angles_between_families(network)
    edges = parametrization.cell_edges
    return Alignment(
        shear_residual(mesh, stress, frame_field.frames),
        shear_residual(mesh, stress, parametrization.tangents),
        uncarried_stress(mesh, stress, parametrization.tangents),
        float(np.quantile(edges, 0.99) / np.median(edges)),
        _mean_and_deviation(angles),
        _mean_and_deviation(distinct) if len(distinct) else None,
        _mean_and_deviation(between) if len(between) else None,
    )


def name_families(
    mesh: TetMesh, stress: Float[np.ndarray, "n_t 3 3"], tangents: Float[np.ndarray, "n_t 3 3"]
) -> tuple[str, str, str]:
    """Name the family of curves along each coordinate by the mean over the part of its axial stress b' sigma b.

    The highest mean is `tension`, the lowest `compression`, the remaining one `third`.
    """
    axial = add_axial_stress(mesh.volumes, stress, tangents)
    names = ["third"] * 3
    names[int(np.argmax(axial))] = "tension"
    # The last of equal values, so that a part without stress has two different families, too.
    names[2 - int(np.argmin(axial[::-1]))] = "compression"
    return names[0], names[1], names[2]


def _add_axial_stress(volumes: Any, stress: Any, directions: Any) -> Any:
    """Sum over the tets t of v_t b_i' sigma_t b_i, for each of the three directions (columns) b_i."""
    total = np.zeros(3)
    for t in range(len(volumes)):
        for i in range(3):
            for d in range(3):
                along = 0.0
                for e in range(3):
                    along += stress[t, d, e] * directions[t, e, i]
                total[i] += volumes[t] * directions[t, d, i] * along
    return total


add_axial_stress = compiled(_add_axial_stress)


def shear_residual(
    mesh: TetMesh, stress: Float[np.ndarray, "n_t 3 3"], directions: Float[np.ndarray, "n_t 3 3"]
) -> float:
    """< |offdiag(B' sigma B)|_F / |dev sigma|_F >, B the unit directions (columns): 0 for principal directions.

    For directions that are not orthogonal dev sigma takes the place of sigma, so that pressure does not count as shear.
    """
    dev = deviator(stress)
    S = np.einsum("tij,tik,tkl->tjl", directions, dev, directions, optimize=True)
    shear = np.sqrt(2 * (S[:, 0, 1] ** 2 + S[:, 0, 2] ** 2 + S[:, 1, 2] ** 2))
    total = mesh.volumes @ np.linalg.norm(dev, axis=(1, 2))
    return float(mesh.volumes @ shear / total) if total > 0 else 0.0


def rms_shear(mesh: TetMesh, stress: Float[np.ndarray, "n_t 3 3"], directions: Float[np.ndarray, "n_t 3 3"]) -> float:
    """(sum v |offdiag(B' dev sigma B)|_F^2 / sum v |dev sigma|_F^2)^(1/2), B the unit directions (columns).

    The root mean square, which energy goes with, where `shear_residual` is a mean.
    """
    dev = deviator(stress)
    S = np.einsum("tij,tik,tkl->tjl", directions, dev, directions, optimize=True)
    shear = 2 * (S[:, 0, 1] ** 2 + S[:, 0, 2] ** 2 + S[:, 1, 2] ** 2)
    total = mesh.volumes @ (dev**2).sum((1, 2))
    return float(np.sqrt(mesh.volumes @ shear / total)) if total > 0 else 0.0


def uncarried_stress(
    mesh: TetMesh, stress: Float[np.ndarray, "n_t 3 3"], directions: Float[np.ndarray, "n_t 3 3"]
) -> float:
    """Share of the stress that bars along the three directions cannot carry, whatever their areas.

    sum v |sigma - P sigma|_F / sum v |sigma|_F with P the orthogonal projection on the span of b_i b_i'.
    """
    rest = stress - project_on_bars(stress, directions)
    total = mesh.volumes @ np.linalg.norm(stress, axis=(1, 2))
    return float(mesh.volumes @ np.linalg.norm(rest, axis=(1, 2)) / total) if total > 0 else 0.0


def project_on_bars(
    stress: Float[np.ndarray, "n 3 3"], directions: Float[np.ndarray, "n 3 3"]
) -> Float[np.ndarray, "n 3 3"]:
    """P sigma: the part of the stress that bars along the three directions (columns) can carry."""
    basis = np.stack([c * directions[:, i] * directions[:, j] for (i, j), c in _MANDEL], axis=1)
    sigma = np.stack([c * stress[:, i, j] for (i, j), c in _MANDEL], axis=1)
    # Orthonormal columns; directions that coincide leave a smaller span, which QR handles.
    Q, _ = np.linalg.qr(basis)
    carried = np.einsum("tij,tj->ti", Q, np.einsum("tij,ti->tj", Q, sigma))
    result = np.empty_like(stress)
    for k, ((i, j), c) in enumerate(_MANDEL):
        result[:, i, j] = result[:, j, i] = carried[:, k] / c
    return result


def misalignment(
    stress: Float[np.ndarray, "n_t 3 3"], frames: Float[np.ndarray, "n_t 3 3"]
) -> Float[np.ndarray, " n_t"]:
    """The paper's: angle (degrees) of the smallest rotation between frame and principal directions, Section 5.1.

    Smallest over the 24 octahedral symmetries: theta = arccos((tr(Q' O R) - 1)/2), the largest trace.
    """
    _, Q = np.linalg.eigh(stress)
    Q[:, :, 0] *= np.linalg.det(Q)[:, None]
    relative = np.swapaxes(Q, 1, 2) @ frames
    trace = np.max([np.einsum("tij,ij->t", relative, O) for O in octahedral_group()], axis=0)
    return np.degrees(np.arccos(np.clip((trace - 1) / 2, -1, 1)))


def distinct_directions(stress: Float[np.ndarray, "n_t 3 3"]) -> np.ndarray:
    """Mask of the tets whose principal stresses are distinct, see `DISTINCT_GAP`."""
    gaps = np.diff(np.linalg.eigvalsh(stress), axis=1).min(1)
    return gaps > DISTINCT_GAP * np.linalg.norm(deviator(stress), axis=(1, 2))


def octahedral_group() -> Float[np.ndarray, "24 3 3"]:
    """The 24 rotations that map the coordinate axes to coordinate axes."""
    matrices = [
        np.diag(signs)[list(order)] for order in permutations(range(3)) for signs in product((1.0, -1.0), repeat=3)
    ]
    return np.array([matrix for matrix in matrices if np.linalg.det(matrix) > 0])


def angles_between_families(network: CurveNetwork) -> Float[np.ndarray, " k"]:
    """Angles (degrees) between members of different families at the interior nodes of the traced network.

    Paper, Section 5.2: at each interior node all pairs of members that belong to different families of interior curves.
    """
    curves = network.curves
    axis = np.full(len(network.members), -1)
    along = np.where(curves.kinds == KINDS.index(CurveKind.INTERIOR), curves.axes, -1)
    axis[curves.members] = np.repeat(along, np.diff(curves.member_offsets))
    vectors = network.nodes[network.members[:, 1]] - network.nodes[network.members[:, 0]]
    ends = np.concatenate([network.members[:, 0], network.members[:, 1]])
    outwards = np.concatenate([vectors, -vectors])
    axes = np.concatenate([axis, axis])
    use = (axes >= 0) & (network.node_kinds[ends] == NodeKind.INTERIOR) & (np.linalg.norm(outwards, axis=1) > 0)
    ends, outwards, axes = ends[use], outwards[use], axes[use]
    outwards = outwards / np.linalg.norm(outwards, axis=1, keepdims=True)
    order = np.lexsort((axes, ends))
    ends, outwards, axes = ends[order], outwards[order], axes[order]
    result = []
    for shift in range(1, 6):  # six members at most meet in an interior node
        pair = (ends[:-shift] == ends[shift:]) & (axes[:-shift] != axes[shift:])
        result.append(np.einsum("kd,kd->k", outwards[:-shift][pair], outwards[shift:][pair]))
    return np.degrees(np.arccos(np.clip(np.concatenate(result), -1, 1)))


def _mean_and_deviation(values: np.ndarray) -> tuple[float, float]:
    return float(values.mean()), float(values.std())
