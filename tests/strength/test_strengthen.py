import json

import numpy as np
import pytest
from frames import frame, in_proportion
from shapes import cantilever

from michell_cad.elasticity import solve_elasticity
from michell_cad.errors import InvalidInputError
from michell_cad.job import parse_job
from michell_cad.knobs import Knobs, apply_knobs
from michell_cad.parametrization import Parametrization
from michell_cad.pipeline import DesignOptions, design
from michell_cad.splines import fit_splines
from michell_cad.strength import (
    Buildable,
    StrengthenOptions,
    add_off_axis_cases,
    build_beam_model,
    carry_over_loads,
    solve_beams,
    straighten,
    strengthen,
    strengthen_block,
)
from michell_cad.strength.sized_for_loads import members_near
from michell_cad.truss import SizedTruss, keep_curves


@pytest.fixture(scope="module")
def bar():
    return design(cantilever((12, 6, 6)), DesignOptions(resolution=8))


def run(bar, sized=None, **options):
    sized = apply_knobs(bar.truss, Knobs()) if sized is None else sized
    return strengthen(bar.problem, bar.stress_field, bar.parametrization, sized, StrengthenOptions(**options))


def test_without_a_wish_nothing_changes(bar):
    sized = apply_knobs(bar.truss, Knobs())
    result, report, notes = run(bar, sized)
    assert result is sized
    assert report is None
    assert notes == []
    assert strengthen_block(report) is None


def test_straight_members_are_their_chords_and_stay_so_in_a_subset(bar):
    truss = straighten(bar.truss)
    np.testing.assert_allclose(fit_splines(truss).lengths, truss.lengths, rtol=1e-9)
    assert fit_splines(bar.truss).lengths.sum() > 1.001 * truss.lengths.sum()
    half = keep_curves(truss, np.array([c.isovalues[0] is None or c.isovalues[0] % 2 == 0 for c in truss.curves]))
    assert half.straight
    assert np.diff(np.asarray(half.waypoint_offsets)).max() > 0  # dissolved nodes stay on the way


@pytest.mark.parametrize("by", ["member", "curve", "family"])
def test_sizing_gains_at_equal_volume_for_all_cases(bar, by):
    result, report, _ = run(bar, size_by=by, volume_fraction=0.09)
    volume = 0.09 * bar.problem.mesh.volumes.sum()
    assert build_beam_model(result, bar.problem.material, straight=False).volume == pytest.approx(volume, rel=1e-6)
    loading = add_off_axis_cases(carry_over_loads(bar.problem, result.truss))
    solution = solve_beams(build_beam_model(result, bar.problem.material, straight=False), loading)
    assert bar.problem.material.yield_strength / solution.peak_stress.max() > 0.98 * report.failure_factor
    assert report.failure_gain > {"member": 2.0, "curve": 1.4, "family": 1.0}[by]
    assert json.loads(json.dumps(strengthen_block(report), allow_nan=False))["options"]["size_by"] == by


def test_braces_are_kept_only_if_they_pay(bar):
    """Along the axes a bar in bending shears: braces pay. Where the curves follow the stress they are not asked for."""
    from michell_cad.isocurves import trace_isocurves
    from michell_cad.truss import clean_network

    mesh = bar.problem.mesh
    grid = Parametrization(mesh, mesh.vertices)
    truss, _ = clean_network(trace_isocurves(mesh, mesh.vertices / 13.4 + 0.01), 13.4)
    sized = SizedTruss(truss, np.ones((len(truss.members), 3)))
    options = {"size_by": "member", "volume_fraction": 0.09, "criterion": "compliance", "buckling": False}
    field = solve_elasticity(bar.problem)
    plain, _, _ = strengthen(bar.problem, field, grid, sized, StrengthenOptions(**options))
    braced, report, notes = strengthen(bar.problem, field, grid, sized, StrengthenOptions(braces=True, **options))
    assert report.braces > 0
    assert len(braced.truss.members) == len(plain.truss.members) + report.braces
    assert report.compliance_gain > 1
    _, none, notes = strengthen(
        bar.problem, field, grid, sized, StrengthenOptions(braces=True, shear_limit=10.0, **options)
    )
    assert none.braces == 0
    assert notes == []


