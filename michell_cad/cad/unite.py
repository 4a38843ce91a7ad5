"""Unite the solid of a truss with solids to keep, into one valid solid: locally, where members enter them.

A boolean of the kernel with a whole truss takes minutes for thousands of faces. So the elements of the truss (the
surroundings of a node up to its circles, and the tubes between) are sorted by their distance from what is kept and its
clearance:

* those wholly inside are absorbed;
* those far away keep their faces as they are;
* those between, cut off from the far ones by discs at the circles of their tubes, are stubs: the kernel splits them and
  the kept solids by each other, the right cells are chosen, and their outer faces, without the discs, close the shell
  of the far faces again, because both share the edges of the circles.

The kernel cuts fillets between members at acute angles wrongly (it loses or adds volume, and calls the result valid),
so that such nodes, where they enter what is kept, become plain: a ball and a cylinder to each disc. And where stubs all
but touch each other it splits the circle of a disc, to which the far faces would no longer fit: then the element behind
that disc becomes a stub, too.

The mesh is united apart from that by manifold3d, and both are compared.
"""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from michell_cad.arrays import require
from michell_cad.cad.faults import element_of_part
from michell_cad.cad.keep import KeptSolid
from michell_cad.cad.mesh import TrussMesh
from michell_cad.cad.mesh_unite import surface_of, unite_mesh
from michell_cad.cad.prepared import PreparedTruss
from michell_cad.cad.shell_plan import FaceRole
from michell_cad.cad.solid import LARGEST_VOLUME_DIFFERENCE, KeptReport, TrussSolid
from michell_cad.cad.zone import Zone, components, lay_zone
from michell_cad.errors import GeometryKernelError

if TYPE_CHECKING:
    from manifold3d import Manifold


SAMPLES = 33
"""Balls that stand for a tube when its distance is measured."""

VERTEX_BALL = 0.3
"""Radius of the balls that stand for the surroundings of nodes (relative to the largest radius of the truss): they
overlap, since the polygons of the mesh have sides of 0.4 radii."""

BALL = 0.95
"""Largest radius of the ball of a node without fillets (relative to the distance of the nearest disc)."""

BAR_END = 0.6
"""Where the bars of such a node end, relative to the farthest place at which their end is inside the ball."""

TRIES = 6
"""So often the kernel splits a group of solids, each time with more stubs, or more nodes without fillets."""

ABSORBED, NEAR, FAR = 0, 1, 2


def unite(solid: TrussSolid, kept: Sequence[KeptSolid], progress: Callable[[float], None] | None = None) -> TrussSolid:
    """Unite a truss with solids to keep.

    The result is (truss without all clearances) with all kept solids. Pieces of members that the clearances cut off
    from everything else are dropped.

    Parameters
    ----------
    solid : of `build_solid`.
    kept : of `keep_material` or `kept_shape`.
    progress : called with the fraction done, from 0 to 1.

    Raises
    ------
    InvalidInputError
        If there is nothing to unite, or the truss has been united before (unite everything in one call).
    GeometryKernelError
        If no valid solid comes out.
    """
    require(kept, "there is nothing to unite with the truss: give at least one kept solid")
    require(
        solid.report.kept is None,
        f"the truss is united with {', '.join(solid.kept_names)} already: unite all solids in one call",
    )
    tell = progress or (lambda fraction: None)
    zone = lay_zone(solid, kept)
    tell(0.2)
    prepared = solid.prepared
    plan = _sort_elements(solid, zone)
    tell(0.3)
    far = plan.fate[element_of_part(prepared, solid.mesh.role, solid.mesh.owner)] == FAR
    owners = [zone.owner == k for k in range(len(kept))]
    mesh, crumbs = unite_mesh(
        solid.mesh,
        [zone.union(zone.is_kept & mine) for mine in owners],
        [zone.union(~zone.is_kept & mine) for mine in owners],
        far,
    )
    tell(0.4)
    element = element_of_part(prepared, solid.face_role, solid.face_owner)
    pieces, discs, is_far = _Pieces([], []), _Discs(prepared), plan.fate == FAR
    groups = np.unique(plan.cell_group).tolist()
    for done, group in enumerate(groups):
        is_far[_fuse_group(solid, element, zone, plan, group, discs, pieces)] = False
        tell(0.4 + 0.5 * (done + 1) / len(groups))
    _add_far_faces(solid, is_far[element], pieces)
    united = _assemble(solid, plan, pieces, zone, mesh, crumbs)
    tell(1.0)
    return united


