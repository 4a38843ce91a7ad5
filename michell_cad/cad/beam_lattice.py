"""3MF beam lattices: every member as straight beams with a radius at both ends, for programs that compute with struts.

Source: 3MF Consortium, Beam Lattice Extension 1.1 (namespace 2017/02). Nodes are shared vertices; beams end in spheres
of their own radius. The fillets and the larger spheres of the nodes have no place in such a file, nor have colours:
lib3mf 2.5, the reader that most programs build on, refuses the attributes that the extension has for them. So families
and curves are told apart by sets of beams.
"""

from collections.abc import Callable
from dataclasses import dataclass
from io import TextIOWrapper
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
from jaxtyping import Float, Int

from michell_cad.arrays import freeze
from michell_cad.cad.prepared import PreparedTruss
from michell_cad.cad.solid import TrussSolid
from michell_cad.cad.threemf import CORE, VERTEX, model_file, write_rows
from michell_cad.files import path_with_suffix, writing
from michell_cad.palette import GROUPS

BEAMS = "http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02"

MIN_LENGTH = 1e-4
"""mm; beams shorter than this would be ignored. None is."""

BEAM = '<b:beam v1="%d" v2="%d" r1="%.7g" r2="%.7g"/>\n'


@dataclass(frozen=True, eq=False)
class BeamLattice:
    """Straight beams along the members.

    Parameters
    ----------
    vertices : (n, 3) float, mm.
    beams : (k, 2) int.
    radii : (k, 2) float, mm, at both ends.
    member : (k,) int, the member of each beam, ascending.
    """

    vertices: Float[np.ndarray, "n 3"]
    beams: Int[np.ndarray, "k 2"]
    radii: Float[np.ndarray, "k 2"]
    member: Int[np.ndarray, " k"]

    def __post_init__(self) -> None:
        freeze(self, vertices=np.float64, beams=np.int64, radii=np.float64, member=np.int64)


def sample_beams(prepared: PreparedTruss) -> BeamLattice:
    """Cut every member into straight beams: one if it is a cylinder, else one for each span between its tube's circles.

    Between node and first circle runs a beam more. The ends of all beams lie on the spine of their member.
    """
    truss, tubes = prepared.sized.truss, prepared.tubes
    used, ends = np.unique(truss.members, return_inverse=True)
    ends = ends.reshape(-1, 2)
    count = np.where(tubes.straight, 0, tubes.sections)
    first = len(used) + np.r_[0, np.cumsum(count)]
    inner, radius = np.zeros((first[-1] - len(used), 3)), np.zeros(first[-1] - len(used))
    for k in np.unique(count[count > 0]).tolist():
        members, t = np.flatnonzero(count == k), np.linspace(0, 1, k)
        some = tubes.some(members)
        rows = (first[members] - len(used))[:, None] + np.arange(k)
        inner[rows], radius[rows] = some.spine_points(t), some.radii_at(t)
    beams, radii = [], []
    at_ends = prepared.sizes.end_radius.reshape(-1, 2)
    for m, (a, b) in enumerate(ends.tolist()):
        chain = np.r_[a, np.arange(first[m], first[m + 1]), b]
        r = np.r_[at_ends[m, 0], radius[first[m] - len(used) : first[m + 1] - len(used)], at_ends[m, 1]]
        beams.append(np.stack([chain[:-1], chain[1:]], axis=1))
        radii.append(np.stack([r[:-1], r[1:]], axis=1))
    return BeamLattice(
        np.concatenate([truss.nodes[used], inner]),
        np.concatenate(beams),
        np.concatenate(radii),
        np.repeat(np.arange(len(ends)), count + 1),
    )


def export_beam_lattice(solid: TrussSolid, path: str | Path, progress: Callable[[float], None] | None = None) -> None:
    """Write the members as a 3MF beam lattice, in mm, with a set of beams for each family and for each curve.

    The file is there whole or not at all, and the same bytes for the same truss.

    Raises
    ------
    InvalidInputError
        For another extension than .3mf, and if the file cannot be written.
    """
    path = path_with_suffix(path, ".3mf")
    lattice, truss = sample_beams(solid.prepared), solid.prepared.sized.truss
    families = [group for group in GROUPS if any(curve.family == group for curve in truss.curves)]
    curve = truss.curve_of_member[lattice.member]
    family = np.array([families.index(one.family) for one in truss.curves])[curve]
    attributes = {"xmlns": CORE, "xmlns:b": BEAMS, "requiredextensions": "b"}
    with writing(path) as partial, model_file(partial, attributes) as file:
        file.write("<resources>\n")
        file.write('<object id="1" type="model" name="truss"><mesh>\n')
        write_rows(file, "vertices", VERTEX, lattice.vertices)
        radius = float(lattice.radii.min())
        file.write(f'<triangles/>\n<b:beamlattice minlength="{MIN_LENGTH}" radius="{radius:.7g}" cap="sphere">\n')
        write_rows(file, "b:beams", BEAM, np.concatenate([lattice.beams, lattice.radii], axis=1))
        file.write("<b:beamsets>\n")
        for k, name in enumerate(families):
            _write_set(file, name, name, np.flatnonzero(family == k))
        order = np.argsort(curve, kind="stable")
        bounds = np.searchsorted(curve[order], np.arange(len(truss.curves) + 1))
        for c, one in enumerate(truss.curves):
            if bounds[c] < bounds[c + 1]:
                _write_set(file, one.name, f"curve {c}", order[bounds[c] : bounds[c + 1]])
        file.write("</b:beamsets>\n</b:beamlattice></mesh></object>\n</resources>\n")
        file.write('<build><item objectid="1"/></build>\n')
    if progress is not None:
        progress(1.0)


def _write_set(file: TextIOWrapper, name: str, identifier: str, beams: np.ndarray) -> None:
    references = "".join(f'<b:ref index="{k}"/>' for k in beams.tolist())
    file.write(f"<b:beamset name={quoteattr(name)} identifier={quoteattr(identifier)}>{references}</b:beamset>\n")
