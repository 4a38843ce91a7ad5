"""A sized truss that is ready to be built: spheres, mitres, seams and tubes all placed, as arrays."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from michell_cad.arrays import freeze
from michell_cad.cad.centerlines import Centerlines
from michell_cad.cad.creases import Creases, lay_creases
from michell_cad.cad.layout import SHORTEST_TUBE, Layout
from michell_cad.cad.mitres import NodeMitre
from michell_cad.cad.nodes import NodeSizes, cap_angle
from michell_cad.cad.spheres import Seams
from michell_cad.cad.tubes import Tubes
from michell_cad.truss import SizedTruss


@dataclass(frozen=True, eq=False)
class Changes:
    """Changes that were made to a truss.

    `touched` (n_n,) bool are the nodes that take part in one, numbered as in the changed truss.
    """

    touched: Bool[np.ndarray, " n_n"]
    merged_nodes: int
    rerouted_members: int
    joints: int
    original_members: int

    def __post_init__(self) -> None:
        freeze(self, touched=bool)

    def after(
        self,
        merges: Sequence[tuple[int, int]],
        detours: Sequence[tuple[int, int]],
        joints: int,
        number: Int[np.ndarray, " n"],
        n_nodes: int,
    ) -> "Changes":
        """The changes after a further `simplify_truss` with these arguments, which gave the nodes new numbers."""
        hit = np.r_[self.touched, np.ones(joints, bool)]
        hit[[i for pair in merges for i in pair] + [j for _, j in detours]] = True
        touched = np.zeros(n_nodes, bool)
        touched[number[hit & (number >= 0)]] = True
        merged, rerouted = self.merged_nodes + len(merges), self.rerouted_members + len(detours)
        return Changes(touched, merged, rerouted, self.joints + joints, self.original_members)


@dataclass(frozen=True, eq=False)
class PreparedTruss:
    """What `prepare_truss` decided; end 2 m + i is at node i of member m.

    Parameters
    ----------
    sized : the truss as it is built: short and near-parallel members may have been merged.
    design : design curves of its members.
    centerlines : the same, as they are built: some smoothed or straight, with other directions at their nodes.
    sizes : spheres, fillets, mitres.
    tubes : surfaces of the members.
    mitres : per mitred node.
    seams : per node.
    changes : what was changed in the truss itself.
    layout : what it was made from, to go on from if the kernel finds faults.
    fallback_nodes : nodes not built by the direct way, by kind.
    creased_nodes : nodes with members at acute angles, whose common crease is filleted.
    raised_nodes : spheres larger than wanted, so that the members leave side by side.
    reduced_nodes : smaller spheres or fillets than wanted.
    turned_ends : ends that aim farther along their curve than their tube begins, to keep clear of another member.
    straightened_members : members that do not follow their curve at all, since there is no room for the bend.
    messages : one sentence for every kind of change.
    """

    sized: SizedTruss
    design: Centerlines
    centerlines: Centerlines
    sizes: NodeSizes
    tubes: Tubes
    mitres: Mapping[int, NodeMitre]
    seams: Seams
    changes: Changes
    layout: Layout = field(repr=False)
    fallback_nodes: Mapping[str, int]
    creased_nodes: int
    raised_nodes: int
    reduced_nodes: int
    turned_ends: int
    straightened_members: int
    messages: tuple[str, ...]

    @cached_property
    def node_of_end(self) -> Int[np.ndarray, " n_e"]:
        """Node of each end."""
        return self.sized.truss.members.ravel()

    @property
    def shakes(self) -> Int[np.ndarray, " n_n"]:
        """How often the kernel found each node faulty before it was laid out like this."""
        return self.layout.shakes

    @cached_property
    def directions(self) -> Float[np.ndarray, "n_e 3"]:
        """Unit vectors from the nodes into the members."""
        return self.centerlines.directions.reshape(-1, 3)

    @cached_property
    def normals(self) -> Float[np.ndarray, "n_e 3"]:
        """Unit vectors to angle 0 of the circles at the ends; angles count about the direction."""
        return self.tubes.end_normals.reshape(-1, 3)

    @cached_property
    def caps(self) -> Float[np.ndarray, " n_e"]:
        """Half-angles of the caps that the ends take from their spheres."""
        return cap_angle(self.sizes.radius[self.node_of_end], self.sizes.end_radius, self.sizes.fillet)

    @cached_property
    def creases(self) -> Creases:
        """Tables of the filleted creases."""
        return lay_creases(
            self.mitres, self.sized.truss.nodes, self.directions, self.normals, np.asarray(self.sizes.fillet)
        )

    @cached_property
    def component(self) -> Int[np.ndarray, " n_n"]:
        """Number of the solid of each node; -1 for a node without members."""
        truss = self.sized.truss
        return node_components(truss.members, len(truss.nodes))


def node_components(members: Int[np.ndarray, "n_m 2"], n_nodes: int) -> Int[np.ndarray, " n_n"]:
    """Connected components of the nodes that have members, numbered by their first node; -1 for the others."""
    graph = coo_matrix((np.ones(len(members)), (members[:, 0], members[:, 1])), shape=(n_nodes, n_nodes))
    _, label = connected_components(graph, directed=False)
    used = np.zeros(n_nodes, bool)
    used[members.ravel()] = True
    component = np.full(n_nodes, -1)
    _, first = np.unique(label[used], return_index=True)
    renumber = np.empty(label.max() + 1, np.int64)
    order = label[used][np.sort(first)]
    renumber[order] = np.arange(len(order))
    component[used] = renumber[label[used]]
    return component


def node_room(prepared: PreparedTruss) -> Float[np.ndarray, " n_n"]:
    """Radius to which the thickest member at each node could grow, the others in proportion, mm.

    Then the shortest member there would have no tube left between its two nodes; inf for a node without members.
    """
    truss, sizes = prepared.sized.truss, prepared.sizes
    reach, r = sizes.reach.reshape(-1, 2), sizes.end_radius.reshape(-1, 2)
    taken = (reach.sum(1) + SHORTEST_TUBE * r.mean(1)) / truss.lengths
    most, widest = np.zeros(len(truss.nodes)), np.zeros(len(truss.nodes))
    np.maximum.at(most, truss.members, taken[:, None])
    np.maximum.at(widest, truss.members, prepared.sized.radii[:, [0, 2]])
    return np.divide(widest, most, out=np.full(len(most), np.inf), where=most > 0)