# --- elements of the truss -------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Plan:
    """What happens to the elements (nodes, then members), and which groups of cells are split together.

    `fate` (n_n + n_m,) is ABSORBED, NEAR or FAR; `cluster` the number of the cluster of near elements that hang
    together, else -1; `cluster_group` and `cell_group` the group of each cluster and of each cell of the zone.
    """

    fate: np.ndarray
    cluster: np.ndarray
    cluster_group: np.ndarray
    cell_group: np.ndarray


def _sort_elements(solid: TrussSolid, zone: Zone) -> _Plan:
    prepared = solid.prepared
    members = prepared.sized.truss.members
    n_n, n_m = len(prepared.sized.truss.nodes), len(members)
    n = n_n + n_m
    points, radii, element = _balls(solid)
    reach = radii + zone.tolerance
    distance = _distance(points, zone.union(np.ones(len(zone.cells), bool)))
    outside, inside = np.ones(n, bool), np.ones(n, bool)
    np.logical_and.at(outside, element, distance > reach)
    np.logical_and.at(inside, element, distance < -reach)
    fate = np.where(outside, FAR, np.where(inside, ABSORBED, NEAR))
    near = fate == NEAR
    links = np.stack([members.ravel(), n_n + np.repeat(np.arange(n_m), 2)], axis=1)
    label = components(n, links[near[links].all(1)])
    used, numbers = np.unique(label[near], return_inverse=True)
    cluster = np.full(n, -1)
    cluster[near] = numbers
    # A cluster joins all groups that it touches.
    groups, ball = int(zone.group.max()) + 1, np.flatnonzero(near[element])
    joins = []
    for g in range(groups):
        hit = ball[_distance(points[ball], zone.union(zone.group == g)) <= reach[ball]]
        joins += [(g, groups + k) for k in np.unique(cluster[element[hit]]).tolist()]
    joined = components(groups + len(used), np.array(joins or [(0, 0)]))
    return _Plan(fate, cluster, joined[groups:], joined[zone.group])


def _distance(points: np.ndarray, body: "Manifold") -> np.ndarray:
    """Distances from the surface of a body, negative inside."""
    import igl

    return np.asarray(igl.signed_distance(points, *surface_of(body))[0])


