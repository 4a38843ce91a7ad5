"""Which rigid motions the supports leave free, also of parts that only hang together.

Tets that share faces are a rigid body. Bodies that share a vertex have a ball joint there, bodies that share an edge a
hinge: both are mechanisms that a stiffness matrix answers by being singular, long after the mistake was made. The rest
is textbook statics: the free motions are the null space of the constraints on the six motions of each body.
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import scipy.linalg
from jaxtyping import Bool, Float

from michell_cad.tet_mesh import TetMesh

RANK_TOLERANCE = 1e-9
"""Singular values of the constraints below this fraction of the largest one count as zero (relative)."""

MOST_BODIES = 200
"""Groups of more bodies that touch each other (a mesh in shreds) are left to the factorisation; their dense constraints
would take longer than the design."""


def rigid_motions(x: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3 6"]:
    """Displacements at the points `x` of the three unit translations and the three unit rotations about the origin.

    Row d of point n is row d of [I, -[x]_x]. The transpose takes a force at x to its resultant force and moment.
    """
    rows = np.zeros((len(x), 3, 6))
    rows[:, [0, 1, 2], [0, 1, 2]] = 1
    for axis in range(3):
        rows[:, :, 3 + axis] = np.cross(np.eye(3)[axis], x)
    return rows


def free_motions(held: Float[np.ndarray, "k m"]) -> Float[np.ndarray, "m j"]:
    """Motions that vanish in every held component: an orthonormal basis (columns) of the null space of `held`.

    Points should be given about the body's centre in units of its size, so that translations and rotations compare.
    """
    _, values, directions = np.linalg.svd(_reduced(held), full_matrices=True)
    rank = int((values > RANK_TOLERANCE * max(values.max(initial=0.0), 1.0)).sum())
    return directions[rank:].T


def name_motions(motions: Float[np.ndarray, "6 j"]) -> list[str]:
    """Say for a basis of motions what can move, in as many different names as it has columns."""
    return [_name(k) for k in independent_components(motions)]


def independent_components(motions: Float[np.ndarray, "m j"]) -> list[int]:
    """j components (rows), ascending, by which the span of the j columns is known best: those of pivoted QR."""
    order = np.asarray(scipy.linalg.qr(motions.T, mode="economic", pivoting=True)[-1])
    return sorted(order[: motions.shape[1]].tolist())


def _name(k: int) -> str:
    return f"it can move along {'xyz'[k]}" if k < 3 else f"it can turn about {'xyz'[k - 3]}"


def free_rigid_motions(mesh: TetMesh, fixed: Bool[np.ndarray, "n_v 3"]) -> list[str]:
    """Name the rigid motions that `fixed` does not prevent, of every body of the mesh; an empty list if there are none.

    A body with centre c and size l moves by u(x) = t + w x (x - c)/l. Held components of its vertices must not move,
    and vertices that two bodies share must move alike. Each free motion is named by its largest t or w.
    """
    bodies = mesh.body_of_tet
    n = int(bodies.max()) + 1
    corners = np.unique(np.column_stack([np.repeat(bodies, 4), mesh.tets.ravel()]), axis=0)
    bounds = np.searchsorted(corners[:, 0], np.arange(n + 1))
    vertices = [corners[first:last, 1] for first, last in pairwise(bounds)]
    group_of_body = mesh.component_of_vertex[[v[0] for v in vertices]]
    motions = []
    for group in range(int(group_of_body.max()) + 1):
        members = np.flatnonzero(group_of_body == group)
        if not fixed[np.concatenate([vertices[body] for body in members])].any():
            where = _place(mesh, vertices, members[:1]) if n > 1 else ""
            motions.append(f"nothing holds it{where}")
            continue
        if len(members) > MOST_BODIES:
            continue
        for component in independent_components(_free_motions_of(mesh, fixed, [vertices[b] for b in members])):
            body, k = divmod(component, 6)
            where = _place(mesh, vertices, members[body : body + 1], hangs=len(members) > 1) if n > 1 else ""
            motions.append(_name(k) + where)
    return list(dict.fromkeys(motions))


def _place(mesh: TetMesh, vertices: list[np.ndarray], body: np.ndarray, hangs: bool = False) -> str:
    x = ", ".join(f"{value:.4g}" for value in mesh.vertices[vertices[body[0]]].mean(0))
    joint = ", which meets others in a point or an edge only: join them by faces" if hangs else ""
    return f" (part {body[0] + 1} of {len(vertices)}, around ({x}) mm{joint})"


def _free_motions_of(
    mesh: TetMesh, fixed: Bool[np.ndarray, "n_v 3"], vertices: list[np.ndarray]
) -> Float[np.ndarray, "n_m k"]:
    """Free motions (columns) of bodies with the given vertices, six numbers (t, w) for each."""
    centres = [mesh.vertices[v].mean(0) for v in vertices]
    sizes = [max(float(np.ptp(mesh.vertices[v], axis=0).max()), np.finfo(float).tiny) for v in vertices]

    def displacement(body: int, where: np.ndarray) -> np.ndarray:
        """Displacements (k, 3, 6) of vertices for unit motions of a body."""
        return rigid_motions((mesh.vertices[where] - centres[body]) / sizes[body])

    blocks = [np.zeros((1, 6 * len(vertices)))]
    for body, own in enumerate(vertices):
        block = np.zeros((6, 6 * len(vertices)))
        held = _reduced(displacement(body, own)[fixed[own]])
        block[: len(held), 6 * body : 6 * body + 6] = held
        blocks.append(block)
    for a, b, shared in _joints(vertices):
        together = _reduced(np.concatenate([displacement(a, shared), -displacement(b, shared)], axis=2).reshape(-1, 12))
        block = np.zeros((len(together), 6 * len(vertices)))
        block[:, 6 * a : 6 * a + 6], block[:, 6 * b : 6 * b + 6] = together[:, :6], together[:, 6:]
        blocks.append(block)
    return free_motions(np.concatenate(blocks))


def _reduced(rows: np.ndarray) -> np.ndarray:
    """As few rows with the same null space: the triangular factor."""
    return np.asarray(np.linalg.qr(rows, mode="r")) if len(rows) else rows


def _joints(vertices: list[np.ndarray]) -> Iterator[tuple[int, int, np.ndarray]]:
    """Pairs of bodies and the vertices that they share."""
    body = np.repeat(np.arange(len(vertices)), [len(v) for v in vertices])
    vertex = np.concatenate(vertices)
    order = np.argsort(vertex, kind="stable")
    body, vertex = body[order], vertex[order]
    found: dict[tuple[int, int], list[int]] = {}
    for first in np.flatnonzero(vertex[1:] == vertex[:-1]):
        found.setdefault((int(body[first]), int(body[first + 1])), []).append(int(vertex[first]))
    for (a, b), shared in found.items():
        yield a, b, np.array(shared)
