"""What is reported of a built truss."""

from collections.abc import Mapping
from dataclasses import dataclass


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


@dataclass(frozen=True)
class SweptReport:
    """Figures of a truss of swept profiles, as the package's reports show them.

    Parameters
    ----------
    valid : whether all checks passed (always true for a truss that was handed out): every part is a valid solid of the
        kernel and has the volume of its mesh, and the united mesh is watertight.
    profile, node_form : what the members and the nodes look like.
    profile_aspect : by how much the profile is stretched.
    solids : connected bodies of the united mesh.
    volume_mm3 : of the united mesh. The kernel has the parts, which overlap at the nodes, not their union.
    parts, part_faces : number of solids of the kernel, for curves and nodes, and of their faces.
    part_volume_difference : largest difference between the volumes of a part and of its mesh (relative).
    genus, expected_genus : measured on the united mesh; members - nodes + components of the truss. They differ where
        members touch or overlap between their nodes.
    nodes, members : of the truss.
    straightened_members : members that do not follow their curve, since the profile would fold over itself.
    messages : one sentence for every kind of change or warning.
    """

    valid: bool
    profile: str
    profile_aspect: float
    node_form: str
    solids: int
    volume_mm3: float
    parts: int
    part_faces: int
    part_volume_difference: float
    genus: int
    expected_genus: int
    nodes: int
    members: int
    straightened_members: int
    messages: tuple[str, ...]
    kept: None = None