def _balls(solid: TrussSolid) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Balls that cover the surface of the elements: their centres and radii (mm), and the element of each.

    Along tubes they are as thick as these; around nodes they sit on the vertices of the mesh.
    """
    prepared, mesh = solid.prepared, solid.mesh
    truss = prepared.sized.truss
    n_n, n_m = len(truss.nodes), len(truss.members)
    spine = prepared.tubes.spine_points(np.linspace(0, 1, SAMPLES))
    step = np.linalg.norm(np.diff(spine, axis=1), axis=2).max(1)
    thick = prepared.tubes.radius_range[1] + step / 2
    at_node = mesh.role != FaceRole.MEMBER
    node = np.repeat(element_of_part(prepared, mesh.role[at_node], mesh.owner[at_node]), 3)
    pairs = np.unique(np.stack([node, mesh.triangles[at_node].ravel()], axis=1), axis=0)
    small = np.full(len(pairs), VERTEX_BALL * float(prepared.sized.radii.max()))
    return (
        np.concatenate([mesh.vertices[pairs[:, 1]], spine.reshape(-1, 3)]),
        np.concatenate([small, np.repeat(thick, SAMPLES)]),
        np.concatenate([pairs[:, 0], n_n + np.repeat(np.arange(n_m), SAMPLES)]),
    )


# --- stubs and cells -------------------------------------------------------------------------------------------------


@dataclass(eq=False)
class _Pieces:
    """Faces as they come: what each is of, and whether it anchors its solid (see `_assemble`)."""

    faces: list[Any]
    tags: list[tuple[int, int, bool]]
    plain_nodes: int = 0


def _add_far_faces(solid: TrussSolid, far: np.ndarray, out: _Pieces) -> None:
    for f in np.flatnonzero(far).tolist():
        out.faces.append(solid.faces[f])
        out.tags.append((int(solid.face_role[f]), int(solid.face_owner[f]), True))


def _fuse_group(
    solid: TrussSolid, element: np.ndarray, zone: Zone, plan: _Plan, group: int, discs: "_Discs", out: _Pieces
) -> list[int]:
    """Unite the cells of one group with the stubs that touch it; adds the outer faces but discs to far elements.

    Returns the elements whose faces these are.
    """
    from michell_cad.cad.kernel_booleans import SplitError

    cells = np.flatnonzero(plan.cell_group == group).tolist()
    of_group = np.isin(plan.cluster, np.flatnonzero(plan.cluster_group == group))
    stubs = {e: _make_stub(solid, element, e, discs) for e in np.flatnonzero(of_group).tolist()}
    fault: Exception | None = None
    for _ in range(TRIES):
        # Discs at elements that are no stubs and not absorbed either: there the truss goes on.
        open_discs = {
            end: disc
            for stub in stubs.values()
            for end, disc in stub.discs.items()
            if plan.fate[stub.behind[end]] != ABSORBED and stub.behind[end] not in stubs
        }
        try:
            _fuse(zone, cells, list(stubs.values()), open_discs, out)
            return list(stubs)
        except _CircleError as error:
            fault = error
            behind = {end: other for stub in stubs.values() for end, other in stub.behind.items()}
            stubs |= {e: _make_stub(solid, element, e, discs) for e in sorted({behind[end] for end in error.ends})}
        except SplitError as error:
            fault = error
            # Arguments come as the cells, then the solids of one stub after the other.
            owner = [-1] * len(cells) + [e for e, stub in stubs.items() for _ in stub.solids]
            stubs = _simplify(solid.prepared, stubs, {owner[k] for k in error.arguments})
    names = sorted({zone.names[o] for o in zone.owner[cells].tolist()})
    raise GeometryKernelError(
        f"the truss could not be united with {', '.join(names)}: {fault}. Use a depth that differs by a few per cent"
    )


@dataclass(frozen=True, eq=False)
class _Stub:
    """The closed solids of an element: their faces with tags, the discs that end them, and the elements behind these.

    Discs and elements are given by member end.
    """

    solids: list[Any]
    faces: list[Any]
    tags: list[tuple[int, int, bool]]
    discs: dict[int, Any]
    behind: dict[int, int]
    node: int = -1
    plain: bool = False


class _CircleError(Exception):
    """The kernel changed the circles of some member ends where the truss goes on."""

    def __init__(self, ends: list[int]) -> None:
        super().__init__(f"the kernel changed {len(ends)} circles where the truss goes on")
        self.ends = ends


class _Discs:
    """The disc at the circle where a tube meets the surroundings of its node, made once; it looks along the member."""

    def __init__(self, prepared: PreparedTruss) -> None:
        self.centers = prepared.sized.truss.nodes[prepared.node_of_end] + (
            prepared.sizes.reach[:, None] * prepared.directions
        )
        self.prepared = prepared
        self.made: dict[int, Any] = {}

    def close(self, faces: Sequence[Any], ends: np.ndarray, turned: bool) -> dict[int, Any]:
        """Discs on the free edges of some faces, by end."""
        from michell_cad.cad import kernel_booleans as booleans

        p = self.prepared
        circles: dict[int, list[Any]] = {}
        for edge in booleans.free_edges(faces):
            arm = np.array(booleans.middle_of_edge(edge)) - self.centers[ends]
            off = np.abs(np.einsum("ed,ed->e", arm, p.directions[ends]))
            off += np.abs(np.linalg.norm(arm, axis=1) - p.sizes.end_radius[ends])
            circles.setdefault(int(ends[np.argmin(off)]), []).append(edge)
        for e, circle in circles.items():
            if e not in self.made:
                self.made[e] = booleans.make_disc(circle, self.centers[e].tolist(), p.directions[e].tolist())
        return {e: self.made[e].Reversed() if turned else self.made[e] for e in circles}


def _make_stub(solid: TrussSolid, element: np.ndarray, e: int, discs: _Discs) -> _Stub:
    from michell_cad.cad import kernel_booleans as booleans

    p = solid.prepared
    n_n = len(p.sized.truss.nodes)
    faces = np.flatnonzero(element == e).tolist()
    mine = [solid.faces[f] for f in faces]
    is_node = e < n_n
    ends = np.flatnonzero(p.node_of_end == e) if is_node else 2 * (e - n_n) + np.arange(2)
    closing = discs.close(mine, ends, turned=not is_node)
    behind = {end: n_n + end // 2 if is_node else int(p.node_of_end[end]) for end in closing}
    if is_node and p.sizes.creased[ends].any() and p.sizes.fillet[ends].any():
        # The kernel loses or adds volume where it cuts the fillets between members at acute angles.
        return _plain_node(p, e, closing, behind)
    made, _ = booleans.solids_of_faces([*mine, *closing.values()])
    if len(made) != 1:
        raise GeometryKernelError(f"a part of the truss comes out as {len(made)} solids")
    tags = [(int(solid.face_role[f]), int(solid.face_owner[f]), False) for f in faces]
    return _Stub(made, mine, tags, closing, behind, e if is_node else -1)


def _plain_node(p: PreparedTruss, node: int, discs: dict[int, Any], behind: dict[int, int]) -> _Stub:
    """A node without fillets: its ball, and a cylinder from its centre to each disc, in place of the direct faces."""
    from michell_cad.cad import kernel_booleans as booleans

    # The ball must not look out of a disc.
    radius = min(float(p.sizes.radius[node]), BALL * min(float(p.sizes.reach[end]) for end in discs))
    ball = booleans.make_ball(p.sized.truss.nodes[node].tolist(), radius)
    bars = []
    for end, disc in discs.items():
        # Bars end inside the ball, not all in one point, where the kernel would lose its way.
        room = radius**2 - float(p.sizes.end_radius[end]) ** 2
        length = float(p.sizes.reach[end]) - (BAR_END * np.sqrt(room) if room > 0 else 0.0)
        bars.append(booleans.extrude(disc, (-length * p.directions[end]).tolist()))
    solids = [ball, *bars]
    closing = booleans.FaceTable()
    for disc in discs.values():
        closing.put(disc, True)
    faces = [face for one in solids for face in booleans.faces_of(one) if not closing.get(face)]
    return _Stub(solids, faces, [(int(FaceRole.NODE), node, False)] * len(faces), discs, behind, node, plain=True)


def _simplify(p: PreparedTruss, stubs: dict[int, _Stub], faulty: set[int]) -> dict[int, _Stub]:
    """Stubs with nodes at fault made plain; all nodes, if none of those at fault is to blame."""
    full = {e for e, stub in stubs.items() if stub.node >= 0 and not stub.plain}
    chosen = full & faulty or full
    return stubs | {e: _plain_node(p, e, stubs[e].discs, stubs[e].behind) for e in sorted(chosen)}


def _fuse(zone: Zone, cells: list[int], stubs: list[_Stub], open_discs: dict[int, Any], out: _Pieces) -> None:
    from michell_cad.cad import kernel
    from michell_cad.cad import kernel_booleans as booleans

    pieces = booleans.split([zone.cells[c] for c in cells] + [one for stub in stubs for one in stub.solids])
    kept, cleared = set(), set()
    for c, of in zip(cells, pieces.of, strict=False):
        (kept if zone.is_kept[c] else cleared).update(of)
    chosen = sorted(kept | {i for of in pieces.of[len(cells) :] for i in of} - cleared)
    outer = booleans.outer_faces([pieces.solids[i] for i in chosen])
    try:
        solids, number = booleans.solids_of_faces(outer)
    except GeometryKernelError as error:
        raise booleans.SplitError(str(error), []) from error
    if not all(kernel.is_valid(solid) for solid in solids):
        raise booleans.SplitError("the kernel's own check finds a fault", [])
    outer = [face for face, k in zip(outer, number.tolist(), strict=True) if k >= 0]
    tag = booleans.FaceTable()
    for stub in stubs:
        for face, value in zip(stub.faces, stub.tags, strict=True):
            for image in pieces.images(face):
                tag.put(image, value)
    for kind in (False, True):
        for c in cells:
            if zone.is_kept[c] == kind:
                for face in booleans.faces_of(zone.cells[c]):
                    for image in pieces.images(face):
                        tag.put(image, (int(FaceRole.KEPT), int(zone.owner[c]), kind))
    discs, found = booleans.FaceTable(), booleans.FaceTable()
    for disc in open_discs.values():
        discs.put(disc, True)
    for face in outer:
        found.put(face, True)
    changed = [end for end, disc in open_discs.items() if not found.get(disc)]
    if changed:
        raise _CircleError(changed)
    for face in outer:
        if not discs.get(face):
            value = tag.get(face)
            # What is of no argument is a disc at an absorbed element, cut by a clearance or within rounding.
            out.faces.append(face)
            out.tags.append((int(FaceRole.KEPT), int(zone.owner[cells[0]]), False) if value is None else value)
    out.plain_nodes += sum(stub.plain for stub in stubs)


# --- the result ------------------------------------------------------------------------------------------------------


def _assemble(
    solid: TrussSolid, plan: _Plan, pieces: _Pieces, zone: Zone, mesh: TrussMesh, crumbs: float
) -> TrussSolid:
    """Solids of all faces. One without a far face or a face of kept material is a crumb, as for the mesh."""
    from michell_cad.cad import kernel
    from michell_cad.cad import kernel_booleans as booleans

    solids, component = booleans.solids_of_faces(pieces.faces)
    anchored = np.zeros(len(solids), bool)
    real = np.flatnonzero(component >= 0)
    np.logical_or.at(anchored, component[real], np.array([anchor for *_, anchor in pieces.tags])[real])
    number = np.cumsum(anchored) - 1
    faces = real[anchored[component[real]]]
    solids = [one for one, keep in zip(solids, anchored.tolist(), strict=True) if keep]
    if not all(kernel.is_closed(one) for one in solids):
        raise GeometryKernelError("the united solid is not closed; use a depth that differs by a few per cent")
    volume = sum(map(kernel.volume, solids))
    if not mesh.is_watertight or abs(volume / mesh.volume - 1) > LARGEST_VOLUME_DIFFERENCE:
        raise GeometryKernelError(
            f"the united solid has {volume:.6g} mm^3, its mesh {mesh.volume:.6g} mm^3 with "
            f"{len(mesh.open_triangles)} open triangles; use a depth that differs by a few per cent"
        )
    role, owner = (np.array([tag[k] for tag in pieces.tags])[faces] for k in (0, 1))
    n_n = len(solid.prepared.sized.truss.nodes)
    kept_volume = sum(kernel.volume(zone.cells[c]) for c in np.flatnonzero(zone.is_kept).tolist())
    kept = KeptReport(
        names=zone.names,
        volume_mm3=kept_volume,
        truss_volume_mm3=volume - kept_volume,
        faces=int((role == FaceRole.KEPT).sum()),
        members_absorbed=int((plan.fate[n_n:] == ABSORBED).sum()),
        members_cut=int((plan.fate[n_n:] == NEAR).sum()),
        plain_nodes=pieces.plain_nodes,
        crumbs_mm3=crumbs,
    )
    report = dataclasses.replace(
        solid.report,
        solids=len(solids),
        volume_mm3=volume,
        mesh_volume_mm3=mesh.volume,
        faces=len(faces),
        genus=None,
        expected_genus=None,
        messages=solid.report.messages + _messages(zone, plan, len(solids), kept),
        kept=kept,
    )
    return TrussSolid(
        solid.prepared,
        mesh,
        report,
        role,
        owner,
        number[component[faces]],
        tuple(solids),
        tuple(pieces.faces[f] for f in faces.tolist()),
    )


def _messages(zone: Zone, plan: _Plan, solids: int, kept: KeptReport) -> tuple[str, ...]:
    lines = []
    loose = sorted({zone.names[o] for o in zone.owner[zone.is_kept & ~np.isin(plan.cell_group, plan.cluster_group)]})
    if loose:
        lines.append(f"WARNING: no member reaches {', '.join(loose)}, or a piece of it: the result has {solids} solids")
    if kept.plain_nodes:
        lines.append(f"{kept.plain_nodes} nodes that enter kept solids have no fillets")
    if kept.crumbs_mm3 > 0:
        lines.append(f"{kept.crumbs_mm3:.3g} mm3 of members, cut off by a clearance, were dropped")
    return tuple(lines)
