"""Rivals, and the exact volumes that no truss beats, each derived here again."""

from dataclasses import asdict, replace

import numpy as np
import pytest
from frames import box_grid, frame, loading
from scipy.integrate import quad
from shapes import cantilever

from michell_cad.errors import ConvergenceError, InvalidInputError
from michell_cad.strength import StrengthenOptions
from michell_cad.strength.comparison import (
    Candidate,
    compare_trusses,
    optimal_ground_structure,
    regular_grid,
    scale_to_union,
    standard_rivals,
    union_volume,
)
from michell_cad.strength.comparison.grids import turned_axes

PROBLEM = cantilever((8, 4, 4))


def plane(x, z):
    """Nodes of a grid in the plane y = 0."""
    X, Z = np.meshgrid(x, z, indexing="ij")
    return np.stack([X.ravel(), 0 * X.ravel(), Z.ravel()], axis=1)


def at(nodes, x, z):
    return int(np.abs(nodes - [x, 0, z]).sum(1).argmin())


def load_in_plane(nodes, held, node, force):
    result = loading(len(nodes), {n: (0, 1, 2) for n in held}, {node: (*force, 0, 0, 0)})
    fixed = result.held.copy()
    fixed[:, 1] = True
    return replace(result, held=fixed)


def test_grids_have_the_nodes_of_boxes():
    for cells, braced in (((4, 2, 2), False), ((2, 1, 1), True)):
        a, b, c = cells
        truss = regular_grid(PROBLEM.mesh, cells, diagonals="parallel" if braced else None)
        plain = a * (b + 1) * (c + 1) + (a + 1) * b * (c + 1) + (a + 1) * (b + 1) * c
        faces = a * b * (c + 1) + a * (b + 1) * c + (a + 1) * b * c
        assert len(truss.nodes) == (a + 1) * (b + 1) * (c + 1)
        assert len(truss.members) == plain + braced * faces
        np.testing.assert_allclose(np.ptp(truss.nodes, axis=0), [80, 40, 40], rtol=1e-2)
    turns = regular_grid(PROBLEM.mesh, (4, 2, 2), diagonals="zigzag")
    diagonals = np.concatenate([[curve.nodes for curve in turns.curves if curve.family == "brace"]])
    assert len(diagonals) == 4 * 2 * 3 * 2 + 5 * 2 * 2
    assert (np.rint(turns.nodes[diagonals] / 20).sum(2) % 2 == 0).all()
    # Of a turned grid most members run along its axes, the others along the faces and edges of the part.
    turned = regular_grid(PROBLEM.mesh, (8, 4, 4), turned_axes(45.0))
    d = np.diff(turned.nodes[turned.members], axis=1)[:, 0] / turned.lengths[:, None]
    along = np.abs(d @ turned_axes(45.0)) > 0.98
    assert along.any(1).mean() > 0.6
    assert along.sum(0).min() > 0.12 * len(d)
    with pytest.raises(InvalidInputError, match="at least one cell along each axis"):
        regular_grid(PROBLEM.mesh, (0, 2, 2))


def test_union_volumes():
    ball = 4 / 3 * np.pi
    alone = frame([[0, 0, 0], [10, 0, 0]], [(0, 1)], 1.0)
    assert union_volume(alone) == pytest.approx(10 * np.pi + ball, rel=0.01)
    # Two crossing bars share Steinmetz' solid, 16/3 r^3, at the node that they meet in: each has half of it there.
    cross = frame([[-10, 0, 0], [0, 0, 0], [10, 0, 0], [0, -10, 0], [0, 10, 0]], [(0, 1), (1, 2), (1, 3), (1, 4)], 1.0)
    assert union_volume(cross) == pytest.approx(40 * np.pi - 16 / 3 + 4 * ball / 2, rel=0.01)
    scaled = scale_to_union(cross, 60.0)
    assert union_volume(scaled) == pytest.approx(60, rel=2e-3)
    assert np.ptp(scaled.radii) == 0


def test_bar_and_wall():
    """A bar in tension takes F L; a load along a wall at the distance d takes 2 F d: two bars at 45 degrees, each with
    F / 2^(1/2) and of length 2^(1/2) d (no field of virtual strains below 1 does more than 2 F d of work)."""
    bar = plane([0, 7.0], [0.0])
    found = optimal_ground_structure(bar, load_in_plane(bar, [0], 1, (30, 0, 0)), 5.0)
    assert found.volume == pytest.approx(30 * 7 / 5, rel=1e-8)
    wall = plane([0, 10.0], np.arange(-20, 21, 5.0))
    held = np.flatnonzero(wall[:, 0] == 0)
    found = optimal_ground_structure(wall, load_in_plane(wall, held, at(wall, 10, 0), (0, 0, -30)), 5.0)
    assert found.volume == pytest.approx(2 * 30 * 10 / 5, rel=1e-6)
    assert len(found.areas) == 2


