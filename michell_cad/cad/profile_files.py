"""Outlines of profiles from CAD: DXF, SVG, STEP and BREP files, CadQuery and build123d sketches, faces and wires.

Lines stay lines. Any other edge becomes cubic Bézier pieces with its points and tangents at their ends, through its
middle, as many as it takes to follow it; of a circle, eight. Size and place do not matter: a profile is scaled to the
area that a radius stands for.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from michell_cad.arrays import require
from michell_cad.errors import InvalidInputError
from michell_cad.profile_source import PROFILE_SUFFIXES
from michell_cad.profiles import Row, outline_profile

if TYPE_CHECKING:
    import cadquery as cq

FOLLOWED = 1e-4
"""Pieces may leave their edge by so much (relative to the size of the outline)."""

MOST_PIECES = 32
"""Of one edge."""

CLOSED = 1e-4
"""Ends of edges nearer than this meet (relative to the size of the outline)."""


def read_profile(path: str | Path) -> tuple[Row, ...]:
    """The one closed outline in a .dxf, .svg, .step or .brep file, for the knob `profile`.

    Raises
    ------
    InvalidInputError
        If the file is missing or cannot be read, and as for `profile_from_cad`.
    """
    import build123d as bd
    import cadquery as cq

    path = Path(path)
    suffix = path.suffix.lower()
    require(
        suffix in PROFILE_SUFFIXES, f"{path}: a profile is read from {' '.join(PROFILE_SUFFIXES)}, not from {suffix!r}"
    )
    require(path.is_file(), f"{path}: there is no such file; expected the outline of a profile")
    try:
        if suffix == ".dxf":
            shapes = cq.importers.importDXF(str(path)).vals()
        elif suffix == ".svg":
            shapes = list(bd.import_svg(str(path)))
        elif suffix in (".step", ".stp"):
            shapes = cq.importers.importStep(str(path)).vals()
        else:
            shapes = [cq.Shape.importBrep(str(path))]
    except (ValueError, OSError, RuntimeError, SyntaxError) as error:  # an SVG file that is not XML is the last
        raise InvalidInputError(f"{path}: cannot be read ({error}); export the outline again") from error
    return profile_from_cad(shapes, path.name)


def profile_from_cad(shape: Any, name: str = "profile") -> tuple[Row, ...]:
    """The outline of a CadQuery or build123d sketch, face, wire, or edges that make one; for the knob `profile`.

    Raises
    ------
    InvalidInputError
        If there is no outline, an open one, several, one with holes, or one that is not plane or crosses itself.
    """
    wire = _only_wire(_shapes(shape, name), name)
    edges = [edge for edge in wire]
    require(
        wire.IsClosed(),
        f"{name}: the outline is open: its {len(edges)} edges do not come back to where they begin; join the ends, or "
        "add the missing edge",
    )
    try:
        import cadquery as cq

        plane = cq.Plane(wire.Center(), normal=cq.Face.makeFromWires(wire).normalAt())
    except ValueError as error:
        raise InvalidInputError(f"{name}: the outline is not plane ({error}); draw it in one plane") from error
    flat = _Flat(plane)
    size = max(wire.BoundingBox().xlen, wire.BoundingBox().ylen, wire.BoundingBox().zlen)
    rows: list[Row] = []
    pieces = _oriented([_edge_pieces(edge, flat, FOLLOWED * size) for edge in edges])
    for line, P in pieces:
        rows += [tuple(P[0, 0].tolist())] if line else [tuple(p[[0, 1, 2]].ravel().tolist()) for p in P]
    outline_profile(rows)
    return tuple(rows)


class _Flat:
    """The coordinates of a plane: x and y of space, if they can be."""

    def __init__(self, plane: "cq.Plane") -> None:
        normal = np.array(plane.zDir.toTuple())
        self.axes = np.array([plane.xDir.toTuple(), plane.yDir.toTuple()])
        if abs(normal[2]) > 1 - 1e-9:
            self.axes = np.eye(3)[:2]

    def __call__(self, vector: "cq.Vector") -> np.ndarray:
        return self.axes @ np.array(vector.toTuple())


def _shapes(shape: Any, name: str) -> "list[cq.Shape]":
    import cadquery as cq

    if isinstance(shape, list | tuple):
        return [one for item in shape for one in _shapes(item, name)]
    if isinstance(shape, cq.Sketch):
        return _shapes(list(shape), name)
    if isinstance(shape, cq.Workplane):
        return _shapes(shape.vals(), name)
    handle = getattr(shape, "wrapped", None)
    if handle is None:
        raise InvalidInputError(
            f"{name}: expected a sketch, face, wire or edges of CadQuery or build123d, found {type(shape).__name__}"
        )
    return [cq.Shape.cast(handle)]


def _only_wire(shapes: "list[cq.Shape]", name: str) -> Any:
    import cadquery as cq

    faces = [face for shape in shapes for face in shape.Faces()]
    holes = sum(len(face.innerWires()) for face in faces)
    require(not holes, f"{name}: the outline has holes ({holes}), a profile has none: draw its outer outline alone")
    wires = [face.outerWire() for face in faces]
    if not wires:
        edges = [edge for shape in shapes for edge in shape.Edges()]
        size = max((edge.BoundingBox().DiagonalLength for edge in edges), default=0.0)
        wires = cq.Wire.combine(edges, CLOSED * size) if edges else []
    require(wires, f"{name}: there is no outline in it: draw one closed outline of lines, arcs or splines")
    require(
        len(wires) == 1,
        f"{name}: expected one closed outline, found {len(wires)} that do not join; leave one of them, without gaps",
    )
    return wires[0]


def _edge_pieces(edge: Any, flat: _Flat, tolerance: float) -> tuple[bool, np.ndarray]:
    """Whether an edge is a line, and its cubic pieces (k, 4, 2)."""
    if edge.geomType() == "LINE":
        a, b = flat(edge.startPoint()), flat(edge.endPoint())
        return True, np.stack([a, (2 * a + b) / 3, (a + 2 * b) / 3, b])[None]
    count = 1
    while True:
        places = np.arange(4 * count + 1) / (4 * count)
        points = np.array([flat(edge.positionAt(t)) for t in places])
        T = np.array([flat(edge.tangentAt(t)) for t in places])
        pieces = np.array([_through(points[4 * k : 4 * k + 5 : 2], T[4 * k : 4 * k + 5 : 4]) for k in range(count)])
        # Beside the edge: along it, the pieces may run faster or slower.
        aside = [_beside(_at(pieces, q / 4) - points[q::4], T[q::4]) for q in (1, 3)]
        if np.concatenate(aside).max() <= tolerance or count >= MOST_PIECES:
            return False, pieces
        count *= 2


def _through(points: np.ndarray, tangents: np.ndarray) -> np.ndarray:
    """The cubic piece from the first point to the last with these tangents, whose middle is the middle point.

    Its control points are P0 + a t0 and P3 - b t3 with (P0 + P3) / 2 + 3 / 8 (a t0 - b t3) = M; of an arc this is the
    usual approximation by 4 / 3 tan(angle / 4).
    """
    a, b = points[0], points[2]
    chord = float(np.linalg.norm(b - a))
    M = np.stack([tangents[0], -tangents[1]], axis=1)
    reach = np.full(2, chord / 3)
    if abs(np.linalg.det(M)) > 1e-3:
        wanted = np.linalg.solve(M, (points[1] - (a + b) / 2) * 8 / 3)
        reach = np.where((wanted > 0) & (wanted < 2 * chord), wanted, reach)
    return np.stack([a, a + reach[0] * tangents[0], b - reach[1] * tangents[1], b])


def _beside(v: np.ndarray, tangents: np.ndarray) -> np.ndarray:
    return np.abs(v[:, 0] * tangents[:, 1] - v[:, 1] * tangents[:, 0])


def _at(P: np.ndarray, t: float) -> np.ndarray:
    u = 1 - t
    return u**3 * P[:, 0] + 3 * u**2 * t * P[:, 1] + 3 * u * t**2 * P[:, 2] + t**3 * P[:, 3]


def _oriented(edges: list[tuple[bool, np.ndarray]]) -> list[tuple[bool, np.ndarray]]:
    """Edges in order, each turned to begin where the one before ends."""
    if len(edges) == 1:
        return edges

    def ends(P: np.ndarray) -> np.ndarray:
        return np.stack([P[0, 0], P[-1, 3]])

    first, second = ends(edges[0][1]), ends(edges[1][1])
    gaps = np.linalg.norm(first[:, None] - second, axis=2).min(1)
    turned = [edges[0] if gaps[1] <= gaps[0] else (edges[0][0], edges[0][1][::-1, ::-1])]
    for line, P in edges[1:]:
        at = turned[-1][1][-1, 3]
        near, far = np.linalg.norm(ends(P) - at, axis=1)
        turned.append((line, P if near <= far else P[::-1, ::-1]))
    return turned
