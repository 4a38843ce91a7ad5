"""A small curved truss for the tests of the Fusion add-in, and its layout file."""

from functools import cache
from pathlib import Path

import numpy as np
from shapes import box_mesh

from michell_cad.isocurves import trace_isocurves
from michell_cad.knobs import Knobs, apply_knobs
from michell_cad.splines import fit_splines
from michell_cad.truss import SizedTruss, Truss, build_truss
from michell_cad.truss_json import write_truss_json


@cache
def curved_truss() -> Truss:
    """A truss whose curves are bent, in a box of 36 x 30 x 24 mm with cells of about 6 mm."""
    mesh = box_mesh((12, 10, 8), (36.0, 30.0, 24.0))
    x, y, z = mesh.vertices.T
    bent = np.stack([x + y**2 / 120, y + z**2 / 160, z + x**2 / 200], axis=1)
    return build_truss(trace_isocurves(mesh, bent / 6 + 0.5, ("tension", "compression", "third")), 6.0)


def write_layout(path: Path, knobs: Knobs | None = None, sized: SizedTruss | None = None) -> Path:
    """Write the layout of the curved truss with knobs, or of another sized truss, as michell_cad does."""
    knobs = knobs or Knobs()
    sized = sized or apply_knobs(curved_truss(), knobs)
    write_truss_json(path, sized, fit_splines(sized.truss), knobs)
    return path