def test_michells_bounds_from_above():
    """Central load over a span, half plane: (pi/2) F L of a half circle and its spokes; a program comes near it.

    With q = F/2 at each support the arc carries N = F / 2 all along (radius L / 2) and the spokes, dN = N dphi at every
    angle, together N pi: (F/2) pi L/2 + (F/2) pi L/2 = (pi/2) F L.
    """
    arc = quad(lambda phi: 0.5 * 0.5, 0, np.pi)[0]
    assert 2 * arc == pytest.approx(np.pi / 2)
    nodes = plane(np.linspace(-1, 1, 13), np.linspace(0, 1, 7))
    supports = {at(nodes, -1, 0): (0, 2), at(nodes, 1, 0): (2,)}
    held = loading(len(nodes), supports, {at(nodes, 0, 0): (0, 0, -1, 0, 0, 0)})
    fixed = held.held.copy()
    fixed[:, 1] = True
    found = optimal_ground_structure(nodes, replace(held, held=fixed), 1.0)
    exact = np.pi / 2 * 2
    assert exact <= found.volume < 1.03 * exact


def test_circular_cantilever():
    """2 F R ln(R / r0): along logarithmic spirals at 45 degrees to the radius all strains are +-1.

    Per unit angle both families carry the tangential force F R / r at r, each F R / (2 r sin 45) over its length
    dr / cos 45: the volume is 2 int F R / r dr (two families, 1 / (2 sin 45 cos 45) = 1).
    """
    F, R, r0 = 3.0, 10.0, 2.0
    total = 2 * quad(lambda r: F * R / r / (2 * np.sin(np.pi / 4) * np.cos(np.pi / 4)), r0, R)[0]
    assert total == pytest.approx(2 * F * R * np.log(R / r0), rel=1e-9)
    # A ring of nodes on spirals: the program stays above and comes near.
    rings, spokes = 6, 16
    radii = r0 * (R / r0) ** (np.arange(rings + 1) / rings)
    angles = 2 * np.pi * (np.arange(spokes)[None] + 0.5 * (np.arange(rings + 1) % 2)[:, None]) / spokes
    nodes = np.stack([radii[:, None] * np.cos(angles), 0 * angles, radii[:, None] * np.sin(angles)], axis=2)
    nodes = nodes.reshape(-1, 3)
    tip = int(np.abs(nodes - [R, 0, 0]).sum(1).argmin())
    found = optimal_ground_structure(nodes, load_in_plane(nodes, range(spokes), tip, (0, 0, F)), 1.0)
    assert total * (1 - 1e-6) <= found.volume < 1.06 * total


def test_torsion_of_surfaces_of_revolution():
    """2 T S ln(r2/r1)/(r2-r1) of a cone, from bars at 45 degrees: int 2 T / r ds; 2 T L / R as r1 -> r2; the sphere
    gives 4 T ln cot(phi0 / 2)."""
    T, S, r1, r2 = 2.0, 7.0, 1.0, 3.0
    cone = quad(lambda s: 2 * T / (r1 + (r2 - r1) * s / S), 0, S)[0]
    assert cone == pytest.approx(2 * T * S * np.log(r2 / r1) / (r2 - r1), rel=1e-10)
    assert 2 * T * S * np.log(1.0001) / (2 * 0.0001) == pytest.approx(2 * T * S / 2, rel=1e-3)
    phi0, radius = 0.4, 5.0
    sphere = quad(lambda phi: 2 * T / (radius * np.sin(phi)) * radius, phi0, np.pi - phi0)[0]
    assert sphere == pytest.approx(4 * T * np.log(1 / np.tan(phi0 / 2)), rel=1e-10)
    # The program on a cylinder: rings turned against each other, torque at one end, between neighbours at 45 degrees.
    n, R = 12, 1.0
    h = 2 * R * np.sin(np.pi / n)
    angles = 2 * np.pi * np.arange(n) / n
    levels = 4
    nodes = np.concatenate(
        [np.stack([np.cos(angles), np.sin(angles), 0 * angles + k * h], axis=1) for k in range(levels)]
    )
    couple = {(levels - 1) * n + k: (-np.sin(a) / n, np.cos(a) / n, 0, 0, 0, 0) for k, a in enumerate(angles.tolist())}
    found = optimal_ground_structure(nodes, loading(len(nodes), {k: (0, 1, 2) for k in range(n)}, couple), 1.0)
    exact = 2 * 1.0 * (levels - 1) * h / R
    assert 0.9 * exact < found.volume < 1.15 * exact  # bars are chords inside the cylinder


def test_the_strip_comes_near_its_numerical_value():
    """Height h, length 2 h, load at mid-height: 7.027 F h; 8 x 4 cells are a few per cent above."""
    nodes = plane(np.linspace(0, 2, 9), np.linspace(-0.5, 0.5, 5))
    held = np.flatnonzero(nodes[:, 0] == 0)
    found = optimal_ground_structure(nodes, load_in_plane(nodes, held, at(nodes, 2, 0), (0, 0, -1)), 1.0)
    assert 7.027 < found.volume < 1.05 * 7.027


