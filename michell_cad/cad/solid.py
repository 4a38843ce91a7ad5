"""The truss as a solid: prepare, build, check, and describe what was done.

Nothing that fails a check is handed out: the kernel's own check, one solid for each connected component, the volume
against the direct mesh, and the genus. (The kernel's check alone accepts solids with a third of their volume.)
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Int
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from michell_cad.arrays import freeze, require
from michell_cad.cad.assembly import AssemblyPart, build_assembly
from michell_cad.cad.clearance import Crossings, crossing_tubes
from michell_cad.cad.faults import FaultFinder, nodes_of_parts
from michell_cad.cad.fidelity import curve_deviation, design_gaps
from michell_cad.cad.mesh import SEGMENTS, TrussMesh, mesh_truss
from michell_cad.cad.prepare import prepare_truss
from michell_cad.cad.prepared import PreparedTruss
from michell_cad.cad.shell import assemble_shell
from michell_cad.cad.shell_plan import FaceRole
from michell_cad.errors import GeometryKernelError
from michell_cad.knobs import Knobs
from michell_cad.truss import SizedTruss

LARGEST_VOLUME_DIFFERENCE = 2e-3
"""Between the solid and its direct mesh (relative); the two agree within 1e-3 unless something is wrong."""

KERNEL_TRIES = 10
"""Times that a solid is built; nodes that the kernel finds faulty are laid out in another way each time."""

NAMED = 5
"""Crossing pairs that a message names."""


@dataclass(frozen=True)
class KeptReport:
    """What was united with a truss.

    Parameters
    ----------
    names : of the kept solids.
    volume_mm3 : of the kept solids together.
    truss_volume_mm3 : what the truss adds to it: all of it outside of the kept solids and their clearance.
    faces : faces of the result that come from kept solids or bound their clearance.
    members_absorbed : members wholly within the kept solids or their clearance, which are gone.
    members_cut : members that the kernel cut where they enter.
    plain_nodes : nodes there that have no fillets in the solid, since the kernel cuts them badly; the mesh has them.
    crumbs_mm3 : volume of pieces that clearances cut off from everything else, which were dropped.
    """

    names: tuple[str, ...]
    volume_mm3: float
    truss_volume_mm3: float
    faces: int
    members_absorbed: int
    members_cut: int
    plain_nodes: int
    crumbs_mm3: float


@dataclass(frozen=True)
class SolidReport:
    """Figures of a solid, as the package's reports show them.

    Parameters
    ----------
    valid : whether all checks passed (always true for a solid that was handed out).
    solids : number of solids, one for each connected component.
    volume_mm3, mesh_volume_mm3 : of the kernel's solids, and of the direct mesh.
    faces : number of faces.
    genus, expected_genus : measured on the mesh; sum over components of members - nodes + 1.
    nodes, members : of the truss as built.
    filleted_nodes : nodes at which every member has its fillet.
    fallback_nodes : nodes not built by the direct way, by kind: ``merged`` (nodes moved, merged or given rerouted
        members), and ``mitred`` (members at acute angles that meet in sharp edges, only where no fillets are wanted).
    creased_nodes : nodes with members at acute angles, whose common crease is filleted.
    raised_nodes, reduced_nodes : spheres larger, spheres or fillets smaller than the knobs ask for.
    turned_ends : ends that aim farther along their curve than their tube begins, to keep clear of another member.
    straightened_members, merged_members : members that do not follow their curve; members gone.
    crossings : pairs of members that overlap without a common node, which no check of the kernel sees.
    curve_deviation_mm : largest distance of a centre line from the design curve of its member.
    members_off_curve : members whose centre line is farther than their radius from it somewhere.
    design_gap_mm : largest distance of a design curve, before any changes, from the nearest centre line.
    messages : one sentence for every kind of change or warning.
    kept : what was united with the truss; then there is no genus, and `expected_genus` is none either.
    """

    valid: bool
    solids: int
    volume_mm3: float
    mesh_volume_mm3: float
    faces: int
    genus: int | None
    expected_genus: int | None
    nodes: int
    members: int
    filleted_nodes: int
    fallback_nodes: Mapping[str, int]
    creased_nodes: int
    raised_nodes: int
    reduced_nodes: int
    turned_ends: int
    straightened_members: int
    merged_members: int
    crossings: int
    curve_deviation_mm: float
    members_off_curve: int
    design_gap_mm: float
    messages: tuple[str, ...]
    kept: KeptReport | None = None


@dataclass(frozen=True, eq=False)
class TrussSolid:
    """The solids of a truss with their direct mesh and report.

    Parameters
    ----------
    prepared : the truss as built.
    mesh : watertight triangle mesh of the same geometry.
    report : SolidReport
    face_role, face_owner : (n_f,) int, what each face is of: `FaceRole`, and number of the node, end or member.
    face_component : (n_f,) int, the solid that has the face.
    solids, faces : handles of the CAD kernel; see `build123d` and `cadquery` for objects to work with.
    """

    prepared: PreparedTruss
    mesh: TrussMesh
    report: SolidReport
    face_role: Int[np.ndarray, " n_f"]
    face_owner: Int[np.ndarray, " n_f"]
    face_component: Int[np.ndarray, " n_f"]
    solids: tuple[Any, ...] = field(repr=False)
    faces: tuple[Any, ...] = field(repr=False)

    @property
    def kept_names(self) -> tuple[str, ...]:
        """Names of the kept solids, by owner of their faces."""
        return () if self.report.kept is None else self.report.kept.names

    def __post_init__(self) -> None:
        freeze(self, face_role=np.int64, face_owner=np.int64, face_component=np.int64)

    @cached_property
    def face_curve(self) -> Int[np.ndarray, " n_f"]:
        """The curve of each face's member; -1 for the faces of nodes and of kept solids."""
        return curve_of_part(self.prepared, self.face_role, self.face_owner)

    @cached_property
    def assembly(self) -> tuple[AssemblyPart, ...]:
        """One solid for each bar and each node, built and checked when first asked for.

        Raises
        ------
        InvalidInputError
            If the truss has been united with kept solids: the bars that enter them are no parts of their own any more.
        """
        require(
            self.report.kept is None,
            "a truss that is united with kept solids has no parts: write it as one solid, or without [[keep]]",
        )
        return build_assembly(self.prepared)

    @cached_property
    def build123d(self) -> Any:
        """A build123d Solid, or a Compound if there are several."""
        from michell_cad.cad import kernel

        return kernel.as_build123d(self.solids)

    @cached_property
    def cadquery(self) -> Any:
        """A CadQuery Workplane with the solids on its stack."""
        from michell_cad.cad import kernel

        return kernel.as_cadquery(self.solids)

    @cached_property
    def cadquery_assembly(self) -> Any:
        """A CadQuery Assembly whose faces have the names and colours that STEP files give them."""
        from michell_cad.cad import kernel
        from michell_cad.cad.step import face_tags

        tags = zip(self.faces, self.face_component.tolist(), face_tags(self), strict=True)
        return kernel.as_cadquery_assembly(
            self.solids, [(face, number, name, colour) for face, number, (name, colour, _) in tags]
        )


