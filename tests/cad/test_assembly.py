"""Bars and nodes as closed solids of their own: valid, of the right volume, and together the whole truss."""

import numpy as np
import pytest

from michell_cad.cad import kernel
from michell_cad.cad.assembly import AssemblyPart, build_assembly
from michell_cad.cad.bars import plan_bars
from michell_cad.cad.node_bodies import plan_nodes
from michell_cad.cad.prepare import prepare_truss
from michell_cad.cad.prepared import PreparedTruss
from michell_cad.cad.shell import assemble_shell
from michell_cad.cad.shell_plan import FaceRole
from michell_cad.curves import Curve, CurveKind
from michell_cad.errors import GeometryKernelError
from michell_cad.knobs import Knobs
from michell_cad.truss import SizedTruss, Truss
from tests.cad.layouts import grid_truss, sized, sparse_reference_truss, star

RADIUS = 1.0


def ring(points: np.ndarray, radius: float = RADIUS) -> SizedTruss:
    """A closed curve through points."""
    n = len(points)
    steps = np.stack([np.arange(n), np.roll(np.arange(n), -1)], axis=1)
    curve = Curve(CurveKind.BOUNDARY, "tension", 0, (None, 1, None), 0, np.arange(n), np.arange(n), True)
    return sized(Truss(points, np.ones(n, int), np.sort(steps, axis=1), (curve,), 10.0), radius)


def circle(n: int, height: float) -> np.ndarray:
    """Points of a circle that goes up and down, and in and out, so that it winds like a screw."""
    t = 2 * np.pi * np.arange(n) / n
    r = 20 + 0.5 * height * np.sin(2 * t)
    return np.stack([r * np.cos(t), r * np.sin(t), height * np.cos(2 * t)], axis=1)


def bars_of(truss: SizedTruss, knobs: Knobs | None = None) -> tuple[PreparedTruss, list, np.ndarray]:
    prepared = prepare_truss(truss, knobs or Knobs())
    plan, curves = plan_bars(prepared)
    solids, _ = kernel.make_solids(plan)
    assert all(kernel.is_valid(solid) for solid in solids)
    return prepared, solids, curves


def volumes(solids) -> np.ndarray:
    return np.array([kernel.volume(solid) for solid in solids])


def tube_volume(prepared: PreparedTruss) -> float:
    """Volume of the tubes between their circles: the mesh has it but for a part in a thousand."""
    truss, reach = prepared.sized.truss, prepared.sizes.reach.reshape(-1, 2)
    length = truss.lengths - reach.sum(1)
    return float((np.pi * prepared.sizes.end_radius[0::2] ** 2 * length).sum())


def test_straight_bars_are_cylinders_from_end_to_end() -> None:
    """A bar of a straight grid is as long as its curve, less the reach of the nodes at both ends."""
    prepared, solids, curves = bars_of(sized(grid_truss((4, 3, 3), warp=0.0), RADIUS))
    truss, reach = prepared.sized.truss, prepared.sizes.reach.reshape(-1, 2)
    expected = []
    for c in curves.tolist():
        members = truss.curves[c].members
        ends = reach[members[0], 0] + reach[members[-1], 1]
        expected.append(np.pi * RADIUS**2 * (truss.lengths[members].sum() - ends))
    assert curves.tolist() == list(range(len(truss.curves)))
    assert volumes(solids) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("knobs", [Knobs(), Knobs(fillet_ratio=0.0)])
def test_tubes_and_nodes_are_the_whole(knobs) -> None:
    """Members of one's own (each a curve) touch the nodes: volumes add up."""
    directions = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0.2, 0.1], [0.9, 0.5, 0]])
    prepared, solids, _ = bars_of(star(directions), knobs)
    nodes, numbers = plan_nodes(prepared)
    bodies, _ = kernel.make_solids(nodes)
    assert all(kernel.is_valid(body) for body in bodies)
    assert len(bodies) == len(numbers) == 6
    whole, _ = kernel.make_solids(assemble_shell(prepared))
    assert volumes(solids).sum() == pytest.approx(tube_volume(prepared), rel=1e-6)
    assert volumes(solids).sum() + volumes(bodies).sum() == pytest.approx(volumes(whole).sum(), rel=1e-6)


def test_bars_overlap_nodes_by_their_cores_only() -> None:
    """Along straight curves: bars + nodes - cores = the whole."""
    prepared, solids, _ = bars_of(sized(grid_truss((3, 3, 3), warp=0.0), RADIUS))
    bodies, _ = kernel.make_solids(plan_nodes(prepared)[0])
    whole, _ = kernel.make_solids(assemble_shell(prepared))
    cores = volumes(solids).sum() - tube_volume(prepared)
    assert cores > 0
    assert volumes(solids).sum() + volumes(bodies).sum() - cores == pytest.approx(volumes(whole).sum(), rel=1e-6)


def test_united_the_parts_are_the_solid() -> None:
    """The kernel's own union of all parts has the volume of the one solid."""
    import cadquery as cq

    prepared = prepare_truss(sized(grid_truss((2, 3, 2), warp=0.0), RADIUS), Knobs())
    whole, _ = kernel.make_solids(assemble_shell(prepared))
    parts = [cq.Solid(part.solid) for part in build_assembly(prepared)]
    united = parts[0].fuse(*parts[1:])
    assert len(united.Solids()) == 1
    assert united.Volume() == pytest.approx(volumes(whole).sum(), rel=2e-4)