def test_several_load_cases_cost_more_than_each_and_less_than_all():
    nodes = plane([0, 10.0, 20.0], np.arange(-10, 11, 5.0))
    held = np.flatnonzero(nodes[:, 0] == 0)
    tip = at(nodes, 20, 0)
    one, two = (load_in_plane(nodes, held, tip, force) for force in ((0, 0, -3.0), (20.0, 0, 0)))
    both = replace(one, forces=np.concatenate([one.forces, two.forces]), names=("a", "b"), weights=np.ones(2))
    a, b, ab = (optimal_ground_structure(nodes, load, 1.0).volume for load in (one, two, both))
    assert max(a, b) - 1e-6 <= ab <= a + b + 1e-6
    assert ab > 1.01 * max(a, b)


def test_rows_side_by_side():
    grid = box_grid((4, 2, 2))
    inside = frame(grid.truss.nodes * [20, 20, 20], grid.truss.members, 1.0)
    plain = Candidate("frame", inside)
    twice = Candidate("the same, thicker", type(inside)(inside.truss, 2 * inside.radii))
    one, other = compare_trusses(PROBLEM, [plain, twice], 9000.0)
    figures = [{key: value for key, value in asdict(row).items() if key != "name"} for row in (one, other)]
    assert figures[1] == pytest.approx(figures[0], rel=3e-3)
    assert one.volume_fraction == pytest.approx(9000 / 128000)
    assert one.off_axis_yield <= one.yield_factor
    assert one.frame_buckling > 0
    assert 0 < one.pin_joint_residual < 1
    with pytest.raises(InvalidInputError, match="volume must be positive"):
        compare_trusses(PROBLEM, [plain], -1.0)


def test_rivals_are_of_all_kinds():
    rivals, notes = standard_rivals(PROBLEM, StrengthenOptions(), sizes=(2,))
    assert notes == []
    assert [r.name for r in rivals] == [
        "grid 2x1x1",
        "grid 2x1x1 braced",
        "grid 2x1x1 zigzag",
        "grid 2x1x1 turned",
        "hexes",
        "hexes zigzag",
        "ground s. 2x1x1",
    ]
    rows = compare_trusses(PROBLEM, [rivals[0], rivals[1], rivals[-1]], 9000.0)
    assert rows[2].pin_joint_residual < 0.01  # a ground structure is a pure truss
    assert rows[1].compliance < rows[0].compliance
    # Cells of a box are those of its grid; by default as large as those of the finest one.
    assert len(rivals[4].sized.truss.members) == len(rivals[0].sized.truss.members)
    finer, _ = standard_rivals(PROBLEM, StrengthenOptions(), sizes=(2,), spacing=20.0)
    assert len(finer[4].sized.truss.members) == 4 * 9 + 5 * 2 * 3 * 2


def test_rivals_that_are_not_found_are_noted(monkeypatch):
    def fail(*arguments, **options):
        raise ConvergenceError("no luck")

    for name in ("conforming_map", "optimal_ground_structure"):
        monkeypatch.setattr(f"michell_cad.strength.comparison.rivals.{name}", fail)
    rivals, notes = standard_rivals(PROBLEM, StrengthenOptions(), sizes=(1,))
    assert [r.name for r in rivals] == [f"grid 1x1x1{kind}" for kind in ("", " braced", " zigzag", " turned")]
    assert notes == ["hexes are left out: no luck", "the ground structure is left out: no luck"]


def test_refusals(monkeypatch):
    nodes = plane([0, 10.0], [0.0, 5.0])
    load = load_in_plane(nodes, [0], 3, (0, 0, -1.0))
    with pytest.raises(InvalidInputError, match="strength must be positive, in MPa, found 0"):
        optimal_ground_structure(nodes, load, 0.0)
    with pytest.raises(InvalidInputError, match="no pin-jointed truss between the nodes carries the loads"):
        optimal_ground_structure(nodes, load, 1.0)
    monkeypatch.setattr("michell_cad.strength.comparison.ground_structure.free_memory", lambda: 1000)
    with pytest.raises(InvalidInputError, match=r"4 nodes has 6 possible bars and would take about .* use fewer cells"):
        optimal_ground_structure(nodes, load, 1.0)


def test_a_program_that_the_simplex_method_gives_up_is_solved_by_another(monkeypatch):
    from michell_cad.strength.comparison import ground_structure

    nodes = plane([0.0, 10.0], [0.0, 10.0, 20.0])
    loads = load_in_plane(nodes, [at(nodes, 0, 0), at(nodes, 0, 20)], at(nodes, 10, 10), (0, 0, -1.0))
    expected = optimal_ground_structure(nodes, loads, 1.0).volume
    assert expected == pytest.approx(2 * 10.0)  # 2 F d / sigma, two bars at 45 degrees
    solve, tried = ground_structure.linprog, []

    def give_up(**program):
        tried.append(program["method"])
        found = solve(**program)
        return replace_status(found, 4) if program["method"] == "highs" else found

    def replace_status(found, status):
        found.status = status
        return found

    monkeypatch.setattr(ground_structure, "linprog", give_up)
    assert optimal_ground_structure(nodes, loads, 1.0).volume == pytest.approx(expected, rel=1e-6)
    assert set(tried) == {"highs", "highs-ipm"}
