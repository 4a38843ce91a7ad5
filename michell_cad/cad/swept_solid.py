"""A truss whose members have any profile: swept along the curves, united as a mesh, in CAD one solid for each curve.

The direct shell of round trusses rests on circles, on which spheres, tubes and fillets meet. Other profiles have no
such circles. Their mesh is united by manifold3d, exactly and watertight; as CAD solids they stay parts, one for each
path of a curve (`sweep_paths`) and one for each node, which overlap at the nodes. There are no fillets.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from michell_cad.arrays import require
from michell_cad.cad.assembly import AssemblyPart
from michell_cad.cad.built import BuiltSolid
from michell_cad.cad.solid_report import SweptReport
from michell_cad.cad.sweep_hulls import lay_hulls
from michell_cad.cad.sweep_mesh import Body, mesh_ball, mesh_hull, mesh_sweep, node_radii, unite_bodies
from michell_cad.cad.sweep_paths import lay_paths
from michell_cad.cad.sweeps import lay_sweeps
from michell_cad.errors import GeometryKernelError
from michell_cad.knobs import Knobs
from michell_cad.palette import GROUPS, NODES
from michell_cad.truss import SizedTruss, Truss

LARGEST_PART_DIFFERENCE = 2e-3
"""Between a solid and its mesh (relative), as for the solids of round trusses."""

PART_ACCURACIES = (1e-4, 1e-6)
"""Of the kernel's volumes of parts. The first errs by up to 3e-3 along curves that turn often; what it condemns is
measured again, twenty times as slowly."""


@dataclass(frozen=True, eq=False)
class SweptSolid(BuiltSolid):
    """A truss of swept profiles; its `solids` are the parts, and its `mesh` is their union.

    Parameters
    ----------
    report : SweptReport
    built : the truss with its radii.
    part_names : of the parts, with their group: the family of the curve, or `palette.NODES`.
    """

    report: SweptReport
    built: SizedTruss
    part_names: tuple[tuple[str, str], ...]

    @property
    def sized(self) -> SizedTruss:
        """The truss with its radii."""
        return self.built

    @property
    def node_balls(self) -> Float[np.ndarray, " n_n"]:
        """None: what nodes add to the stiffness of swept members is left out."""
        return np.zeros(len(self.built.truss.nodes))

    @property
    def kept_names(self) -> tuple[str, ...]:
        """Nothing is united with swept profiles."""
        return ()

    @cached_property
    def assembly(self) -> tuple[AssemblyPart, ...]:
        """The parts, ordered by group."""
        parts = [
            AssemblyPart(group, name, one) for (group, name), one in zip(self.part_names, self.solids, strict=True)
        ]
        return tuple(sorted(parts, key=lambda part: GROUPS.index(part.group)))


@dataclass(frozen=True, eq=False)
class _Parts:
    """Parts of a truss while they are made: group and name, mesh, and what makes the solid of the kernel."""

    names: list[tuple[str, str]]
    bodies: list[Body]
    makers: list[Callable[[], Any]]


def build_swept(sized: SizedTruss, knobs: Knobs, progress: Callable[[float], None] | None = None) -> SweptSolid:
    """Build a truss of the knobs' profile, and check it.

    Parameters
    ----------
    sized : the truss with the radii of its members: those of circles of the profile's area.
    knobs : `profile`, `profile_aspect`, `node_form` and `node_ratio` are used.
    progress : called with the fraction done, from 0 to 1.

    Raises
    ------
    InvalidInputError
        If the truss has no members.
    GeometryKernelError
        If a part is not valid or not of the volume of its mesh, or their union is not watertight; names curves.
    """
    require(len(sized.truss.members), "a truss without members has no solid")
    tell = progress or (lambda fraction: None)
    parts, straightened = _lay_parts(sized, knobs)
    tell(0.1)
    mesh = unite_bodies(parts.bodies)
    if not mesh.is_watertight:
        raise GeometryKernelError(
            f"the united mesh has {len(mesh.open_triangles)} triangles with open edges: use a slightly other radius"
        )
    tell(0.5)
    solids, faces, difference = _make_solids(parts, float(sized.radii.max()), lambda f: tell(0.5 + 0.5 * f))
    component = np.repeat(np.arange(len(solids)), [len(some) for some in faces])
    body = [parts.bodies[k] for k in component.tolist()]
    report = _report(sized, knobs, mesh, len(solids), len(component), difference, straightened)
    return SweptSolid(
        mesh,
        report,
        np.array([int(one.role) for one in body]),
        np.array([int(one.owner[0]) for one in body]),
        component,
        tuple(solids),
        tuple(face for some in faces for face in some),
        sized,
        tuple(parts.names),
    )


def swept_volume(sized: SizedTruss, knobs: Knobs) -> float:
    """Volume of the united mesh of a truss of the knobs' profile, mm^3."""
    return unite_bodies(_lay_parts(sized, knobs)[0].bodies).volume


