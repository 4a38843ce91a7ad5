"""Radii for loads, of a truss that can be built: sizing and building take turns until neither changes the other.

Thick members take room at their nodes: where they have too little, building merges nodes and leads members aside, and
the forces go with them. How large the balls of the nodes come out decides how thin members bend beside thick ones. So
what is built is sized again, with balls as it got them, first as a whole and then, from the strongest truss as built,
only near what fails first.
"""

from dataclasses import dataclass, replace
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Int

from michell_cad.problem import DesignProblem
from michell_cad.strength.beam_model import build_beam_model
from michell_cad.strength.beam_solver import solve_beams
from michell_cad.strength.braces import add_braces
from michell_cad.strength.loads import TrussLoading, add_off_axis_cases, carry_over_loads
from michell_cad.strength.mechanism import leave_out_loose_parts
from michell_cad.strength.sizing import SizingOptions, SizingReport, size_members
from michell_cad.strength.sizing_task import failure_index
from michell_cad.strength.strengthen_options import StrengthenOptions
from michell_cad.strength.thick_nodes import Balls
from michell_cad.truss import SizedTruss, Truss


@dataclass(frozen=True, eq=False)
class Buildable:
    """A truss changed so that it can be built.

    Parameters
    ----------
    sized : the truss.
    balls : (n_n,) radius of the ball at each node, mm.
    rule : how the balls change with the radii.
    room : (n_n,) radius to which the thickest member at each node could grow, the others in proportion, until the
        shortest one there had no tube left between its two nodes, mm.
    """

    sized: SizedTruss
    balls: Float[np.ndarray, " n_n"]
    rule: Balls
    room: Float[np.ndarray, " n_n"]


@runtime_checkable
class Build(Protocol):
    """What sizing knows of building."""

    def balls_of(self, truss: Truss) -> Balls:
        """The balls of a truss that was not built yet."""
        ...

    def build(self, sized: SizedTruss) -> Buildable:
        """Make a truss buildable."""
        ...


ROUNDS = 4
"""So often what is built is sized again as a whole. After a few rounds building changes few members any more, but how
much room their nodes take may still change: the best round is kept."""

LOCAL_ROUNDS = 12
"""So often members near those that fail first are sized again."""

LARGEST_STEP, SMALLEST_STEP = 1.1, 1.02
"""Factors by which these rounds try to raise that of the truss; with 1.2 few of them succeed."""

_STIFFEST: dict[str, Any] = {"criterion": "compliance", "buckling": False}
"""Options of the stiffest radii."""

SETTLED = 0.02
"""It is enough when the truss as built is weaker by less than this than sizing thought (relative)."""

BRACE_PAYS = 1.5
"""A brace that sizing makes no thicker than this times the smallest radius carries nothing worth its node's room."""

ENOUGH_PAY = 0.8
"""Where more than this share of the braces carry, the rest is left out without another look (relative)."""


@dataclass(frozen=True, eq=False)
class Sized:
    """A truss as it can be built, and what it carries.

    Parameters
    ----------
    sized : the truss.
    factors : (n_m,) of all loads, also tilted, at which each member yields or, if that is asked for, buckles.
    compliance : weighted sum over all load cases, N mm.
    converged : whether its radii settled.
    """

    sized: SizedTruss
    factors: Float[np.ndarray, " n_m"]
    compliance: float
    converged: bool

    @property
    def factor(self) -> float:
        """At which the first one does."""
        return float(self.factors.min())


