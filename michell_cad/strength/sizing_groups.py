"""What is sized together: every member, every curve with a smooth change along it, or every family.

The logarithms of the areas depend linearly on a few variables x, log A = W x, with weights that are not negative and
add up to one for each member. So bounds on x are bounds on A, and a smooth curve is one whose W is smooth.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int

from michell_cad.truss import FAMILIES, Truss

SizedBy = Literal["member", "curve", "family"]

MEMBERS_PER_CONTROL = 4
"""Members of a curve between two of the points at which its radius is a variable: log A is linear between them. With
two the gain is nearer to that of single members, but the radius ripples from cell to cell."""


@dataclass(frozen=True, eq=False)
class SizingGroups:
    """How the areas of members depend on the variables of a sizing.

    Parameters
    ----------
    middle : (n_m, n_x) sparse W for the middles of the members.
    ends : W for their first and for their second nodes.
    """

    middle: sp.csr_matrix
    ends: tuple[sp.csr_matrix, sp.csr_matrix]

    @property
    def count(self) -> int:
        """n_x."""
        return self.middle.get_shape()[1]

    @property
    def by_place(self) -> tuple[sp.csr_matrix, sp.csr_matrix, sp.csr_matrix]:
        """W for the first nodes, the middles and the second nodes of the members."""
        return self.ends[0], self.middle, self.ends[1]

    @cached_property
    def shares(self) -> sp.csr_matrix:
        """How much of each member belongs to each variable: the mean of W over its ends and middle, (n_m, n_x)."""
        return sp.csr_matrix((self.ends[0] + self.middle + self.ends[1]) / 3)

    @cached_property
    def of_member(self) -> Int[np.ndarray, " n_m"]:
        """The variable that has the largest share of each member."""
        return np.asarray(self.shares.argmax(1)).ravel()

    def radii(self, x: Float[np.ndarray, " n_x"]) -> Float[np.ndarray, "n_m 3"]:
        """Radii at the first node, in the middle and at the second node of each member."""
        return np.sqrt(np.exp(np.stack([W @ x for W in self.by_place], axis=1)) / np.pi)

    def gradient(self, by_area: Float[np.ndarray, "n_m 3"]) -> Float[np.ndarray, " n_x"]:
        """Derivatives by x, from those by the logarithms of the three areas of each member."""
        first, middle, second = self.by_place
        return first.T @ by_area[:, 0] + middle.T @ by_area[:, 1] + second.T @ by_area[:, 2]

    def nearest(self, radii: Float[np.ndarray, "n_m 3"]) -> Float[np.ndarray, " n_x"]:
        """The x whose radii resemble some others: for every variable the mean of what it has a share in."""
        logs = np.log(np.pi * radii**2)
        return self.gradient(logs) / self.gradient(np.ones(logs.shape))


def group_members(truss: Truss, by: SizedBy) -> SizingGroups:
    """The groups of a truss. A member of several curves goes with the one that names it."""
    n_m = len(truss.members)
    owner = truss.curve_of_member
    if by == "curve":
        return _along_curves(truss, owner)
    if by == "member":
        group = np.arange(n_m)
    else:
        family = np.array([FAMILIES.index(curve.family) for curve in truss.curves])[owner]
        group = np.unique(family, return_inverse=True)[1]
    W = sp.csr_matrix((np.ones(n_m), (np.arange(n_m), group)), shape=(n_m, group.max() + 1))
    return SizingGroups(W, (W, W))


def _along_curves(truss: Truss, owner: np.ndarray) -> SizingGroups:
    rows: list[list[np.ndarray]] = [[], [], []]
    members: list[np.ndarray] = []
    count = 0
    for number, curve in enumerate(truss.curves):
        mine = np.flatnonzero(owner[curve.members] == number)
        if not len(mine):
            continue
        run = np.concatenate([[0.0], np.cumsum(truss.lengths[curve.members])])
        spans = max(round(len(curve.members) / MEMBERS_PER_CONTROL), 1)
        x = run / run[-1] * spans
        backwards = truss.members[curve.members[mine], 0] != curve.nodes[mine]
        first, second = np.where(backwards, x[mine + 1], x[mine]), np.where(backwards, x[mine], x[mine + 1])
        controls = spans if curve.closed else spans + 1
        for place, position in enumerate((first, (first + second) / 2, second)):
            low = np.minimum(np.floor(position).astype(int), spans - 1)
            share = position - low
            table = np.stack([count + low % controls, count + (low + 1) % controls, 1 - share, share], axis=1)
            rows[place].append(table)
        members.append(curve.members[mine])
        count += controls
    member = np.concatenate(members)
    matrices = []
    for tables in rows:
        low, high, a, b = np.concatenate(tables).T
        entries = (np.concatenate([a, b]), (np.tile(member, 2), np.concatenate([low, high]).astype(int)))
        matrices.append(sp.csr_matrix(sp.coo_matrix(entries, shape=(len(truss.members), count))))
    first, middle, second = matrices
    used = np.flatnonzero(np.asarray((first + middle + second).sum(0)).ravel() > 0)
    return SizingGroups(middle[:, used], (first[:, used], second[:, used]))
