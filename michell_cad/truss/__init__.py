"""The truss: its values, and what is done to it (cleaning a traced network, keeping some of the curves)."""

from michell_cad.curves import FAMILIES, Curve, CurveKind, Isovalues, NodeKind
from michell_cad.truss.cleaning import (
    CleaningReport,
    TrussOptions,
    build_truss,
    clean_network,
    interior_degree_6,
    valences,
)
from michell_cad.truss.cutting import keep_members, open_ends, take_curves, without_loose
from michell_cad.truss.subset import keep_curves
from michell_cad.truss.values import SizedTruss, Truss, member_radius

__all__ = [
    "FAMILIES",
    "CleaningReport",
    "Curve",
    "CurveKind",
    "Isovalues",
    "NodeKind",
    "SizedTruss",
    "Truss",
    "TrussOptions",
    "build_truss",
    "clean_network",
    "interior_degree_6",
    "keep_curves",
    "keep_members",
    "member_radius",
    "open_ends",
    "take_curves",
    "valences",
    "without_loose",
]
