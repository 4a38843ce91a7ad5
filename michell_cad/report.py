"""The figures of a design as plain values: `report.json` and the printed summary say the same.

What each figure means is in the docstrings of the functions that compute it (`metrics`, `parametrization.quality`,
`truss.cleaning`, `cad`).
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from michell_cad.linear_solver import solver_name
from michell_cad.parametrization import count_double_wound_edges
from michell_cad.parametrization.spacing_bounds import outside_bounds
from michell_cad.pipeline import Design, StageTime, cells_per_edge
from michell_cad.truss import Truss, interior_degree_6, valences

FORMAT = "michell_cad.report"
VERSION = 1


def report_design(design: Design, truss: Truss, times: Sequence[StageTime] | None = None) -> dict[str, Any]:
    """Report on a design and the truss chosen from it; no CAD is needed.

    Parameters
    ----------
    design : Design
    truss : the part of ``design.truss`` that the knobs have kept.
    times : of all stages run; default: those of the design.
    """
    mesh = design.problem.mesh
    determinants = design.parametrization.determinants
    times = design.times if times is None else times
    return {
        "format": FORMAT,
        "version": VERSION,
        "mesh": {
            "vertices": len(mesh.vertices),
            "tets": len(mesh.tets),
            "volume_mm3": float(mesh.volumes.sum()),
            "cells_per_tet_edge": cells_per_edge(mesh, design.truss.spacing),
        },
        "wall_s": {time.name: time.wall_s for time in times},
        "cpu_s": {time.name: time.cpu_s for time in times},
        "solver": solver_name(),
        "solver_unit_s": design.stress_field.solver_unit,
        "stress": {
            "combination": design.problem.combination,
            "cases": [{"name": case.name, "weight": case.weight} for case in design.problem.load_cases],
            "smoothing_steps": list(design.stress_field.smoothing_steps),
            "smoothing_residuals": list(design.stress_field.smoothing_residuals),
        },
        "parametrization": {
            "inverted_tets": int((determinants <= 0).sum()),
            "min_det_over_median": float(determinants.min() / np.median(determinants)),
            "double_wound_edges": count_double_wound_edges(mesh, design.parametrization.phi),
            "outside_spacing_bounds": _outside_spacing_bounds(design),
        },
        "alignment": asdict(design.alignment),
        "truss": _report_truss(design, truss),
        "summary": {"total_length_mm": float(truss.lengths.sum())},
    }


def _report_truss(design: Design, truss: Truss) -> dict[str, Any]:
    network = design.network
    pairs = Counter(map(tuple, np.sort(truss.members, axis=1).tolist()))
    families = Counter(curve.family for curve in truss.curves)
    return {
        "nodes": len(truss.nodes),
        "members": len(truss.members),
        "spacing_mm": truss.spacing,
        "curves_per_family": dict(sorted(families.items())),
        "interior_degree_6": interior_degree_6(network),
        "valence": {
            "before": _text_keys(valences(network.node_kinds, network.members)),
            "after": _text_keys(valences(truss.node_kinds, truss.members)),
        },
        "duplicate_members": sum(count * (count - 1) // 2 for count in pairs.values()),
        "shortest_member_mm": float(truss.lengths.min()),
        "components": count_components(truss),
        "cleaning": asdict(design.cleaning),
    }


def _outside_spacing_bounds(design: Design) -> float | None:
    """Fraction of the volume where a cell edge is outside of the bounds asked for; None without bounds."""
    bounds = design.options.parametrization.spacing_bounds
    if bounds is None:
        return None
    return outside_bounds(design.parametrization.cell_edges, bounds, design.problem.mesh.volumes)


def count_components(truss: Truss) -> int:
    """Count the connected components of a truss."""
    a, b = truss.members.T
    graph = sp.coo_matrix((np.ones(len(a)), (a, b)), shape=(len(truss.nodes),) * 2)
    labels = connected_components(graph, directed=False)[1]
    return len(np.unique(labels[truss.members[:, 0]]))


def _text_keys(histograms: dict[str, dict[int, int]]) -> dict[str, dict[str, int]]:
    return {where: {str(degree): n for degree, n in sorted(h.items())} for where, h in histograms.items()}
