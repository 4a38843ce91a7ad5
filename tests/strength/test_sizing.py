from dataclasses import replace

import numpy as np
import pytest
from frames import STEEL, cube_frame, frame, loading

from michell_cad.curves import Curve, CurveKind
from michell_cad.errors import ConvergenceError, InvalidInputError
from michell_cad.strength import SizingOptions, build_beam_model, size_members, solve_beams
from michell_cad.strength.sizing_groups import group_members
from michell_cad.strength.stiffest import BUCKLING_MARGIN
from michell_cad.strength.strongest import LAST_POWER
from michell_cad.truss import Truss

FINE = SizingOptions(tolerance=1e-9, smallest_radius=1e-4, largest_radius=10.0)


def areas_of(sized) -> np.ndarray:
    return np.pi * sized.radii[:, 0] ** 2


def stepped_bar():
    """Four bars in a line with different lengths and axial forces 5, 4, 2, -1, and nothing else."""
    sized = frame(np.cumsum([0, 10, 30, 20, 40])[:, None] * np.eye(3)[[0]], [(0, 1), (1, 2), (2, 3), (3, 4)])
    case = {node: (force, 0, 0, 0, 0, 0) for node, force in zip((1, 2, 3, 4), (1, 2, 3, -1), strict=True)}
    return sized.truss, loading(5, [0], case), np.array([5.0, 4, 2, 1])


def test_known_optimum_of_a_stepped_bar():
    """Least sum of N^2 L / (E A) at sum A L = V: A proportional to |N|, C = (sum |N| L)^2 / (E V)."""
    truss, load, N = stepped_bar()
    sized, report = size_members(truss, STEEL, load, 50.0, FINE)
    np.testing.assert_allclose(areas_of(sized), N * 50 / (N @ truss.lengths), rtol=1e-8)
    assert report.compliances[-1] == pytest.approx((N @ truss.lengths) ** 2 / (210000 * 50), rel=1e-9)


def test_known_optimum_of_the_norm_of_a_stepped_bar():
    """Least sum of L (N / A)^p at sum A L = V: A goes with |N|^(p / (p + 1)), one stress where p tends to infinity."""
    truss, load, N = stepped_bar()
    sized, report = size_members(truss, STEEL, load, 50.0, replace(FINE, criterion="stress"))
    expected = N ** (LAST_POWER / (LAST_POWER + 1))
    np.testing.assert_allclose(areas_of(sized), expected * 50 / (expected @ truss.lengths), rtol=3e-3)
    assert max(report.factors) == pytest.approx(235 * 50 / (N @ truss.lengths), rel=0.015)


def test_members_that_are_not_free_keep_their_radii():
    """Of the stepped bar only the middle two: what volume is left to them goes with |N|."""
    truss, load, N = stepped_bar()
    start = np.tile(np.array([0.5, 0.3, 0.4, 0.2])[:, None], (1, 3))
    volume = float(np.pi * start[:, 0] ** 2 @ truss.lengths)
    free = np.array([False, True, True, False])
    options = replace(FINE, criterion="stress")
    sized, _ = size_members(truss, STEEL, load, volume, options, strict=False, start=start, free=free)
    np.testing.assert_allclose(sized.radii[~free], start[~free], rtol=1e-9)
    expected = N[free] ** (LAST_POWER / (LAST_POWER + 1))
    left = np.pi * start[free, 0] ** 2 @ truss.lengths[free]
    np.testing.assert_allclose(areas_of(sized)[free], expected * left / (expected @ truss.lengths[free]), rtol=3e-3)


