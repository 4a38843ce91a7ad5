"""Filleted creases: what a ball of radius f leaves where it rolls along the tubes and the sphere of a node.

The centre of the ball runs on the union of the offsets: the sphere of radius R + f and the tubes of radius r + f, which
meet as `mitres` tells. Every edge of that union is the path of the ball along a crease, every corner a place where it
touches three parts at once. Moving all parts back inward by f leaves

* along an edge between a tube and the sphere: a piece of torus;
* along an edge between two tubes, which is an arc of an ellipse: a *strip*, the pipe of radius f around that arc,
  between the two ellipses (r + f) / tan(alpha / 2) cos(t) d + r (cos(t) a + sin(t) w) where it touches the tubes, with
  a the unit vector from the axis of the tube, in the plane of both, and w their common normal;
* at a corner: a triangle of the ball itself, between three of its great circles.

So the blend is exact and tangent everywhere, whatever the number of members. Pieces are also cut where a tube has its
angle 0; the ball then leaves one arc there, and no triangle.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from michell_cad.arrays import freeze
from michell_cad.cad.mitres import NodeMitre
from michell_cad.cad.nodes import angles_between


@dataclass(frozen=True, eq=False)
class Creases:
    """Pieces, corners, arcs and triangles of all filleted creases.

    Pieces lie along the start of a tube from angle `start` to `stop`, ascending within an end. At a corner the ball
    touches the sphere or tubes: contacts are numbered by their end, the sphere is `sphere` (larger than all ends).

    Parameters
    ----------
    node, center : (n_c,) int and (n_c, 3) float, mm, of the corners: node, centre of the ball.
    end, neighbour : (n_p,) int: the tube, and the tube or `sphere` on the other side.
    start, stop : (n_p,) float, angles around the tube.
    first, last : (n_p,) int, corners.
    previous : (n_p,) int, the piece before, around the same tube.
    touch : (n_p, 3) float, mm, where the ball touches the tube at the first corner.
    arc_corner, arc_from, arc_to : (n_a,) int: arcs across the pieces, from one contact to another.
    arc_start, arc_stop : (n_a, 3) float, unit vectors from the centre of the ball to these contacts.
    first_arc, last_arc : (n_p,) int, arcs at the two corners of a piece.
    triangle_arcs : (n_t, 3) int, arcs around a triangle, counter-clockwise seen from outside the ball.
    triangle_forward : (n_t, 3) bool, whether these run along the arc.
    """

    sphere: int
    node: Int[np.ndarray, " n_c"]
    center: Float[np.ndarray, "n_c 3"]
    end: Int[np.ndarray, " n_p"]
    neighbour: Int[np.ndarray, " n_p"]
    start: Float[np.ndarray, " n_p"]
    stop: Float[np.ndarray, " n_p"]
    first: Int[np.ndarray, " n_p"]
    last: Int[np.ndarray, " n_p"]
    previous: Int[np.ndarray, " n_p"]
    touch: Float[np.ndarray, "n_p 3"]
    arc_corner: Int[np.ndarray, " n_a"]
    arc_from: Int[np.ndarray, " n_a"]
    arc_to: Int[np.ndarray, " n_a"]
    arc_start: Float[np.ndarray, "n_a 3"]
    arc_stop: Float[np.ndarray, "n_a 3"]
    first_arc: Int[np.ndarray, " n_p"]
    last_arc: Int[np.ndarray, " n_p"]
    triangle_arcs: Int[np.ndarray, "n_t 3"]
    triangle_forward: Bool[np.ndarray, "n_t 3"]

    def __post_init__(self) -> None:
        freeze(self, node=np.int64, center=np.float64, end=np.int64, neighbour=np.int64, start=np.float64)
        freeze(self, stop=np.float64, first=np.int64, last=np.int64, previous=np.int64, touch=np.float64)
        freeze(self, arc_corner=np.int64, arc_from=np.int64, arc_to=np.int64, arc_start=np.float64)
        freeze(self, arc_stop=np.float64, first_arc=np.int64, last_arc=np.int64, triangle_arcs=np.int64)
        freeze(self, triangle_forward=bool)

    @property
    def on_sphere(self) -> Bool[np.ndarray, " n_p"]:
        """Whether a piece lies between its tube and the sphere."""
        return self.neighbour == self.sphere

    @property
    def arc_angles(self) -> Float[np.ndarray, " n_a"]:
        """Angle of each arc, below pi."""
        return angles_between(self.arc_start, self.arc_stop)

    def touch_at(self, corner: Int[np.ndarray, " k"], end: Int[np.ndarray, " k"]) -> Int[np.ndarray, " k"]:
        """The piece that begins at a corner on a tube, so that its `touch` is the contact there."""
        key = self.first * self.sphere + self.end
        order = np.argsort(key)
        return order[np.searchsorted(key, corner * self.sphere + end, sorter=order)]


def lay_creases(
    mitres: Mapping[int, NodeMitre],
    nodes: Float[np.ndarray, "n_n 3"],
    directions: Float[np.ndarray, "n_e 3"],
    normals: Float[np.ndarray, "n_e 3"],
    fillet: Float[np.ndarray, " n_e"],
) -> Creases:
    """Tables of the filleted ones among the mitres of a truss; see `PreparedTruss` for the arguments."""
    rows, previous, corners, owner = [], [], [np.zeros((0, 3))], []
    sphere, count = len(fillet), 0
    for i, one in mitres.items():
        if not fillet[one.ends[0]] > 0:
            continue
        ends = one.ends.tolist()
        for path in one.mitre.pieces:
            previous += [len(rows) + len(path) - 1, *range(len(rows), len(rows) + len(path) - 1)]
            for p in path:
                neighbour = ends[p.neighbour] if p.neighbour >= 0 else sphere
                rows.append((ends[p.end], neighbour, p.start, p.stop, count + p.first, count + p.last))
        corners.append(nodes[i] + one.mitre.corners)
        owner.append(np.full(len(one.mitre.corners), i))
        count += len(one.mitre.corners)
    table = np.array(rows).reshape(-1, 6)
    end, neighbour, first, last = (table[:, k].astype(np.int64) for k in (0, 1, 4, 5))
    start, stop, previous = table[:, 2], table[:, 3], np.array(previous, np.int64)
    center, node = np.concatenate(corners), np.concatenate([np.zeros(0, np.int64), *owner])
    N, B = normals[end], np.cross(directions[end], normals[end])
    inward = -(np.cos(start)[:, None] * N + np.sin(start)[:, None] * B)
    touch = center[first] + fillet[end, None] * inward
    to_sphere = nodes[node] - center
    to_sphere /= np.maximum(np.linalg.norm(to_sphere, axis=1, keepdims=True), np.finfo(float).tiny)

    key = first * sphere + end
    order = np.argsort(key)

    def contact(corner: np.ndarray, part: np.ndarray) -> np.ndarray:
        """Unit vectors from the ball at a corner to where it touches a tube or the sphere."""
        place = np.minimum(np.searchsorted(key, corner * sphere + part, sorter=order), len(key) - 1)
        return np.where((part == sphere)[:, None], to_sphere[corner], inward[order[place]])

    low, high = np.minimum(end, neighbour), np.maximum(end, neighbour)
    arcs, of_piece = np.unique(
        np.stack([np.r_[first, last], np.r_[low, low], np.r_[high, high]], axis=1), axis=0, return_inverse=True
    )
    of_piece = of_piece.reshape(2, -1)
    triangle_arcs, forward = _lay_triangles(sphere, end, neighbour, first, previous, arcs, contact)
    return Creases(
        sphere,
        node,
        center,
        end,
        neighbour,
        start,
        stop,
        first,
        last,
        previous,
        touch,
        arcs[:, 0],
        arcs[:, 1],
        arcs[:, 2],
        contact(arcs[:, 0], arcs[:, 1]),
        contact(arcs[:, 0], arcs[:, 2]),
        of_piece[0],
        of_piece[1],
        triangle_arcs,
        forward,
    )


def _lay_triangles(sphere, end, neighbour, first, previous, arcs, contact) -> tuple[np.ndarray, np.ndarray]:
    """Arcs and their senses around the triangles: one at every corner where a tube changes its neighbour."""
    changes = np.flatnonzero(neighbour != neighbour[previous])
    corner, once = np.unique(first[changes], return_index=True)
    p = changes[once]
    x, y, z = end[p], neighbour[previous[p]], neighbour[p]
    a, b, c = (contact(corner, part) for part in (x, y, z))
    turned = np.einsum("td,td->t", np.cross(a, b), c) < 0
    y, z = np.where(turned, z, y), np.where(turned, y, z)
    code = (arcs[:, 0] * (sphere + 1) + arcs[:, 1]) * (sphere + 1) + arcs[:, 2]
    found, forward = [], []
    for start, stop in ((x, y), (y, z), (z, x)):
        low, high = np.minimum(start, stop), np.maximum(start, stop)
        found.append(np.searchsorted(code, (corner * (sphere + 1) + low) * (sphere + 1) + high))
        forward.append(start == low)
    return np.stack(found, axis=1), np.stack(forward, axis=1)
