"""Crossing members are found, with the depth that geometry gives, and only they."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial import KDTree

from michell_cad.cad import prepare
from michell_cad.cad.balls import Balls
from michell_cad.cad.clearance import crossing_members, crossing_spheres, crossing_tubes
from michell_cad.cad.prepare import prepare_truss
from michell_cad.cad.solid import build_solid
from michell_cad.curves import Curve, CurveKind
from michell_cad.knobs import Knobs
from michell_cad.splines import fit_splines
from michell_cad.truss import SizedTruss, Truss
from tests.cad.layouts import grid_truss, sized, star


def skew(gap: float, radius: float = 1.0) -> SizedTruss:
    """Two members at right angles whose axes pass at a distance."""
    nodes = np.array([[-10, 0, 0], [10, 0, 0], [0, -10, gap], [0, 10, gap]], float)
    members = np.array([[0, 1], [2, 3]])
    curves = tuple(
        Curve(CurveKind.INTERIOR, "third", 2, (i, 0, None), 0, members[i], np.array([i]), False) for i in (0, 1)
    )
    return SizedTruss(Truss(nodes, np.zeros(4, int), members, curves, 20.0), np.full((2, 3), radius))


@pytest.mark.parametrize("gap", [0.0, 1.0, 1.8])
def test_depth_of_a_crossing(gap, monkeypatch) -> None:
    monkeypatch.setattr(prepare, "resolve_crossings", lambda prepared: ([], []))
    thick = skew(gap)
    for found in (crossing_members(thick, fit_splines(thick.truss)), crossing_tubes(prepare_truss(thick, Knobs()))):
        assert found.members.tolist() == [[0, 1]]
        assert found.depth[0] == pytest.approx(2 - gap, abs=0.06)
        assert found.points[0] == pytest.approx([0, 0, gap / 2], abs=0.3)


def test_members_that_pass_are_left_alone() -> None:
    thick = skew(2.1)
    assert not len(crossing_members(thick, fit_splines(thick.truss)).depth)
    assert not len(crossing_tubes(prepare_truss(thick, Knobs())).depth)


def test_members_of_one_node_do_not_cross() -> None:
    half = np.radians(12.0)
    pair = star([[np.cos(half), np.sin(half), 0], [np.cos(half), -np.sin(half), 0], [0, 0, 1]], length=14.0)
    assert not len(crossing_tubes(prepare_truss(pair, Knobs())).depth)
    grid = sized(grid_truss((4, 3, 3)), 1.2, 0.3)
    assert not len(crossing_members(grid, fit_splines(grid.truss)).depth)
    assert not len(crossing_tubes(prepare_truss(grid, Knobs())).depth)


def test_a_crossing_far_from_nodes_becomes_a_node() -> None:
    """Both members are led through a new node where they cross; they become one solid, and it is said."""
    report = build_solid(skew(0.5), Knobs()).report
    assert report.crossings == 0
    assert (report.solids, report.nodes, report.members) == (1, 5, 4)
    assert report.fallback_nodes == {"merged": 1}
    assert any(text == "nodes added where members cross: 1" for text in report.messages)


def test_a_crossing_without_room_for_a_node_is_reported_with_both_labels() -> None:
    """The members cross 2.9 radii from their ends: too near for a node, too far to be led through an end."""
    thick = skew(0.5)
    nodes = np.array(thick.truss.nodes) + [[7.2, 0, 0], [7.2, 0, 0], [0, 7.2, 0], [0, 7.2, 0]]
    report = build_solid(SizedTruss(dataclasses.replace(thick.truss, nodes=nodes), thick.radii), Knobs()).report
    assert report.crossings == 1
    warning = report.messages[-1]
    assert warning.startswith("WARNING")
    assert "third (0, 0, *) #0 with third (1, 0, *) #0" in warning


def test_a_crossing_beside_a_node_is_resolved() -> None:
    """The end of one member lies on the other: the other is led through it, and both become one solid."""
    thick = skew(0.0)
    nodes = np.array(thick.truss.nodes)
    nodes[2] = [0, -0.2, 0.1]
    report = build_solid(SizedTruss(dataclasses.replace(thick.truss, nodes=nodes), thick.radii), Knobs()).report
    assert report.crossings == 0
    assert report.solids == 1
    assert report.members == 3
    assert report.fallback_nodes["merged"] == 1


def test_spheres_that_would_overlap_are_made_smaller() -> None:
    """Two far nodes 3.4 mm apart have no room for two spheres of 1.8 mm."""
    half = np.arcsin(1.7 / 12)
    pair = star([[np.cos(half), np.sin(half), 0], [np.cos(half), -np.sin(half), 0]], length=12.0)
    prepared = prepare_truss(pair, Knobs())
    assert prepared.sizes.radius[[1, 2]] == pytest.approx(1.5)
    assert not len(crossing_tubes(prepared).depth)
    node, member, depth = crossing_spheres(dataclasses.replace(prepared, sizes=_swollen(prepared.sizes)))
    assert sorted(zip(node.tolist(), member.tolist(), strict=True)) == [(1, 1), (2, 0)]
    assert depth == pytest.approx(2 * 1.8 * 0.98 - 3.4)


def _swollen(sizes):
    radius = np.array(sizes.radius)
    radius[[1, 2]] = 1.8
    return dataclasses.replace(sizes, radius=radius)


def test_balls_overlap_as_a_tree_finds_them() -> None:
    """A cloud of balls in clumps and strays, each of a member of its own, against a k-d tree."""
    rng = np.random.default_rng(4)
    points = np.concatenate([rng.normal(size=(150, 3)) * 4, rng.normal(size=(150, 3)) * 0.5 + 30, [[900.0, 0, 0]]])
    r = rng.uniform(0.2, 1.0, len(points))
    n = len(points)
    members = np.arange(2 * n).reshape(n, 2)
    nodes = np.repeat(points, 2, axis=0)
    balls = Balls.of(np.arange(n), points, r)
    pairs, depth = balls.overlaps(0.9, members, nodes, np.zeros((n, 2)))
    near = KDTree(points).query_pairs(2.0, output_type="ndarray")
    deep = 0.9 * r[near].sum(1) - np.linalg.norm(points[near[:, 0]] - points[near[:, 1]], axis=1)
    expected = {tuple(pair): value for pair, value in zip(near.tolist(), deep.tolist(), strict=True) if value > 0}
    assert len(expected) > n
    found = {tuple(sorted(pair)): value for pair, value in zip(pairs.tolist(), depth.tolist(), strict=True)}
    assert len(found) == len(pairs)
    assert found == pytest.approx(expected)
    # The same again with a ball of each as the sphere of a node of its own member: all others that touch it.
    spheres = np.repeat(r, 2)
    node, member, _ = balls.inside(0.9, members, np.arange(0, 2 * n, 2), nodes, spheres)
    assert {tuple(sorted(pair)) for pair in zip((node // 2).tolist(), member.tolist(), strict=True)} == set(expected)