def test_known_optimum_of_a_determinate_truss():
    """A slender triangle on two supports: members forces by the method of joints, bending below (r / L)^2."""
    nodes = [[0, 0, 0], [1000, 0, 0], [300, 0, 400]]
    sized = frame(nodes, [(0, 1), (1, 2), (0, 2)])
    load = loading(3, {0: (0, 1, 2, 3, 5), 1: (1, 2, 3, 5), 2: (1, 3, 5)}, {2: (0, 0, -1000, 0, 0, 0)})
    sized, _ = size_members(sized.truss, STEEL, load, 2000.0, FINE)
    left, right = 500 / 400 * 700, np.hypot(700, 400) / 400 * 300
    N = np.array([300 / 500 * left, left, right])[np.lexsort(np.array([(0, 1), (0, 2), (1, 2)]).T[::-1])]
    expected = dict(zip([(0, 1), (0, 2), (1, 2)], N, strict=True))
    forces = np.array([expected[tuple(member)] for member in sized.truss.members.tolist()])
    np.testing.assert_allclose(areas_of(sized) / forces, (areas_of(sized) / forces)[0], rtol=1e-4)


@pytest.mark.parametrize("criterion", ["compliance", "stress"])
def test_volume_is_kept_and_bounds_hold(criterion):
    truss = cube_frame().truss
    load = loading(8, range(4), {6: (10, 20, -30, 0, 0, 0)}, {5: (0, 0, 5, 0, 0, 0)})
    options = SizingOptions(criterion, 0.08, 0.14)
    sized, report = size_members(truss, STEEL, load, 0.9, options)
    assert build_beam_model(sized, STEEL).volume == pytest.approx(0.9, rel=1e-12)
    assert sized.radii.min() == pytest.approx(0.08, rel=1e-8)
    assert sized.radii.max() == pytest.approx(0.14, rel=1e-8)
    again, _ = size_members(truss, STEEL, load, 0.9, options)
    np.testing.assert_array_equal(again.radii, sized.radii)
    solution = solve_beams(build_beam_model(sized, STEEL), load)
    if criterion == "compliance":
        assert report.compliances[-1] == pytest.approx(solution.compliances.sum(), rel=1e-12)
    else:
        # The trapezoidal rule of even sections errs by a ten-thousandth in the flexibility of a bent member.
        assert max(report.factors) == pytest.approx(235 / solution.peak_stress.max(), rel=1e-3)


def test_the_optimum_of_a_frame_is_stationary():
    """Moving a little volume between two members changes the compliance in second order only."""
    truss = cube_frame().truss
    load = loading(8, range(4), {6: (10, 20, -30, 0, 0, 0)})
    sized, report = size_members(truss, STEEL, load, 0.9, SizingOptions("compliance", 0.02, 0.4, tolerance=1e-8))
    assert report.compliances[-1] < 0.7 * report.compliances[0]
    free = np.flatnonzero((sized.radii[:, 0] > 0.021) & (sized.radii[:, 0] < 0.39))
    assert len(free) >= 4

    def compliance(share: float, a: int, b: int) -> float:
        volumes = areas_of(sized) * truss.lengths
        volumes[[a, b]] += share * volumes[a] * np.array([1, -1])
        radii = np.repeat(np.sqrt(volumes / truss.lengths / np.pi)[:, None], 3, axis=1)
        return solve_beams(build_beam_model(replace(sized, radii=radii), STEEL), load).compliances[0]

    for a, b in zip(free[:-1].tolist(), free[1:].tolist(), strict=True):
        slope = (compliance(1e-4, a, b) - compliance(-1e-4, a, b)) / 2e-4
        assert abs(slope) < 1e-5 * report.compliances[-1]


def test_weights_of_load_cases_decide():
    """Two cantilevers, each loaded by one case: e2 + 2 e4 per volume is one where the weighted energies are."""
    sized = frame([[0, 0, 0], [10, 0, 0], [0, 5, 0], [10, 5, 0]], [(0, 1), (2, 3)])
    load = loading(4, [0, 2], {1: (1, 0, 0, 0, 0, 0)}, {3: (1, 0, 0, 0, 0, 0)})
    load = replace(load, weights=np.array([1.0, 4.0]))
    sized, _ = size_members(sized.truss, STEEL, load, 30.0, FINE)
    np.testing.assert_allclose(areas_of(sized), [1.0, 2.0], rtol=1e-8)


