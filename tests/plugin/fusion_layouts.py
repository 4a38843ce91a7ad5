"""A small curved truss for the tests of the Fusion add-in, and its layout file."""

from functools import cache
from pathlib import Path

import numpy as np
from shapes import box_mesh

from michell_cad.curves import Curve, CurveKind
from michell_cad.isocurves import trace_isocurves
from michell_cad.knobs import Knobs, apply_knobs
from michell_cad.splines import fit_splines
from michell_cad.truss import SizedTruss, Truss, build_truss
from michell_cad.truss_json import write_truss_json


@cache
def curved_truss() -> Truss:
    """A truss whose curves are bent, in a box of 24 x 18 x 18 mm with cells of about 6 mm."""
    mesh = box_mesh((8, 6, 6), (24.0, 18.0, 18.0))
    x, y, z = mesh.vertices.T
    bent = np.stack([x + y**2 / 120, y + z**2 / 160, z + x**2 / 200], axis=1)
    return build_truss(trace_isocurves(mesh, bent / 6 + 0.5, ("tension", "compression", "third")), 6.0)


def write_layout(path: Path, knobs: Knobs | None = None, sized: SizedTruss | None = None) -> Path:
    """Write the layout of the curved truss with knobs, or of another sized truss, as michell_cad does."""
    knobs = knobs or Knobs()
    sized = sized or apply_knobs(curved_truss(), knobs)
    write_truss_json(path, sized, fit_splines(sized.truss), knobs)
    return path


def ring_truss() -> Truss:
    """A closed boundary curve of radius 10 mm through eight nodes; an interior curve owns two of its members."""
    angles = np.arange(8) * np.pi / 4
    nodes = 10 * np.stack([np.cos(angles), np.sin(angles), np.zeros(8)], axis=1)
    ends = np.sort(np.stack([np.arange(8), (np.arange(8) + 1) % 8], axis=1), axis=1)
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    number = np.argsort(order)
    ring = Curve(CurveKind.BOUNDARY, "third", 2, (None, None, 0), 0, np.arange(8), number, True)
    part = Curve(CurveKind.INTERIOR, "tension", 0, (None, 1, 0), 0, np.array([3, 4, 5]), number[3:5], False)
    return Truss(nodes, np.ones(8, int), ends[order], (ring, part), 8.0)
