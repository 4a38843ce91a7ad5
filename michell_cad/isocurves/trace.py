"""Tracing the integer isocurves of a parametrization: Arora et al. 2019 (doi:10.1145/3328939.3328999), Section 4.4.

The paper follows each curve from tet to tet. Here all crossings of lattice lines with the faces of the mesh are found
at once by exact predicates, linked within the tets, and chained (`lattice`, `interior`, `surface`, `features`,
`chains`, `weave`). Departures from the paper:

1. The map is made generic once (see `lattice`), so that on any map, also a folded, random or constant one, curves close
   or end on the boundary, every interior node lies on exactly three of them, and a boundary node on one interior and
   two surface curves.
2. The curves {phi_i = a} on the boundary surface join the ends of the interior curves, and end at the sharp features of
   the part. These are curves, too.
3. Curves carry a component number, since several can have the same isovalues.

A loop that meets no other curve (closed, without a node) is not part of the network, except for a sharp feature, which
gets one node.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from michell_cad.arrays import require, same_as_previous
from michell_cad.compiled import compiled
from michell_cad.curves import FAMILIES, KINDS, NO_ISOVALUE, TRACED_FAMILIES, CurveKind, Curves, NodeKind
from michell_cad.isocurves.chains import Chains, order_chains
from michell_cad.isocurves.edge_crossings import EdgeCrossings, cross_edges, place_edge_crossings
from michell_cad.isocurves.features import FeatureSegments, trace_features
from michell_cad.isocurves.interior import Segments, trace_interior
from michell_cad.isocurves.lattice import (
    PAIRS,
    FaceCrossings,
    cross_faces,
    lexicographic_order,
    round_levels,
)
from michell_cad.isocurves.network import CurveNetwork
from michell_cad.isocurves.surface import SurfaceSegments, trace_surface
from michell_cad.isocurves.weave import WovenCurves, weave_curves
from michell_cad.parametrization.cells import measure_cells
from michell_cad.tet_mesh import TetMesh


@dataclass(frozen=True)
class IsocurveOptions:
    """Options of `trace_isocurves`.

    Parameters
    ----------
    corner_angle : radians. A sharp feature that turns by more has a corner there, where its curve ends. The default of
        50 degrees lies between the bends of a circle meshed by eight chords (45) and of a hexagon (60).
    """

    corner_angle: float = np.deg2rad(50.0)

    def __post_init__(self) -> None:
        require(
            0 < self.corner_angle <= np.pi, f"corner_angle must lie between 0 and pi radians, found {self.corner_angle}"
        )


@dataclass(frozen=True, eq=False)
class _Nodes:
    """Nodes before they are put in their final order."""

    points: np.ndarray
    kinds: np.ndarray
    levels: np.ndarray

    @staticmethod
    def join(*parts: tuple[NodeKind, np.ndarray, np.ndarray]) -> "_Nodes":
        """Nodes of several kinds, given by kind, points and levels."""
        return _Nodes(
            np.concatenate([points for _, points, _ in parts]),
            np.repeat([kind for kind, _, _ in parts], [len(points) for _, points, _ in parts]),
            np.concatenate([levels for _, _, levels in parts]).astype(float),
        )


@dataclass(frozen=True, eq=False)
class _Strands:
    """Chain vertices and segments of all kinds of curves, numbered through."""

    segments: Segments
    first_segments: np.ndarray
    """Numbers of the first segments of each kind, in the order of `KINDS`."""
    vertex_points: np.ndarray
    vertex_nodes: np.ndarray


def trace_isocurves(
    mesh: TetMesh,
    levels: Float[np.ndarray, "n_v 3"],
    families: tuple[str, str, str] = ("tension", "third", "compression"),
    options: IsocurveOptions = IsocurveOptions(),
) -> CurveNetwork:
    """Trace the curves along which two coordinates of a piecewise-linear map are integer.

    Interior curves {phi_i = a, phi_j = b} run through the solid, boundary curves {phi_i = a} on its surface between the
    sharp features, and feature curves along these, between corners.

    Parameters
    ----------
    mesh : TetMesh
    levels : (n_v, 3) float, the parametrization at the vertices, in cells.
    families : names of the families of curves that run along coordinate 0, 1 and 2.
    options : IsocurveOptions

    Returns
    -------
    CurveNetwork
        Nodes lie on the isosurfaces of the given levels to 2^-18 times the cells across the widest tet (4e-6 cells).
        Nodes, members and curves are in an order that does not depend on the numbering of vertices and tets.

    Raises
    ------
    InvalidInputError
        If levels are not finite, or a tet spans more than 256 cells.

    Notes
    -----
    A boundary curve {phi_i = a} has as axis the coordinate k whose direction b_k (normalised column of the inverse of
    grad phi) has the larger mean of |b_k . t| over the curve, t its unit tangent.

    References
    ----------
    Arora et al. 2019, Volumetric Michell trusses for parametric design & fabrication, Section 4.4.
    """
    require(
        levels.shape == mesh.vertices.shape,
        f"levels must have shape {mesh.vertices.shape}, one row for each vertex of the mesh, found {levels.shape}",
    )
    require(
        set(families) == set(TRACED_FAMILIES),
        f"families must name tension, compression and third once each, found {families}",
    )
    grid = round_levels(levels, mesh.tets)
    crossings = cross_faces(mesh.vertices, mesh.faces, grid)
    points = crossings.points
    interior, interior_nodes = trace_interior(mesh, crossings)
    edges = cross_edges(mesh.boundary_edges, grid)
    edge_points, edge_levels = _at_edges(mesh, levels, edges)
    sharp = mesh.is_feature_edge

    # Nodes, numbered as they come: where three curves cross, where one leaves the solid, on sharp edges, at corners.
    outer, on_sharp = mesh.face_tets[crossings.face, 1] < 0, sharp[edges.edge]
    boundary_nodes = _number(outer, len(interior_nodes.tets))
    feature_nodes = _number(on_sharp, len(interior_nodes.tets) + int(outer.sum()))
    surface = trace_surface(mesh, grid, crossings, edges, sharp, boundary_nodes)
    features = trace_features(mesh, edges, np.flatnonzero(sharp), feature_nodes, options.corner_angle)
    nodes = _Nodes.join(
        (NodeKind.INTERIOR, interior_nodes.points, interior_nodes.values),
        (NodeKind.BOUNDARY, points[outer], _crossing_levels(crossings, np.flatnonzero(outer))),
        (NodeKind.FEATURE, edge_points[on_sharp], edge_levels[on_sharp]),
        (NodeKind.CORNER, mesh.vertices[features.corners], levels[features.corners]),
    )
    corner_nodes = _corner_nodes(features, len(nodes.points) - len(features.corners))
    parts = [interior, surface.segments, features.segments]
    strands = _Strands(
        _concatenate(parts, [len(points), len(surface.vertex_crossings)]),
        np.cumsum([0] + [len(part.ends) for part in parts[:-1]]),
        np.concatenate([points, edge_points[surface.vertex_crossings], mesh.vertices[features.vertices]]),
        np.concatenate([boundary_nodes, feature_nodes[surface.vertex_crossings], corner_nodes]),
    )
    chains = order_chains(len(strands.vertex_points), strands.segments.ends)
    labels = _label_chains(crossings, surface, strands, chains)
    axes = _axes(mesh, levels, surface, edge_points, strands, chains, labels)
    nodes, vertex_nodes = _node_every_feature(mesh, levels, features, strands, chains, nodes)
    return _assemble(strands, chains, labels, axes, nodes, vertex_nodes, families)


def _number(mask: np.ndarray, first: int) -> np.ndarray:
    """Numbers from `first` on for the true entries of `mask`, -1 for the others."""
    numbers = np.full(len(mask), -1)
    numbers[mask] = first + np.arange(np.count_nonzero(mask))
    return numbers


def _corner_nodes(features: FeatureSegments, first: int) -> np.ndarray:
    if not len(features.corners):
        return np.full(len(features.vertices), -1)
    place = np.minimum(np.searchsorted(features.corners, features.vertices), len(features.corners) - 1)
    return np.where(features.corners[place] == features.vertices, first + place, -1)


def _at_edges(mesh: TetMesh, levels: np.ndarray, edges: EdgeCrossings) -> tuple[np.ndarray, np.ndarray]:
    """Points and levels at crossings of boundary edges."""
    at = place_edge_crossings(mesh.boundary_edges, levels, edges)
    at[np.arange(len(at)), edges.axis] = edges.value
    return place_edge_crossings(mesh.boundary_edges, mesh.vertices, edges), at


def _crossing_levels(crossings: FaceCrossings, some: np.ndarray) -> np.ndarray:
    """Levels at the crossings with the given numbers."""
    rows, (i, j) = np.arange(len(some)), np.array(PAIRS)[crossings.pair[some]].T
    at = np.empty((len(some), 3))
    at[rows, i], at[rows, j], at[rows, 3 - i - j] = crossings.a[some], crossings.b[some], crossings.level[some]
    return at


def _concatenate(parts: list[Segments], vertex_counts: list[int]) -> Segments:
    """Number the chain vertices of several sets of segments through."""
    first_vertex = np.concatenate([[0], np.cumsum(vertex_counts)])
    first_node = np.cumsum([0] + [len(part.nodes) for part in parts])
    offsets = [part.node_offsets[:-1] + first for part, first in zip(parts, first_node[:-1], strict=True)]
    return Segments(
        np.concatenate([part.ends + first for part, first in zip(parts, first_vertex, strict=True)], dtype=np.int32),
        np.concatenate([*offsets, first_node[-1:]]),
        np.concatenate([part.nodes for part in parts], dtype=np.int32),
    )


def _label_chains(
    crossings: FaceCrossings, surface: SurfaceSegments, strands: _Strands, chains: Chains
) -> Int[np.ndarray, "n_c 4"]:
    """Kind (index into `KINDS`) and isovalues of every chain, from one of its segments."""
    segment = np.zeros(len(chains.closed), np.int64)
    walked = chains.next_edge >= 0
    segment[chains.chain[walked]] = chains.next_edge[walked]
    kinds = np.searchsorted(strands.first_segments, segment, side="right") - 1
    labels = np.full((len(segment), 4), NO_ISOVALUE)
    labels[:, 0] = kinds
    inside = np.flatnonzero(kinds == KINDS.index(CurveKind.INTERIOR))
    crossing = strands.segments.ends[segment[inside], 0]
    i, j = np.array(PAIRS)[crossings.pair[crossing]].T
    labels[inside, 1 + i], labels[inside, 1 + j] = crossings.a[crossing], crossings.b[crossing]
    outside = np.flatnonzero(kinds == KINDS.index(CurveKind.BOUNDARY))
    on_surface = segment[outside] - strands.first_segments[1]
    labels[outside, 1 + surface.axis[on_surface]] = surface.value[on_surface]
    return labels


def _axes(
    mesh: TetMesh,
    levels: np.ndarray,
    surface: SurfaceSegments,
    edge_points: np.ndarray,
    strands: _Strands,
    chains: Chains,
    labels: np.ndarray,
) -> np.ndarray:
    """Coordinate along which each chain runs, -1 for features."""
    kinds = labels[:, 0]
    _, _, directions = measure_cells(mesh.gradients(levels, mesh.face_tets[mesh.boundary_faces, 0]))
    lengths = np.zeros((len(kinds), 3))
    add_lengths(
        chains.offsets,
        chains.next_edge - strands.first_segments[1],
        surface.vertex_crossings[surface.segments.ends],
        surface.triangle,
        surface.axis,
        edge_points,
        directions,
        lengths,
    )
    along = np.where(kinds == KINDS.index(CurveKind.INTERIOR), np.argmax(labels[:, 1:] == NO_ISOVALUE, axis=1), -1)
    return np.where(kinds == KINDS.index(CurveKind.BOUNDARY), lengths.argmax(1), along)


def _add_lengths(
    chain_offsets: Any, chain_segments: Any, ends: Any, triangle: Any, axis: Any, points: Any, directions: Any, out: Any
) -> None:
    """Sum along each boundary chain the lengths of its segments times |b_k . t|, k the two coordinates that vary."""
    for c in range(len(chain_offsets) - 1):
        for place in range(chain_offsets[c], chain_offsets[c + 1]):
            s = chain_segments[place]
            if s < 0 or s >= len(axis):
                continue
            for k in range(3):
                if k == axis[s]:
                    out[c, k] = -1  # never the longest, also where the others have no direction
                    continue
                product = 0.0
                for d in range(3):
                    step = points[ends[s, 1], d] - points[ends[s, 0], d]
                    product += directions[triangle[s], d, k] * step
                out[c, k] += abs(product)


add_lengths = compiled(_add_lengths)


def _node_every_feature(
    mesh: TetMesh, levels: np.ndarray, features: FeatureSegments, strands: _Strands, chains: Chains, nodes: _Nodes
) -> tuple[_Nodes, np.ndarray]:
    """Give closed features without a node one at their lowest vertex (by x, y, z); all nodes, and those at vertices."""
    vertex_nodes = strands.vertex_nodes.copy()
    counts = np.diff(strands.segments.node_offsets)
    first_feature = len(vertex_nodes) - len(features.vertices)
    chosen = []
    for chain in np.flatnonzero(chains.closed & (chains.order[chains.offsets[:-1]] >= first_feature)):
        items = slice(chains.offsets[chain], chains.offsets[chain + 1])
        vertices = chains.order[items]
        if (vertex_nodes[vertices] < 0).all() and not counts[chains.next_edge[items]].any():
            chosen.append(vertices[np.lexsort(strands.vertex_points[vertices].T[::-1])[0]])
    chosen = np.array(chosen, np.int64)
    vertex_nodes[chosen] = len(nodes.points) + np.arange(len(chosen))
    at = features.vertices[chosen - first_feature]
    more = _Nodes.join((NodeKind.FEATURE, mesh.vertices[at], levels[at]))
    joined = _Nodes(
        np.concatenate([nodes.points, more.points]),
        np.concatenate([nodes.kinds, more.kinds]),
        np.concatenate([nodes.levels, more.levels]),
    )
    return joined, vertex_nodes


def _assemble(
    strands: _Strands,
    chains: Chains,
    labels: np.ndarray,
    axes: np.ndarray,
    nodes: _Nodes,
    vertex_nodes: np.ndarray,
    families: tuple[str, str, str],
) -> CurveNetwork:
    """Sort the nodes (by kind, levels, position), weave the curves, and label them."""
    order = _order_nodes(nodes)
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    segments = Segments(strands.segments.ends, strands.segments.node_offsets, rank[strands.segments.nodes])
    numbered = np.where(vertex_nodes >= 0, rank[vertex_nodes], -1) if len(rank) else vertex_nodes
    levels = nodes.levels.take(order, 0)
    woven = weave_curves(chains, segments, numbered, strands.vertex_points, labels, axes, levels)
    return CurveNetwork(
        nodes.points.take(order, 0),
        nodes.kinds[order],
        levels,
        woven.members,
        strands.vertex_points.take(woven.path, 0),  # much faster than an index, for rows
        woven.path_offsets,
        _label(woven, labels[woven.chain], axes[woven.chain], families),
    )


def _order_nodes(nodes: _Nodes) -> Int[np.ndarray, " n"]:
    """Order of the nodes by kind, levels, position. The levels of interior nodes are integers, which sort faster."""
    inside = np.flatnonzero(nodes.kinds == NodeKind.INTERIOR)
    outside = np.flatnonzero(nodes.kinds != NodeKind.INTERIOR)
    values = nodes.levels[inside].astype(np.int64)
    order = lexicographic_order(values)
    same = np.flatnonzero(same_as_previous(values[order]))
    tied = np.union1d(same, same + 1)
    order[tied] = order[tied][_lexsort(nodes, inside[order[tied]])]
    return np.concatenate([inside[order], outside[_lexsort(nodes, outside)]])


def _lexsort(nodes: _Nodes, some: np.ndarray) -> np.ndarray:
    kinds, levels = nodes.kinds[some], nodes.levels[some]
    order = np.lexsort((*levels.T[::-1], kinds))
    if not (same_as_previous(levels[order]) & same_as_previous(kinds[order, None])).any():
        return order
    return np.lexsort((*nodes.points[some].T[::-1], *levels.T[::-1], kinds))


def _label(woven: WovenCurves, labels: np.ndarray, axes: np.ndarray, families: tuple[str, str, str]) -> Curves:
    """Curves with their labels; those with equal kind and isovalues are numbered in the order in which they come."""
    n = len(labels)
    new = np.ones(n, bool)
    new[1:] = ~same_as_previous(labels)
    first = np.maximum.accumulate(np.where(new, np.arange(n), 0))
    # Axis -1, the last entry, stands for a feature.
    family_of_axis = np.array([FAMILIES.index(name) for name in (*families, "feature")])
    return Curves(
        labels[:, 0],
        family_of_axis[axes],
        axes,
        labels[:, 1:],
        np.arange(n) - first,
        woven.closed,
        woven.nodes,
        woven.node_offsets,
        np.arange(len(woven.members)),
        woven.member_offsets,
    )