@pytest.mark.parametrize("pull", [1.0, -1.0])
def test_stress_with_buckling_gives_every_bar_about_the_same_factor(pull):
    """In tension A goes with N; in compression with N while it yields, with N^(1/2) L where it buckles first. The norm
    comes within 4 % of it."""
    truss, load, _ = stepped_bar()
    load = replace(load, forces=10.0 * pull * load.forces)
    options = replace(FINE, criterion="stress", buckling=True, tolerance=1e-12)
    sized, report = size_members(truss, STEEL, load, 50.0, options)
    force, L = 10 * pull * np.array([5.0, 4, 2, -1]), truss.lengths
    yields = 235 * areas_of(sized) / np.abs(force)
    buckles = np.where(force < 0, np.pi * 210000 * areas_of(sized) ** 2 / (4 * L**2 * np.abs(force)), np.inf)
    np.testing.assert_allclose(np.minimum(yields, buckles), max(report.factors), rtol=0.05)
    assert np.minimum(yields, buckles).min() == pytest.approx(max(report.factors), rel=1e-6)
    assert (buckles < yields).any()


def test_compliance_with_buckling_stays_above_the_loads():
    """The last bar alone is in compression: without buckling it gets 1/12 of N L, which buckles."""
    truss, load, N = stepped_bar()
    load = replace(load, forces=30.0 * load.forces)
    slim, _ = size_members(truss, STEEL, load, 50.0, FINE)
    safe, _ = size_members(truss, STEEL, load, 50.0, replace(FINE, buckling=True))
    before, after = (np.pi * 210000 * areas_of(sized)[3] ** 2 / (4 * 40**2 * 30) for sized in (slim, safe))
    assert before < 1
    assert after == pytest.approx(BUCKLING_MARGIN**2, rel=1e-6)
    np.testing.assert_allclose(areas_of(safe)[:3] / N[:3], areas_of(safe)[0] / 5, rtol=1e-7)
    with pytest.raises(InvalidInputError, match=r"members that do not buckle at these loads take .* more than the vol"):
        size_members(truss, STEEL, replace(load, forces=1e4 * load.forces), 50.0, replace(FINE, buckling=True))


def arc_truss():
    """A quarter circle of 16 members, with a strut from every fourth node to the centre."""
    angle = np.linspace(0, np.pi / 2, 17)
    nodes = np.concatenate([30 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1), [[0, 0, 0]]])
    arc = np.stack([np.arange(16), np.arange(1, 17)], axis=1)
    struts = np.array([[n, 17] for n in range(0, 17, 4)])
    members = np.concatenate([arc, struts])
    curves = [Curve(CurveKind.INTERIOR, "tension", 0, (None, 1, 1), 0, np.arange(17), np.arange(16), False)]
    curves += [
        Curve(CurveKind.INTERIOR, "compression", 1, (k, None, 1), 0, pair, np.array([16 + k]), False)
        for k, pair in enumerate(struts)
    ]
    return Truss(nodes, np.zeros(18, int), members, tuple(curves), 20.0)


def test_radii_of_a_curve_change_smoothly_and_those_of_a_family_not_at_all():
    truss = arc_truss()
    load = loading(18, [0, 17], {16: (3.0, 2.0, 1.0, 0, 0, 0)})
    volume = 2.0 * truss.lengths.sum()
    results = {}
    for by in ("member", "curve", "family"):
        for criterion in ("compliance", "stress"):
            options = SizingOptions(criterion, by=by, tolerance=1e-3)
            results[by, criterion] = size_members(truss, STEEL, load, volume, options)
            sized = results[by, criterion][0]
            assert build_beam_model(sized, STEEL).volume == pytest.approx(volume, rel=1e-9)
    for criterion in ("compliance", "stress"):
        sized, _ = results["curve", criterion]
        np.testing.assert_allclose(sized.radii[:15, 2], sized.radii[1:16, 0], rtol=1e-12)  # no step at nodes
        assert np.ptp(sized.radii[:16]) > 0.1 * sized.radii[:16].mean()
        sized, _ = results["family", criterion]
        assert np.ptp(sized.radii[:16]) == 0
        assert np.ptp(sized.radii[16:]) == 0
        assert sized.radii[0, 0] != sized.radii[16, 0]
    # The more freedom, the better.
    c = {
        by: solve_beams(build_beam_model(results[by, "compliance"][0], STEEL), load).compliances[0] for by, _ in results
    }
    assert c["member"] < c["curve"] < c["family"] < results["family", "compliance"][1].compliances[0]
    f = {by: max(results[by, "stress"][1].factors) for by, _ in results}
    assert min(f["member"], f["curve"]) > f["family"] > 1.001 * results["family", "stress"][1].factors[0]


