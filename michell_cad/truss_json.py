"""The layout file `truss.json`: versioned, plain JSON in mm, readable without any package.

Hosts that have nothing but a JSON reader draw the truss from it: nodes, members with radii, and every curve with its
label and its cubic B-spline.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from michell_cad.curves import NodeKind
from michell_cad.files import writing
from michell_cad.knobs import Knobs
from michell_cad.splines import MemberSplines, curve_spline
from michell_cad.truss import SizedTruss

FORMAT = "michell_cad.truss"
VERSION = 1
_DECIMALS = 6
"""Lengths are written in mm to this many decimals: a nanometre."""


def truss_to_dict(sized: SizedTruss, splines: MemberSplines, knobs: Knobs) -> dict[str, Any]:
    """Return the layout as plain Python values, ready for JSON."""
    truss = sized.truss
    owner = truss.curve_of_member
    return {
        "format": FORMAT,
        "version": VERSION,
        "units": {"length": "mm"},
        "spacing": round(truss.spacing, _DECIMALS),
        "knobs": knobs.model_dump(mode="json"),
        "families": {
            name: [number for number, curve in enumerate(truss.curves) if curve.family == name]
            for name in dict.fromkeys(curve.family for curve in truss.curves)
        },
        "nodes": [
            {"position": _rounded(position), "kind": NodeKind(kind).name.lower()}
            for position, kind in zip(truss.nodes, truss.node_kinds, strict=True)
        ],
        "members": [
            {"nodes": [int(a), int(b)], "curve": int(curve), "radii": _rounded(radii)}
            for (a, b), curve, radii in zip(truss.members, owner, sized.radii, strict=True)
        ],
        "curves": [
            {
                "name": curve.name,
                "family": curve.family,
                "kind": str(curve.kind),
                "axis": curve.axis,
                "isovalues": list(curve.isovalues),
                "component": curve.component,
                "closed": curve.closed,
                "nodes": curve.nodes.tolist(),
                "members": curve.members.tolist(),
                "spline": _spline(sized, splines, number),
            }
            for number, curve in enumerate(truss.curves)
        ],
    }


def write_truss_json(path: Path, sized: SizedTruss, splines: MemberSplines, knobs: Knobs) -> None:
    """Write the layout file; it appears under its name only when it is complete."""
    text = json.dumps(truss_to_dict(sized, splines, knobs), separators=(",", ":"), allow_nan=False)
    with writing(path) as partial:
        partial.write_text(text, encoding="utf-8")


def _spline(sized: SizedTruss, splines: MemberSplines, number: int) -> dict[str, Any]:
    points, knots, degree = curve_spline(sized.truss, splines, sized.truss.curves[number])
    return {"degree": degree, "knots": _rounded(knots), "control_points": [_rounded(point) for point in points]}


def _rounded(values: np.ndarray) -> list[float]:
    return np.round(values, _DECIMALS).tolist()
