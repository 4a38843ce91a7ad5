"""The mesh of a truss united with solids to keep, by manifold3d, which loses no triangle's origin."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, Int

from michell_cad.cad.mesh import TrussMesh
from michell_cad.cad.shell_plan import FaceRole
from michell_cad.errors import GeometryKernelError

if TYPE_CHECKING:
    from manifold3d import Manifold


def manifold_of_corners(corners: Float[np.ndarray, "t 3 3"]) -> "Manifold":
    """The body that triangles enclose whose corners coincide where they touch."""
    from manifold3d import Manifold, Mesh64

    mesh = Mesh64(
        np.ascontiguousarray(corners.reshape(-1, 3)), np.arange(3 * len(corners), dtype=np.uint64).reshape(-1, 3)
    )
    mesh.merge()
    return _checked(Manifold(mesh))


def unite_bodies(bodies: Sequence["Manifold"]) -> "Manifold":
    """The union of some bodies as a new one, whose triangles come from nowhere else."""
    from manifold3d import Manifold, OpType

    return Manifold.batch_boolean(list(bodies), OpType.Add).as_original()


def unite_mesh(
    truss: TrussMesh,
    kept: Sequence["Manifold"],
    rooms: Sequence["Manifold"],
    far: np.ndarray,
) -> tuple[TrussMesh, float]:
    """Truss without the rooms, and with the kept bodies; also the volume of dropped crumbs.

    Parameters
    ----------
    truss : TrussMesh
    kept, rooms : of each kept solid the body and its clearance, by owner.
    far : (t,) bool, triangles of the truss that are nowhere near. A piece of the result with neither one of these nor
        a piece of a kept body is a crumb, and dropped.
    """
    from manifold3d import Manifold, Mesh64, OpType

    # Without an identity and numbers of its own, manifold3d would forget which triangles are the truss's.
    own, n = Manifold.reserve_ids(1), len(truss.triangles)
    source_mesh = Mesh64(
        np.array(truss.vertices),
        truss.triangles.astype(np.uint64),
        run_index=np.array([0, 3 * n], np.uint64),
        run_original_id=np.array([own], np.uint32),
        face_id=np.arange(n, dtype=np.uint64),
    )
    body = _checked(Manifold(source_mesh))
    kept_of = {one.original_id(): owner for owner, one in enumerate(kept)}
    room_of = {one.original_id(): owner for owner, one in enumerate(rooms)}
    body = Manifold.batch_boolean([body, *rooms], OpType.Subtract)
    body = _checked(Manifold.batch_boolean([body, *kept], OpType.Add))
    pieces, crumbs = [], 0.0
    for piece in body.decompose():
        mesh = piece.to_mesh64()
        run = np.repeat(np.asarray(mesh.run_original_id), np.diff(np.asarray(mesh.run_index)) // 3)
        source = np.asarray(mesh.face_id).astype(int)
        mine = run == own
        role, owner = np.full(len(run), int(FaceRole.KEPT)), np.zeros(len(run), int)
        role[mine], owner[mine] = truss.role[source[mine]], truss.owner[source[mine]]
        for table in (kept_of, room_of):
            for number, of in table.items():
                owner[run == number] = of
        if far[source[mine]].any() or np.isin(run, list(kept_of)).any():
            pieces.append(
                (np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).astype(int), role, owner)
            )
        else:
            crumbs += piece.volume()
    offsets = np.cumsum([0, *(len(vertices) for vertices, *_ in pieces)])
    return TrussMesh(
        np.concatenate([vertices for vertices, *_ in pieces]),
        np.concatenate([triangles + offset for (_, triangles, *_), offset in zip(pieces, offsets, strict=False)]),
        np.concatenate([role for *_, role, _ in pieces]),
        np.concatenate([owner for *_, owner in pieces]),
    ), crumbs


def surface_of(body: "Manifold") -> tuple[Float[np.ndarray, "n 3"], Int[np.ndarray, "t 3"]]:
    """Vertices and triangles of a body."""
    mesh = body.to_mesh64()
    return np.array(mesh.vert_properties)[:, :3], np.array(mesh.tri_verts).astype(np.int64)


def _checked(body: "Manifold") -> "Manifold":
    from manifold3d import Error

    if body.status() != Error.NoError:
        raise GeometryKernelError(f"the mesh of a solid to keep is not closed ({body.status()}); heal the body in CAD")
    return body
