"""What the kernel finds faulty in the solids of a truss, by node, without checking twice what did not change.

The kernel's check takes most of the time that a solid takes. When a few nodes have been laid out anew after it found
fault with them, first only the faces that changed are checked; the solid as a whole is checked when these are good.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Int

from michell_cad.cad.prepared import PreparedTruss
from michell_cad.cad.shell_plan import FaceRole, ShellPlan


class FaultFinder:
    """Checks one build of a truss after the other."""

    def __init__(self) -> None:
        self._passed: set[bytes] = set()

    def find(
        self, prepared: PreparedTruss, plan: ShellPlan, solids: Sequence[Any], faces: Sequence[Any]
    ) -> Int[np.ndarray, " n"]:
        """The nodes at which the kernel finds a fault, ascending."""
        keys = _element_keys(prepared)
        element = element_of_part(prepared, plan.faces.role, plan.faces.owner)
        new = np.array([key not in self._passed for key in keys])[element]
        faulty = np.zeros(0, np.int64)
        if self._passed:
            faulty = _faulty_faces([_together(faces, new)], faces, np.where(new, 0, -1))
        if not len(faulty):
            faulty = _faulty_faces(solids, faces, plan.faces.component)
        bad = set(element[faulty].tolist())
        self._passed |= {keys[e] for e in np.unique(element).tolist() if e not in bad}
        return nodes_of_parts(prepared, plan.faces.role[faulty], plan.faces.owner[faulty])


def element_of_part(
    prepared: PreparedTruss, role: Int[np.ndarray, " n"], owner: Int[np.ndarray, " n"]
) -> Int[np.ndarray, " n"]:
    """The element that faces or triangles belong to: the surroundings of a node, or (after all nodes) a member."""
    at_end = (role == FaceRole.FILLET) | (role == FaceRole.MITRE)
    node = np.where(at_end, prepared.node_of_end[np.where(at_end, owner, 0)], owner)
    return np.where(role == FaceRole.MEMBER, len(prepared.sized.truss.nodes) + owner, node)


def nodes_of_parts(
    prepared: PreparedTruss, role: Int[np.ndarray, " n"], owner: Int[np.ndarray, " n"]
) -> Int[np.ndarray, " k"]:
    """The nodes that faces or triangles belong to, for members both; ascending."""
    node = prepared.node_of_end
    at_ends = node[owner[(role == FaceRole.FILLET) | (role == FaceRole.MITRE)]]
    at_members = node.reshape(-1, 2)[owner[role == FaceRole.MEMBER]].ravel()
    return np.unique(np.concatenate([owner[role == FaceRole.NODE], at_ends, at_members]))


def _element_keys(prepared: PreparedTruss) -> list[bytes]:
    """The numbers that decide the shape of every element, whatever its number."""
    sizes, truss = prepared.sizes, prepared.sized.truss
    rows = np.column_stack(
        [prepared.directions, prepared.normals, sizes.end_radius, sizes.fillet, sizes.reach, sizes.creased]
    )
    ends: list[list[bytes]] = [[] for _ in truss.nodes]
    for node, row in zip(prepared.node_of_end.tolist(), rows, strict=True):
        ends[node].append(row.tobytes())
    spheres = np.column_stack([truss.nodes, sizes.radius])
    nodes = [sphere.tobytes() + b"".join(sorted(own)) for sphere, own in zip(spheres, ends, strict=True)]
    return nodes + [np.asarray(poles).tobytes() for poles in prepared.tubes.poles]


def _together(faces: Sequence[Any], chosen: np.ndarray) -> Any:
    from michell_cad.cad import kernel

    return kernel.compound([faces[f] for f in np.flatnonzero(chosen).tolist()])


def _faulty_faces(shapes: Sequence[Any], faces: Sequence[Any], shape_of_face: np.ndarray) -> np.ndarray:
    """Numbers of the faces of some shapes in which the kernel finds a fault."""
    from michell_cad.cad import kernel

    faulty = []
    for number, shape in enumerate(shapes):
        mine = np.flatnonzero(shape_of_face == number)
        bad = kernel.faulty_faces(shape, [faces[f] for f in mine.tolist()])
        if bad is not None:
            # A fault that is in no face must be somewhere among them.
            faulty.append(mine[np.array(bad)] if bad else mine)
    return np.concatenate([np.zeros(0, int), *faulty])
