"""The truss as a value: nodes, members, and the labelled curves that share them.

A truss is the graph of Arora et al. 2019, Section 4.4 (Eqs. 12 and 13), read as three families of curves (and boundary
and sharp-feature curves, see `michell_cad.curves`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from michell_cad.arrays import freeze, require
from michell_cad.curves import Curve, CurveKind


@dataclass(frozen=True, eq=False)
class Truss:
    """Labelled curves over shared nodes and members.

    Parameters
    ----------
    nodes : (n_n, 3) float, mm.
    node_kinds : (n_n,) int, values of `NodeKind`.
    members : (n_m, 2) int, ascending node numbers, each pair of nodes at most once.
    curves : every member belongs to at least one curve. A boundary and an interior curve that run between the same
        two nodes share one member.
    spacing : edge of a typical truss cell, mm: the median over the part of the cell edges of the parametrization.
    waypoints : (n_w, 3) float, mm, points between the two nodes of a member through which it runs as well, in order
        from its first node to its second; those of member m are ``waypoint_offsets[m] : waypoint_offsets[m + 1]``.
        Default: none. A crossing node that a thinner truss no longer needs lives on as a waypoint.
    waypoint_offsets : (n_m + 1,) int.
    straight : whether members run straight between their nodes and waypoints, instead of along smooth curves.

    Raises
    ------
    InvalidInputError
        If a member repeats or joins a node with itself, a curve leaves its members, or a member has no curve.
    """

    nodes: Float[np.ndarray, "n_n 3"]
    node_kinds: Int[np.ndarray, " n_n"]
    members: Int[np.ndarray, "n_m 2"]
    curves: tuple[Curve, ...]
    spacing: float
    waypoints: Float[np.ndarray, "n_w 3"] | None = None
    waypoint_offsets: Int[np.ndarray, " n_m1"] | None = None
    straight: bool = False

    def __post_init__(self) -> None:
        if self.waypoints is None:
            object.__setattr__(self, "waypoints", np.zeros((0, 3)))
            object.__setattr__(self, "waypoint_offsets", np.zeros(len(self.members) + 1, np.int64))
        freeze(self, nodes=np.float64, node_kinds=np.int64, members=np.int64)
        freeze(self, waypoints=np.float64, waypoint_offsets=np.int64)
        _check_offsets(np.asarray(self.waypoint_offsets), len(self.members), len(np.asarray(self.waypoints)))
        M, n_n = self.members, len(self.nodes)
        require(np.isfinite(self.nodes).all(), "the nodes of a truss must be finite")
        require(len(self.node_kinds) == n_n, f"node_kinds must have {n_n} entries, found {len(self.node_kinds)}")
        require(self.spacing > 0, f"spacing must be positive, found {self.spacing}")
        if not len(M):
            require(not self.curves, "a truss without members has no curves")
            return
        require(M.min() >= 0 and M.max() < n_n, f"members must index the {n_n} nodes")
        require((M[:, 0] < M[:, 1]).all(), "the two nodes of a member must differ and be in ascending order")
        require(len(np.unique(M[:, 0] * n_n + M[:, 1])) == len(M), "two members join the same two nodes")
        covered = np.zeros(len(M), bool)
        nodes, following, members = curve_steps(self.curves)
        ends = np.sort(np.stack([nodes, following], axis=1), axis=1)
        require((ends == M[members]).all(), "a curve must step from node to node along its members")
        covered[members] = True
        require(covered.all(), f"{(~covered).sum()} members belong to no curve")
        labels = {(curve.kind, curve.isovalues, curve.component) for curve in self.curves}
        require(len(labels) == len(self.curves), "two curves have the same kind, isovalues and component")

    @cached_property
    def degrees(self) -> Int[np.ndarray, " n_n"]:
        """Number of members at each node."""
        return np.bincount(self.members.ravel(), minlength=len(self.nodes))

    @cached_property
    def lengths(self) -> Float[np.ndarray, " n_m"]:
        """Distances between the two nodes of each member, mm."""
        a, b = self.nodes[self.members].transpose(1, 0, 2)
        return np.linalg.norm(b - a, axis=1)

    @cached_property
    def curve_of_member(self) -> Int[np.ndarray, " n_m"]:
        """The curve that names each member: its interior curve if it has one, else boundary, else feature."""
        return self._first_curve_of_member((CurveKind.INTERIOR, CurveKind.BOUNDARY, CurveKind.FEATURE))

    @cached_property
    def shape_of_member(self) -> Int[np.ndarray, " n_m"]:
        """The curve that shapes each member: its feature curve if it has one, else boundary, else interior.

        Where an interior curve was merged with the surface its member has to stay there.
        """
        return self._first_curve_of_member((CurveKind.FEATURE, CurveKind.BOUNDARY, CurveKind.INTERIOR))

    def _first_curve_of_member(self, kinds: tuple[CurveKind, ...]) -> np.ndarray:
        """A curve of each member, of the first of the given kinds that it has, and of these the first curve."""
        owner = np.full(len(self.members), -1)
        for number in sorted(
            range(len(self.curves)), key=lambda c: (kinds.index(self.curves[c].kind), c), reverse=True
        ):
            owner[self.curves[number].members] = number
        return owner


@dataclass(frozen=True, eq=False)
class SizedTruss:
    """A truss with the radius of every member, as the solid and the beam model need it.

    Parameters
    ----------
    truss : Truss
    radii : (n_m, 3) float, mm: radius at the first node, in the middle and at the second node of each member.
        In between, with s from 0 to 1 along the member, r(s) is the quartic of `member_radius`.
    """

    truss: Truss
    radii: Float[np.ndarray, "n_m 3"]

    def __post_init__(self) -> None:
        freeze(self, radii=np.float64)
        shape = (len(self.truss.members), 3)
        require(self.radii.shape == shape, f"radii must have shape {shape}, found {self.radii.shape}")
        bad = ~(np.isfinite(self.radii) & (self.radii > 0)).all(1)
        if bad.any():
            member = int(np.argmax(bad))
            curve = self.truss.curves[self.truss.curve_of_member[member]]
            require(False, f"radii must be positive; {bad.sum()} members are not, first on curve {curve.name}")


def member_radius(radii: Float[np.ndarray, "*n 3"], s: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Radius at `s` in [0, 1] along members with the radii (r0, r1, r2) at start, middle and end.

    The quartic r(s) = r0 + (r2 - r0)(3 s^2 - 2 s^3) + 16 s^2 (1 - s)^2 (r1 - (r0 + r2)/2) is the only one with these
    three values and zero slope at both ends, so that a tube leaves its nodes as a cylinder.
    """
    r0, r1, r2 = radii[..., 0], radii[..., 1], radii[..., 2]
    return r0 + (r2 - r0) * s**2 * (3 - 2 * s) + 16 * (s * (1 - s)) ** 2 * (r1 - (r0 + r2) / 2)


def _check_offsets(offsets: np.ndarray, n: int, total: int) -> None:
    require(
        offsets.shape == (n + 1,) and offsets[0] == 0 and offsets[-1] == total and (np.diff(offsets) >= 0).all(),
        f"offsets must have {n + 1} ascending entries from 0 to {total}",
    )


def curve_steps(curves: Sequence[Curve]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Start node, end node and member of every step along the curves."""
    start, end, members = [], [], []
    for curve in curves:
        start.append(curve.nodes if curve.closed else curve.nodes[:-1])
        end.append(np.roll(curve.nodes, -1) if curve.closed else curve.nodes[1:])
        members.append(curve.members)
    return np.concatenate(start), np.concatenate(end), np.concatenate(members)
