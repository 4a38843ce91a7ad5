"""The truss as a solid: prepare, build, check, and describe what was done.

Nothing that fails a check is handed out: the kernel's own check, one solid for each connected component, the volume
against the direct mesh, and the genus. (The kernel's check alone accepts solids with a third of their volume.)
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from michell_cad.arrays import require
from michell_cad.cad.assembly import AssemblyPart, build_assembly
from michell_cad.cad.built import BuiltSolid
from michell_cad.cad.clearance import Crossings, crossing_tubes
from michell_cad.cad.faults import FaultFinder, nodes_of_parts
from michell_cad.cad.fidelity import curve_deviation, design_gaps
from michell_cad.cad.mesh import SEGMENTS, TrussMesh, mesh_truss
from michell_cad.cad.prepare import prepare_truss
from michell_cad.cad.prepared import PreparedTruss
from michell_cad.cad.shell import assemble_shell
from michell_cad.cad.solid_report import SolidReport
from michell_cad.cad.swept_solid import SweptSolid, build_swept
from michell_cad.errors import GeometryKernelError
from michell_cad.knobs import Knobs
from michell_cad.linear_solver import free_memory
from michell_cad.truss import SizedTruss

LARGEST_VOLUME_DIFFERENCE = 2e-3
"""Between the solid and its direct mesh (relative); the two agree within 1e-3 unless something is wrong."""

KERNEL_TRIES = 10
"""Times that a solid is built; nodes that the kernel finds faulty are laid out in another way each time."""

MEMBER_BYTES = 250_000
"""Memory that a member takes at most, until its solid is written (10,000 curved, tapered members take 2.5 GB)."""

NAMED = 5
"""Crossing pairs that a message names."""


@dataclass(frozen=True, eq=False)
class TrussSolid(BuiltSolid):
    """The solids of a truss of round members with their direct mesh and report.

    Parameters
    ----------
    prepared : the truss as built.
    report : SolidReport
    """

    report: SolidReport
    prepared: PreparedTruss

    @property
    def sized(self) -> SizedTruss:
        """The truss as built."""
        return self.prepared.sized

    @property
    def node_balls(self) -> Float[np.ndarray, " n_n"]:
        """Radii of the spheres."""
        return np.asarray(self.prepared.sizes.radius)

    @property
    def kept_names(self) -> tuple[str, ...]:
        """Names of the kept solids, by owner of their faces."""
        return () if self.report.kept is None else self.report.kept.names

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


def build_solid(
    sized: SizedTruss, knobs: Knobs, progress: Callable[[float], None] | None = None
) -> TrussSolid | SweptSolid:
    """Build a truss and check it: round members by `build_round_solid`, other profiles by `build_swept`.

    Parameters
    ----------
    sized : the truss with the radii of its members.
    knobs : those of profile, nodes and fillets are used; what else knobs hold is in `sized` already.
    progress : called with the fraction done, from 0 to 1.

    Raises
    ------
    InvalidInputError
        If the memory that is free is too small for so many members; and as these.
    GeometryKernelError
        As these.
    """
    _require_memory(len(sized.truss.members))
    return build_swept(sized, knobs, progress) if knobs.swept else build_round_solid(sized, knobs, progress)


def build_round_solid(
    sized: SizedTruss,
    knobs: Knobs,
    progress: Callable[[float], None] | None = None,
    segments: int = SEGMENTS,
) -> TrussSolid:
    """Build the solids of a truss of round members, with fillets, and check them.

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
    role, owner, component = plan.faces.role, plan.faces.owner, plan.faces.component
    return TrussSolid(mesh, report, role, owner, component, tuple(solids), tuple(faces), prepared)


def _require_memory(members: int) -> None:
    needed, free = MEMBER_BYTES * members, free_memory()
    # Keeping every k-th curve of all families leaves a k^3-th of the nodes.
    every = max(2, int(np.ceil((needed / max(free, 1)) ** (1 / 3))))
    require(
        needed <= free,
        f"the solid of {members} members would take about {needed / 1e9:.1f} GB of memory, {free / 1e9:.1f} GB are "
        f"free: set every = {every}, choose fewer families or a smaller resolution, or close other programs",
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
    bodies = mesh.bodies
    genus = bodies - mesh.euler_number // 2
    expected = len(truss.members) - len(used) + components
    volume = float(sum(volumes))
    if bodies != components or genus != expected:
        raise GeometryKernelError(
            f"expected {components} bodies of genus {expected} in all, the mesh has {bodies} of genus {genus}: "
            "members must be touching; use a smaller radius"
        )
    difference = abs(volume / mesh.volume - 1)
    if not (min(volumes) > 0 and difference <= LARGEST_VOLUME_DIFFERENCE):  # a volume that is no number is none, too
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