def test_the_strongest_radii_do_not_depend_on_where_one_starts():
    truss = arc_truss()
    load = loading(18, [0, 17], {16: (3.0, 2.0, 1.0, 0, 0, 0)})
    volume, options = 2.0 * truss.lengths.sum(), SizingOptions("stress")
    _, report = size_members(truss, STEEL, load, volume, options)
    smooth, _ = size_members(truss, STEEL, load, volume, replace(options, by="curve"))
    sized, again = size_members(truss, STEEL, load, volume, options, start=smooth.radii)
    assert again.factors[0] < 0.9 * max(again.factors)
    assert max(again.factors) == pytest.approx(max(report.factors), rel=0.02)
    assert max(report.factors) > 4 * report.factors[0]
    # Room at one node bounds what meets there, and nothing else.
    room = np.full(18, 10.0)
    room[0] = 0.7 * sized.radii[0, 0]
    tight, _ = size_members(truss, STEEL, load, volume, options, start=smooth.radii, room=room)
    assert tight.radii[[0, 16]].max() <= room[0] * (1 + 1e-9)
    assert tight.radii[1:16].max() > room[0]


def test_shares_of_groups_add_up():
    for by in ("member", "curve", "family"):
        groups = group_members(arc_truss(), by)
        for W in (groups.middle, *groups.ends):
            np.testing.assert_allclose(np.asarray(W.sum(1)).ravel(), 1)
            assert W.min() >= 0
    nodes = np.arange(8)
    ring = Curve(CurveKind.INTERIOR, "third", 2, (1, 1, None), 0, nodes, np.array([0, 2, 3, 4, 5, 6, 7, 1]), True)
    angle = nodes * np.pi / 4
    truss = Truss(
        np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1),
        np.zeros(8, int),
        np.array([[0, 1], [0, 7], *([k, k + 1] for k in range(1, 7))]),
        (ring,),
        1.0,
    )
    groups = group_members(truss, "curve")
    radii = groups.radii(np.array([0.0, 1.0]))
    assert groups.count == 2
    np.testing.assert_allclose(radii[0, 0], radii[1, 0])  # both start at node 0, in opposite directions
    np.testing.assert_allclose(radii[0, 2], radii[2, 0])


def test_refusals():
    truss, load, _ = stepped_bar()
    with pytest.raises(InvalidInputError, match=r"volume must be positive, in mm\^3, found -1"):
        size_members(truss, STEEL, load, -1.0)
    with pytest.raises(InvalidInputError, match=r"needs a mean radius of 0.3989 mm, but members may have 1 to 2 mm"):
        size_members(truss, STEEL, load, 50.0, SizingOptions(smallest_radius=1.0, largest_radius=2.0))
    with pytest.raises(InvalidInputError, match=r"hold at most 3\.848e\+04 mm\^3, found a volume of 4e\+04 mm\^3"):
        size_members(replace(truss, spacing=1000.0), STEEL, load, 4e4)
    for wrong in ({"tolerance": 0.0}, {"steps": 0}, {"smallest_radius": -1.0}, {"largest_radius": np.inf}):
        with pytest.raises(InvalidInputError, match=f"{next(iter(wrong))} must"):
            SizingOptions(**wrong)
    with pytest.raises(ConvergenceError, match="after 1 steps"):
        size_members(truss, STEEL, load, 50.0, replace(FINE, steps=1))
    sized, report = size_members(truss, STEEL, load, 50.0, replace(FINE, steps=1), strict=False)
    assert not report.converged
    assert areas_of(sized) @ truss.lengths == pytest.approx(50.0, rel=1e-12)