def test_what_building_says_is_sized_again():
    """A builder that leaves the truss as it is, with balls of 1.4 radii where 1.2 were foretold, and little room:
    reported is what it leaves."""
    small = design(cantilever((6, 3, 3)), DesignOptions(resolution=4))
    seen = []

    class Builder:
        def balls_of(self, truss, ratio=1.2):
            return in_proportion(truss.members, np.full(len(truss.nodes), ratio))

        def build(self, sized):
            rule = self.balls_of(sized.truss, 1.4)
            balls, _ = rule(sized.radii[:, [0, 2]])
            seen.append(float(sized.radii.max()))
            return Buildable(sized, balls, rule, np.full(len(balls), 0.8 * seen[1] if len(seen) > 1 else np.inf))

    options = StrengthenOptions(size_by="member", volume_fraction=0.09, straight=True, buckling=False)
    sized = apply_knobs(small.truss, Knobs())
    result, report, _ = strengthen(small.problem, small.stress_field, small.parametrization, sized, options, Builder())
    assert len(seen) > 2  # equal members, then sized ones at least twice
    assert max(seen[2:]) <= 0.8 * seen[1] * (1 + 1e-9)
    loading = add_off_axis_cases(carry_over_loads(small.problem, result.truss))
    balls, _ = Builder().balls_of(result.truss, 1.4)(result.radii[:, [0, 2]])
    model = build_beam_model(result, small.problem.material, joints=balls)
    peak = solve_beams(model, loading).peak_stress.max()
    assert report.failure_factor == pytest.approx(small.problem.material.yield_strength / peak, rel=1e-9)
    assert report.failure_gain > 2


def test_equal_members_are_kept_where_no_others_are_better():
    """A builder that leaves only equal members as they are, and makes all others thin."""
    small = design(cantilever((6, 3, 3)), DesignOptions(resolution=4))

    class Spoiler:
        def balls_of(self, truss):
            return in_proportion(truss.members, np.ones(len(truss.nodes)))

        def build(self, sized):
            thin = 0.1 if np.ptp(sized.radii) > 1e-9 else 1.0
            spoilt = SizedTruss(sized.truss, thin * sized.radii)
            rule = self.balls_of(sized.truss)
            return Buildable(spoilt, rule(spoilt.radii[:, [0, 2]])[0], rule, np.full(len(sized.truss.nodes), np.inf))

    options = StrengthenOptions(size_by="member", volume_fraction=0.09, straight=True)
    sized = apply_knobs(small.truss, Knobs())
    part = (small.problem, small.stress_field, small.parametrization)
    result, report, notes = strengthen(*part, sized, options, Spoiler())
    assert report.failure_gain == 1
    assert np.ptp(result.radii) == 0
    assert "no radii were found that are better than equal ones" in notes


def test_members_near_others():
    chain = frame([[k, 0, 0] for k in range(8)], [(k, k + 1) for k in range(7)]).truss
    chosen = np.arange(7) == 2
    assert np.flatnonzero(members_near(chain, chosen)).tolist() == [1, 2, 3]
    assert not members_near(chain, ~np.ones(7, bool)).any()


def test_a_job_states_all_of_it():
    job = {"part": {"file": "x.npz"}, "sizing": {"by": "curve", "straight": True, "off_axis": 0, "braces": True}}
    expected = StrengthenOptions(straight=True, size_by="curve", braces=True, off_axis_degrees=0.0)
    assert parse_job(job).sizing.options == expected
    assert parse_job({"part": {"file": "x.npz"}}).sizing.options == StrengthenOptions()
    with pytest.raises(InvalidInputError, match="braces cost at equal radii"):
        parse_job({"part": {"file": "x.npz"}, "sizing": {"braces": True}})


def test_refusals(bar):
    with pytest.raises(InvalidInputError, match="give size_by as well"):
        StrengthenOptions(braces=True)
    with pytest.raises(InvalidInputError, match=r"volume_fraction must lie between 0 and 1, found 1.5"):
        StrengthenOptions(volume_fraction=1.5)
    with pytest.raises(InvalidInputError, match=r"a volume of .* mm\^3 needs a mean radius of .* choose a volume from"):
        run(bar, size_by="member", volume_fraction=0.5, largest_radius=0.5)