@dataclass(frozen=True, eq=False)
class SizedForLoads:
    """How trusses of one part are sized.

    Parameters
    ----------
    problem : the part and its loads.
    volume : sum of the members' volumes, mm^3.
    options : StrengthenOptions
    build : None: members may be too thick for their nodes.
    """

    problem: DesignProblem
    volume: float
    options: StrengthenOptions
    build: Build | None

    def equal(self, truss: Truss) -> SizedTruss:
        """Equal members of the volume."""
        one = build_beam_model(SizedTruss(truss, np.ones((len(truss.members), 3))), self.problem.material, False)
        return SizedTruss(truss, np.full((len(truss.members), 3), np.sqrt(self.volume / one.volume)))

    def score(self, item: Sized) -> float:
        """What the criterion makes large."""
        return item.factor if self.options.criterion == "stress" else -item.compliance

    def size(self, truss: Truss) -> Sized:
        """The best radii of a truss that can be built, and what building makes of it."""
        sized, report = self._first(truss)
        found, built = self.measured(sized, report.converged)
        best = found, built, max(report.factors)
        for _ in range(ROUNDS if built is not None else 0):
            assert built is not None
            same = len(built.sized.truss.members) == len(sized.truss.members)
            if same and (self.options.criterion == "compliance" or found.factor > (1 - SETTLED) * max(report.factors)):
                break
            sized, report = self._radii(found.sized.truss, built.rule, found.sized.radii, built.room)
            found, built = self.measured(sized, report.converged)
            if self.score(found) > self.score(best[0]):
                best = found, built, max(report.factors)
        local = self.options.criterion == "stress" and self.options.size_by == "member"
        return self._mended(*best) if local else best[0]

    def _mended(self, best: Sized, built: Buildable | None, goal: float) -> Sized:
        """Raise a factor to a goal by small steps: only members near those that fail below each step change.

        Hardly anything then changes in how the rest is built, which is what a whole round founders on: of a thousand
        members five that come out otherwise than thought decide. Larger steps change more, and fail; then smaller ones
        are taken.
        """
        step = LARGEST_STEP
        for _ in range(LOCAL_ROUNDS if built is not None else 0):
            assert built is not None
            if best.factor > (1 - SETTLED) * goal or step < SMALLEST_STEP:
                break
            free = members_near(best.sized.truss, best.factors < min(goal, step * best.factor))
            sized, report = self._radii(best.sized.truss, built.rule, best.sized.radii, built.room, free)
            found, now_built = self.measured(sized, report.converged)
            if self.score(found) > self.score(best):
                best, built = found, now_built
            else:
                step = 1 + (step - 1) / 2
        return best

    def measured(self, sized: SizedTruss, converged: bool = True) -> tuple[Sized, Buildable | None]:
        """A truss as it is built, and what building said."""
        built = None
        if self.build is not None:
            built = self.build.build(sized)
            while len((sized := leave_out_loose_parts(self.problem, built.sized)[0]).radii) < len(built.sized.radii):
                built = self.build.build(sized)
        material, straight = self.problem.material, sized.truss.straight
        columns = build_beam_model(sized, material, straight)
        model = columns if built is None else build_beam_model(sized, material, straight, joints=built.balls)
        loading = self._loading(sized.truss)
        solution = solve_beams(model, loading)
        with np.errstate(divide="ignore"):  # members without load
            factors = 1 / failure_index(solution, self.options.buckling, columns)
        return Sized(sized, factors, float(loading.weights @ solution.compliances), converged), built

    def paying_braces(self, truss: Truss, pairs: Int[np.ndarray, "n_b 2"]) -> Int[np.ndarray, "n_k 2"]:
        """Of some braces those that sizing makes thick; the others only take volume and room."""
        while len(pairs):
            sized, _ = self._first(add_braces(truss, pairs))
            thick = sized.radii[len(truss.members) :, 1] > BRACE_PAYS * sized.radii.min()
            if thick.mean() > ENOUGH_PAY:
                return pairs[thick]
            pairs = pairs[thick]
        return pairs

    def _loading(self, truss: Truss) -> TrussLoading:
        return add_off_axis_cases(carry_over_loads(self.problem, truss), self.options.off_axis_degrees)

    def _first(self, truss: Truss) -> tuple[SizedTruss, SizingReport]:
        """Radii of a truss that was not built yet.

        Those for strength start half way (by the logarithms of areas) from equal members to the stiffest ones: from
        either end they run into poorer optima, on braced grids half as strong.
        """
        balls = None if self.build is None else self.build.balls_of(truss)
        if self.options.criterion == "compliance":
            return self._radii(truss, balls)
        plain = SizedForLoads(self.problem, self.volume, replace(self.options, **_STIFFEST), self.build)
        stiffest, _ = plain._radii(truss, balls)
        return self._radii(truss, balls, np.sqrt(stiffest.radii * self.equal(truss).radii))

    def _radii(
        self,
        truss: Truss,
        balls: Balls | None,
        start: Float[np.ndarray, "n_m 3"] | None = None,
        room: Float[np.ndarray, " n_n"] | None = None,
        free: Bool[np.ndarray, " n_m"] | None = None,
    ) -> tuple[SizedTruss, SizingReport]:
        options = self.options
        assert options.size_by is not None  # asked before
        sizing = SizingOptions(
            options.criterion,
            options.smallest_radius,
            options.largest_radius,
            straight=truss.straight,
            by=options.size_by,
            buckling=options.buckling,
        )
        return size_members(
            truss,
            self.problem.material,
            self._loading(truss),
            self.volume,
            sizing,
            strict=False,
            balls=balls,
            start=start,
            room=room,
            free=free,
        )


def members_near(truss: Truss, chosen: Bool[np.ndarray, " n_m"]) -> Bool[np.ndarray, " n_m"]:
    """Some members, and those that share a node with them."""
    nodes = np.zeros(len(truss.nodes), bool)
    nodes[truss.members[chosen]] = True
    return np.any(nodes[truss.members], axis=1)