def _lay_parts(sized: SizedTruss, knobs: Knobs) -> tuple[_Parts, int]:
    """The parts, and the number of straightened members."""
    from michell_cad.cad import kernel_sweeps

    profile, truss, size = knobs.shape, sized.truss, float(sized.radii.max())
    paths = lay_paths(sized, profile.reach)
    sweeps = lay_sweeps(paths, truss)
    parts = _Parts([], [], [])
    seen: Counter[int] = Counter()
    for sweep in sweeps:
        curve = truss.curves[sweep.curve]
        seen[sweep.curve] += 1
        count = seen[sweep.curve]
        parts.names.append((curve.family, curve.name if count == 1 else f"{curve.name} part {count}"))
        parts.bodies.append(mesh_sweep(sweep, profile))
        parts.makers.append(lambda sweep=sweep: kernel_sweeps.make_sweep(sweep, profile, size))
    radii = node_radii(sized, knobs.node_ratio)
    hulls = lay_hulls(sweeps, profile, radii, sized) if knobs.node_form == "hull" else {}
    for node, radius in radii.items():
        parts.names.append((NODES, f"node {node}"))
        if node in hulls:
            hull = hulls[node]
            parts.bodies.append(mesh_hull(hull, node))
            parts.makers.append(lambda hull=hull: kernel_sweeps.make_hull(hull, size))
        else:
            center = truss.nodes[node]
            parts.bodies.append(mesh_ball(center, radius, node))
            parts.makers.append(lambda center=center, radius=radius: kernel_sweeps.make_ball(center, radius))
    return parts, len(paths.straightened)


def _make_solids(
    parts: _Parts, radius: float, progress: Callable[[float], None]
) -> tuple[list[Any], list[list[Any]], float]:
    """The solids, their faces, and the largest difference of a volume from that of its mesh (relative)."""
    from michell_cad.cad import kernel, kernel_sweeps

    solids, faces, worst = [], [], 0.0
    every = max(1, len(parts.makers) // 20)
    for k, ((_, name), body, make) in enumerate(zip(parts.names, parts.bodies, parts.makers, strict=True)):
        solid = make()
        for accuracy in PART_ACCURACIES:
            difference = abs(kernel.volume(solid, accuracy) / body.volume - 1)
            if difference <= LARGEST_PART_DIFFERENCE:
                break
        if not kernel.is_valid(solid) or difference > LARGEST_PART_DIFFERENCE:
            raise GeometryKernelError(
                f"{name} does not come out as a valid solid (its volume differs by {difference:.2%} from that of its "
                f"mesh): the largest radius is {radius:.4g} mm, use at most {0.8 * radius:.3g} mm"
            )
        solids.append(solid)
        faces.append(kernel_sweeps.faces_of(solid))
        worst = max(worst, difference)
        if k % every == 0:
            progress(k / len(parts.makers))
    progress(1.0)
    return solids, faces, worst


def _report(
    sized: SizedTruss, knobs: Knobs, mesh: Any, parts: int, faces: int, difference: float, straightened: int
) -> SweptReport:
    truss = sized.truss
    nodes = len(np.unique(truss.members))
    components = _components(truss)
    genus, expected = mesh.bodies - mesh.euler_number // 2, len(truss.members) - nodes + components
    messages = []
    if straightened:
        messages.append(f"{straightened} members are straight: their profile is too wide for their bend")
    if genus != expected or mesh.bodies != components:
        messages.append(
            f"the united mesh has {mesh.bodies} bodies of genus {genus} in all instead of {components} of {expected}: "
            "members touch or overlap between their nodes"
        )
    return SweptReport(
        valid=True,
        profile=knobs.profile if isinstance(knobs.profile, str) else "own",
        profile_aspect=knobs.profile_aspect,
        node_form=knobs.node_form,
        solids=mesh.bodies,
        volume_mm3=mesh.volume,
        parts=parts,
        part_faces=faces,
        part_volume_difference=difference,
        genus=genus,
        expected_genus=expected,
        nodes=nodes,
        members=len(truss.members),
        straightened_members=straightened,
        messages=tuple(messages),
    )


def _components(truss: Truss) -> int:
    n = len(truss.nodes)
    ends = tuple(truss.members.T)
    _, label = connected_components(coo_matrix((np.ones(len(truss.members)), ends), shape=(n, n)), directed=False)
    return len(np.unique(label[truss.members[:, 0]]))