def curve_of_part(
    prepared: PreparedTruss, role: Int[np.ndarray, " n"], owner: Int[np.ndarray, " n"]
) -> Int[np.ndarray, " n"]:
    """Number of the curve that faces or triangles belong to, by role and owner; -1 at nodes and on kept solids."""
    curve = prepared.sized.truss.curve_of_member
    none = (role == FaceRole.NODE) | (role == FaceRole.KEPT)
    member = np.where(role == FaceRole.MEMBER, owner, owner // 2)
    return np.where(none, -1, curve[np.where(none, 0, member)])


def build_solid(
    sized: SizedTruss,
    knobs: Knobs,
    progress: Callable[[float], None] | None = None,
    segments: int = SEGMENTS,
) -> TrussSolid:
    """Build the solids of a truss, with fillets, and check them.

    Parameters
    ----------
    sized : the truss with the radii of its members.
    knobs : `node_ratio` and `fillet_ratio` are used; what else knobs hold is in `sized` already.
    progress : called with the fraction done, from 0 to 1.
    segments : sides of the polygons of the direct mesh.

    Raises
    ------
    InvalidInputError
        If the truss has no members.
    GeometryKernelError
        If no valid solid comes out; names curves, and a radius that would work.
    """
    from michell_cad.cad import kernel

    require(len(sized.truss.members), "a truss without members has no solid")
    tell = _rising(progress)
    prepared = prepare_truss(sized, knobs, lambda f: tell(0.1 * f))
    finder = FaultFinder()
    for _ in range(KERNEL_TRIES):
        plan = assemble_shell(prepared)
        tell(0.2)
        solids, faces = kernel.make_solids(plan, lambda f: tell(0.2 + 0.2 * f))
        nodes = finder.find(prepared, plan, solids, faces)
        tell(0.7)
        if not len(nodes):
            mesh = mesh_truss(prepared, segments)
            tell(0.9)
            nodes = nodes_of_parts(prepared, mesh.role[mesh.open_triangles], mesh.owner[mesh.open_triangles])
            if not len(nodes):
                break
        fault = _name_faults(prepared, nodes)
        prepared = prepare_truss(sized, knobs, previous=prepared, shaken=nodes.tolist())
    else:
        raise GeometryKernelError(fault)
    report = _report(sized, prepared, mesh, plan.components, len(faces), [kernel.volume(solid) for solid in solids])
    tell(1.0)
    return TrussSolid(
        prepared, mesh, report, plan.faces.role, plan.faces.owner, plan.faces.component, tuple(solids), tuple(faces)
    )


def _rising(progress: Callable[[float], None] | None) -> Callable[[float], None]:
    """The same callback, told no smaller fraction than before when nodes are built anew."""
    highest = 0.0

    def tell(fraction: float) -> None:
        nonlocal highest
        highest = max(highest, fraction)
        if progress is not None:
            progress(highest)

    return tell


def _name_faults(prepared: PreparedTruss, nodes: np.ndarray) -> str:
    truss = prepared.sized.truss
    members = np.flatnonzero(np.isin(truss.members, nodes).any(1))
    names = sorted({truss.curves[truss.curve_of_member[m]].name for m in members})
    radius = float(prepared.sized.radii.max())
    return (
        f"the solid comes out faulty at {len(nodes)} nodes on the curves {_some(names)}, "
        "also with larger spheres, smaller fillets and straight members. "
        f"The largest radius is {radius:.4g} mm: use at most {0.8 * radius:.3g} mm, or fewer curves"
    )


def _some(names: Sequence[str]) -> str:
    rest = len(names) - NAMED
    return ", ".join(names[:NAMED]) + (f" and {rest} more" if rest > 0 else "")


def _report(
    sized: SizedTruss,
    prepared: PreparedTruss,
    mesh: TrussMesh,
    components: int,
    faces: int,
    volumes: Sequence[float],
) -> SolidReport:
    truss, sizes = prepared.sized.truss, prepared.sizes
    used = np.unique(truss.members)
    bodies = mesh_bodies(mesh)
    genus = bodies - mesh.euler_number // 2
    expected = len(truss.members) - len(used) + components
    volume = float(sum(volumes))
    if bodies != components or genus != expected:
        raise GeometryKernelError(
            f"expected {components} bodies of genus {expected} in all, the mesh has {bodies} of genus {genus}: "
            "members must be touching; use a smaller radius"
        )
    difference = abs(volume / mesh.volume - 1)
    if min(volumes) <= 0 or difference > LARGEST_VOLUME_DIFFERENCE:
        raise GeometryKernelError(
            f"the solid has {volume:.6g} mm^3, its direct mesh {mesh.volume:.6g} mm^3: "
            f"a difference of {difference:.2%} instead of at most {LARGEST_VOLUME_DIFFERENCE:.2%}; use a smaller radius"
        )
    crossings, deviation, gaps = crossing_tubes(prepared), curve_deviation(prepared), design_gaps(sized, prepared)
    plain = np.ones(len(truss.nodes), bool)
    plain[prepared.node_of_end[sizes.fillet <= 0]] = False
    return SolidReport(
        valid=True,
        solids=components,
        volume_mm3=volume,
        mesh_volume_mm3=mesh.volume,
        faces=faces,
        genus=genus,
        expected_genus=expected,
        nodes=len(used),
        members=len(truss.members),
        filleted_nodes=int(plain[used].sum()),
        fallback_nodes=dict(prepared.fallback_nodes),
        creased_nodes=prepared.creased_nodes,
        raised_nodes=prepared.raised_nodes,
        reduced_nodes=prepared.reduced_nodes,
        turned_ends=prepared.turned_ends,
        straightened_members=prepared.straightened_members,
        merged_members=prepared.changes.original_members - len(truss.members),
        crossings=len(crossings.depth),
        curve_deviation_mm=float(deviation.max()),
        members_off_curve=int((deviation > prepared.tubes.radius_range[0]).sum()),
        design_gap_mm=float(gaps.max()),
        messages=(
            *prepared.messages,
            *_tell_deviations(prepared, deviation),
            *_tell_gaps(sized, gaps),
            *_warn_crossings(prepared, crossings),
        ),
    )


def mesh_bodies(mesh: TrussMesh) -> int:
    """Number of connected bodies of a mesh."""
    t, n = mesh.triangles, len(mesh.vertices)
    ends = (t[:, [0, 1]].ravel(), t[:, [1, 2]].ravel())
    _, label = connected_components(coo_matrix((np.ones(len(ends[0])), ends), shape=(n, n)), directed=False)
    return len(np.unique(label[t[:, 0]]))


def _tell_deviations(prepared: PreparedTruss, deviation: np.ndarray) -> tuple[str, ...]:
    truss = prepared.sized.truss
    far = np.flatnonzero(deviation > prepared.tubes.radius_range[0])
    if not len(far):
        return ()
    worst = far[np.argmax(deviation[far])]
    name = truss.curves[truss.curve_of_member[worst]].name
    return (
        f"{len(far)} of {len(deviation)} members run farther than their radius from their design curve, "
        f"at most {deviation[worst]:.3g} mm, on {name}",
    )


def _tell_gaps(sized: SizedTruss, gaps: np.ndarray) -> tuple[str, ...]:
    truss = sized.truss
    far = np.flatnonzero(gaps > sized.radii.max(1))
    if not len(far):
        return ()
    owner = truss.curve_of_member[far]
    names = [truss.curves[c].name for c in dict.fromkeys(owner[np.argsort(-gaps[far], kind="stable")].tolist())]
    return (
        f"{len(far)} members of the truss have no member of the solid within their radius, since nodes were merged or "
        f"members led another way: up to {gaps.max():.3g} mm are between, on {_some(names)}",
    )


def _warn_crossings(prepared: PreparedTruss, crossings: Crossings) -> tuple[str, ...]:
    if not len(crossings.depth):
        return ()
    truss = prepared.sized.truss
    owner = truss.curve_of_member
    pairs = [
        f"{truss.curves[owner[a]].name} with {truss.curves[owner[b]].name} ({depth:.2g} mm deep)"
        for (a, b), depth in zip(crossings.members, crossings.depth, strict=True)
    ]
    return (
        f"WARNING: {len(pairs)} pairs of members overlap without a common node, "
        f"so that the solid intersects itself there: {_some(pairs)}",
    )
