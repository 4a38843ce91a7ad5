"""The shell of a truss as tables: points, curves, edges, surfaces, faces, and the edges along each face.

Everything that the kernel has to be told, and nothing of the kernel: `kernel.make_solids` walks these tables once.
Directions are unit vectors, lengths mm, angles radians. Frames are right-handed: y = axis x zero.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from jaxtyping import Bool, Float, Int

from michell_cad.arrays import freeze


class CurveForm(IntEnum):
    """The 3-D curve of an edge."""

    NONE = 0
    """A degenerated edge at the pole of a sphere."""
    CONIC = 1
    """A circle or ellipse of `Frames`: origin + radii[0] cos(t) zero + radii[1] sin(t) y."""
    LINE = 2
    """origin + t axis of `Frames`."""
    TUBE_SEAM = 3
    """The curve of the first row of poles of a tube."""


class SurfaceForm(IntEnum):
    """The surface of a face."""

    SPHERE = 0
    TORUS = 1
    CYLINDER = 2
    TUBE = 3
    STRIP = 4
    """The fillet between two tubes, of `Strips`."""
    PLANE = 5


class PcurveForm(IntEnum):
    """The curve of an edge in the parameters of a face."""

    LINE = 0
    """origin + t direction."""
    TUBE_START = 1
    """The whole circle at the start of a tube, counted along its angle."""
    TUBE_END = 2
    """The whole circle at the end of a tube, counted against its angle."""
    TUBE_TOP = 3
    """The whole circle at the end of a tube, or an arc of it, counted along its angle."""
    PLANAR = 4
    """None is needed: the face is plane."""
    FITTED = 5
    """A spline on the knots of the first of `fits.FITS`, stretched to the range of the edge; 6 for the second, ..."""


class FaceRole(IntEnum):
    """What a face is of: its owner is a node, an end of a member (2 m + i), a member, or a solid that was kept."""

    NODE = 0
    FILLET = 1
    MITRE = 2
    MEMBER = 3
    KEPT = 4


@dataclass(frozen=True, eq=False)
class Frames:
    """Placements with up to two radii each."""

    origins: Float[np.ndarray, "n 3"]
    axes: Float[np.ndarray, "n 3"]
    zeros: Float[np.ndarray, "n 3"]
    radii: Float[np.ndarray, "n 2"]

    def __post_init__(self) -> None:
        freeze(self, origins=np.float64, axes=np.float64, zeros=np.float64, radii=np.float64)


@dataclass(frozen=True, eq=False)
class Edges:
    """`curve` numbers a frame or a tube as `form` says; `ends` are points; `ranges` of the parameter, ascending."""

    form: Int[np.ndarray, " n"]
    curve: Int[np.ndarray, " n"]
    ranges: Float[np.ndarray, "n 2"]
    ends: Int[np.ndarray, "n 2"]
    tolerance: Float[np.ndarray, " n"]

    def __post_init__(self) -> None:
        freeze(self, form=np.int64, curve=np.int64, ranges=np.float64, ends=np.int64, tolerance=np.float64)


@dataclass(frozen=True, eq=False)
class Faces:
    """`surface` numbers a frame or a tube as `form` says; `reversed_` if material lies on the side of its normal."""

    form: Int[np.ndarray, " n"]
    surface: Int[np.ndarray, " n"]
    reversed_: Bool[np.ndarray, " n"]
    role: Int[np.ndarray, " n"]
    owner: Int[np.ndarray, " n"]
    component: Int[np.ndarray, " n"]

    def __post_init__(self) -> None:
        freeze(self, form=np.int64, surface=np.int64, reversed_=bool, role=np.int64, owner=np.int64)
        freeze(self, component=np.int64)


@dataclass(frozen=True, eq=False)
class Coedges:
    """Edges along the wires of faces, sorted by face, wire and order; the face lies to the left of a forward edge.

    `pcurve` numbers an entry of `pcurve_lines` or `pcurve_poles` of the plan as `form` says.
    """

    face: Int[np.ndarray, " n"]
    wire: Int[np.ndarray, " n"]
    edge: Int[np.ndarray, " n"]
    reversed_: Bool[np.ndarray, " n"]
    form: Int[np.ndarray, " n"]
    pcurve: Int[np.ndarray, " n"]

    def __post_init__(self) -> None:
        freeze(self, face=np.int64, wire=np.int64, edge=np.int64, reversed_=bool, form=np.int64, pcurve=np.int64)


@dataclass(frozen=True, eq=False)
class Strips:
    """Splines, rational quadratic across and of the given degree along, with their knots along.

    `weights` belong to the middle rows of poles, the others have the weight 1.
    """

    poles: Float[np.ndarray, "n 3 c 3"]
    weights: Float[np.ndarray, "n c"]
    knots: Float[np.ndarray, "n k"]
    degree: int

    def __post_init__(self) -> None:
        freeze(self, poles=np.float64, weights=np.float64, knots=np.float64)


@dataclass(frozen=True, eq=False)
class ShellPlan:
    """The tables of one truss.

    `pcurve_lines` holds origin and direction, (n, 2, 2); `pcurve_poles` the poles of fitted pcurves, by fit;
    `tube_poles` the poles of each tube (9, k + 2, 3); `tolerance` (mm) that of faces and vertices.
    """

    points: Float[np.ndarray, "n_p 3"]
    frames: Frames
    edges: Edges
    faces: Faces
    coedges: Coedges
    pcurve_lines: Float[np.ndarray, "n_l 2 2"]
    pcurve_poles: tuple[Float[np.ndarray, "_ _ 2"], ...]
    strips: Strips
    tube_poles: tuple[np.ndarray, ...]
    tolerance: float
    components: int

    def __post_init__(self) -> None:
        freeze(self, points=np.float64, pcurve_lines=np.float64)