def test_warped_bars_follow_their_curves() -> None:
    prepared, solids, curves = bars_of(sized(grid_truss((3, 3, 3), warp=0.2), RADIUS, 0.3))
    assert curves.tolist() == list(range(len(prepared.sized.truss.curves)))
    for solid, c in zip(solids, curves.tolist(), strict=True):
        curve = prepared.sized.truss.curves[c]
        r, L = prepared.sized.radii[curve.members], prepared.sized.truss.lengths[curve.members]
        assert np.pi * r.min() ** 2 * 0.5 * L.sum() < kernel.volume(solid) < np.pi * r.max() ** 2 * 1.1 * L.sum()


@pytest.mark.parametrize("height", [0.0, 6.0])
def test_closed_curves_are_rings(height) -> None:
    """In the plane (seams meet) and out of it (an angle is left over): by Pappus, area times length."""
    prepared, solids, _ = bars_of(ring(circle(10, height)))
    length = prepared.tubes.spine_points(np.linspace(0, 1, 65))
    inside = np.linalg.norm(np.diff(length, axis=1), axis=2).sum() + prepared.sizes.reach.sum()
    assert len(solids) == 1
    assert kernel.volume(solids[0]) == pytest.approx(np.pi * RADIUS**2 * inside, rel=0.01)
    plan, _ = plan_bars(prepared)
    arcs = plan.edges.ranges[:, 1] - plan.edges.ranges[:, 0]
    split = (plan.edges.form == 1) & (arcs < 2 * np.pi - 1e-9)
    assert split.sum() == (2 if height else 0)


def test_members_of_two_curves_belong_to_the_one_that_names_them() -> None:
    """A boundary curve along an interior one for a member in its middle has two bars."""
    nodes = np.array([[0, 0, 0], [10, 0, 0], [20, 0, 0], [30, 0, 0], [10, 10, 0], [20, 10, 0]], float)
    members = np.array([[0, 1], [1, 2], [2, 3], [1, 4], [2, 5]])
    curves = (
        Curve(CurveKind.INTERIOR, "tension", 0, (None, 1, 1), 0, np.array([4, 1, 2, 5]), np.array([3, 1, 4]), False),
        Curve(CurveKind.BOUNDARY, "third", 2, (None, 1, None), 0, np.arange(4), np.arange(3), False),
    )
    prepared, solids, owners = bars_of(sized(Truss(nodes, np.ones(6, int), members, curves, 10.0), RADIUS))
    assert owners.tolist() == [0, 1, 1]
    names = [part.name for part in build_assembly(prepared) if part.group != "nodes"]
    assert names == [curves[0].name, curves[1].name, f"{curves[1].name} part 2"]
    assert len(solids) == 3


@pytest.mark.parametrize(("third", "bars"), [((60, 10, 0), 1), ((30, 30, 0), 1), ((2, 9, 0), 2)])
def test_a_turn_that_no_core_can_follow_ends_a_bar(third, bars) -> None:
    nodes = np.array([(0, 0, 0), (30, 0, 0), third], float)
    curve = Curve(CurveKind.FEATURE, "feature", -1, (None, None, None), 0, np.arange(3), np.arange(2), False)
    truss = sized(Truss(nodes, np.ones(3, int), np.array([[0, 1], [1, 2]]), (curve,), 10.0), RADIUS)
    prepared, solids, owners = bars_of(truss)
    assert owners.tolist() == [0] * bars
    reach = prepared.sizes.reach
    inside = reach[1] + reach[2] if bars == 1 else 0.0
    expected = np.pi * RADIUS**2 * (prepared.sized.truss.lengths.sum() - reach.sum() + inside)
    assert volumes(solids).sum() == pytest.approx(expected, rel=0.02)


def test_nodes_have_a_disc_at_every_tube() -> None:
    prepared = prepare_truss(sized(grid_truss((3, 3, 2), warp=0.1), RADIUS), Knobs())
    plan, nodes = plan_nodes(prepared)
    degrees = prepared.sized.truss.degrees[nodes]
    planes = np.bincount(plan.faces.component[plan.faces.form == 5], minlength=len(nodes))
    assert (planes == degrees).all()
    assert not (plan.faces.role == FaceRole.MEMBER).any()


def test_a_traced_truss_comes_apart_into_valid_parts() -> None:
    """Acute angles, boundary curves, sharp turns: every part is valid, and every curve that names members has one."""
    prepared = prepare_truss(sized(sparse_reference_truss("cantilever_beam_beta0.1_rho16", 3), 0.8, 0.2), Knobs())
    parts = build_assembly(prepared)
    curves = {curve.name for curve in prepared.sized.truss.curves}
    naming = {prepared.sized.truss.curves[c].name for c in prepared.sized.truss.curve_of_member}
    bars = {part.name for part in parts if part.group != "nodes"}
    assert naming == bars & curves
    assert len({part.name for part in parts}) == len(parts)
    used = len(np.unique(prepared.sized.truss.members))
    assert sum(part.group == "nodes" for part in parts) == used
    whole, _ = kernel.make_solids(assemble_shell(prepared))
    total = sum(kernel.volume(part.solid) for part in parts)
    assert 1.0 < total / volumes(whole).sum() < 1.4


def test_an_invalid_part_is_named(monkeypatch) -> None:
    prepared = prepare_truss(star(np.eye(3)), Knobs())
    first = prepared.sized.truss.curves[0].name
    monkeypatch.setattr(kernel, "is_valid", lambda shape: False)
    with pytest.raises(GeometryKernelError, match=first.split("(")[0]):
        build_assembly(prepared)


def test_parts_are_ordered_by_group() -> None:
    parts = build_assembly(prepare_truss(star(np.eye(3)), Knobs()))
    assert [part.group for part in parts] == ["tension", "compression", "third"] + ["nodes"] * 4
    assert all(isinstance(part, AssemblyPart) for part in parts)
