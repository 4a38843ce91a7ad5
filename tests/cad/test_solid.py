"""Solids against volumes in closed form, the direct mesh, and the rules that every solid must obey."""

import dataclasses
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.GeomAbs import GeomAbs_Sphere
from OCP.gp import gp_Pnt
from scipy.spatial.transform import Rotation

import michell_cad
from michell_cad.cad import kernel
from michell_cad.cad.prepare import STUBBORN
from michell_cad.cad.shell_plan import FaceRole
from michell_cad.cad.solid import build_solid
from michell_cad.errors import GeometryKernelError, InvalidInputError
from michell_cad.knobs import Knobs
from michell_cad.truss import SizedTruss
from tests.cad.layouts import grid_truss, sized, star

PLAIN = Knobs(fillet_ratio=0.0)
AXES = np.concatenate([np.eye(3), -np.eye(3)])


def branch_volume(R: float, r: float, f: float) -> tuple[float, float]:
    """What a straight member adds to the ball of one node, and the distance H at which its tube begins.

    The profile around the axis, from the circle on the sphere to the tube: y(x) is the fillet's arc of radius f about
    (H, r + f), bounded inside by the sphere. Integrated with Pappus: pi times the integral of y^2, by fine quadrature.
    """
    H = np.sqrt((R + f) ** 2 - (r + f) ** 2)
    x_0 = H * R / (R + f)
    x, w = np.polynomial.legendre.leggauss(400)
    angle = (x + 1) / 2 * np.arctan2(H, r + f)
    y, dx = r + f - f * np.cos(angle), f * np.cos(angle)
    fillet = np.pi * float(np.sum(w / 2 * np.arctan2(H, r + f) * y**2 * dx))
    cap = np.pi * (R - x_0) ** 2 * (2 * R + x_0) / 3
    return fillet - cap, H


def star_volume(n: int, length: float, R: float, r: float, f: float) -> float:
    """A ball with n members, each ending in a ball, from closed forms."""
    extra, H = branch_volume(R, r, f)
    return (n + 1) * 4 / 3 * np.pi * R**3 + n * (2 * extra + np.pi * r**2 * (length - 2 * H))


@pytest.mark.parametrize("fillet", [0.0, 0.4, 1.0])
@pytest.mark.parametrize(
    "directions", [AXES[:1], AXES[[0, 3]], AXES[:2], AXES[:3], AXES], ids=["one", "line", "corner", "tripod", "cross"]
)
def test_volume_in_closed_form(directions, fillet) -> None:
    knobs = Knobs(fillet_ratio=fillet, node_ratio=2.2)
    solid = build_solid(star(directions), knobs)
    expected = star_volume(len(directions), 10.0, 2.2, 1.0, fillet)
    assert solid.report.volume_mm3 == pytest.approx(expected, rel=1e-5)
    assert solid.mesh.volume == pytest.approx(expected, rel=5e-4)
    assert solid.report.genus == solid.report.expected_genus == 0
    n = len(directions)
    assert solid.report.faces == (n + 1) + n + (2 * n if fillet else 0)
    assert solid.report.filleted_nodes == (n + 1 if fillet else 0)
    assert solid.report.fallback_nodes == {}


def test_entasis_in_closed_form() -> None:
    """With w = 16 s^2 (1 - s)^2 the mean of (1 + e w)^2 over s is 1 + 16 e / 15 + 256 e^2 / 630."""
    e = 0.3
    plain = build_solid(star(AXES[:1]), PLAIN).report.volume_mm3
    bulged = build_solid(star(AXES[:1], radius=np.array([[1, 1 + e, 1]])), PLAIN).report.volume_mm3
    _, H = branch_volume(1.8, 1.0, 0.0)
    expected = np.pi * (10 - 2 * H) * (16 * e / 15 + 256 * e**2 / 630)
    assert bulged - plain == pytest.approx(expected, rel=6e-3)


def test_grid_is_valid_and_has_the_genus_of_its_graph() -> None:
    truss = grid_truss((5, 4, 3), warp=0.1)
    report = build_solid(sized(truss, 1.0, 0.3), Knobs()).report
    assert report.valid
    assert report.solids == 1
    assert report.genus == len(truss.members) - len(truss.nodes) + 1
    assert report.mesh_volume_mm3 == pytest.approx(report.volume_mm3, rel=2e-3)
    assert report.filleted_nodes == report.nodes == len(truss.nodes)


@pytest.mark.parametrize("seed", range(3))
def test_ugly_grids(seed) -> None:
    """Missing curves, strong warp, thick members: valences from 1 up, and a report that adds up."""
    truss = grid_truss((5, 4, 3), warp=0.25, missing=0.25, seed=seed)
    report = build_solid(sized(truss, 1.6, 0.3), Knobs()).report
    assert report.valid
    assert report.genus == report.expected_genus
    assert report.mesh_volume_mm3 == pytest.approx(report.volume_mm3, rel=2e-3)
    assert report.members + report.merged_members == len(truss.members)


def test_random_stars() -> None:
    rng = np.random.default_rng(7)
    creased = 0
    for _ in range(12):
        n = int(rng.integers(2, 9))
        directions, radii = rng.normal(size=(n, 3)), rng.uniform(0.3, 0.7, n)
        report = build_solid(star(directions, radius=radii), Knobs()).report
        assert report.mesh_volume_mm3 == pytest.approx(report.volume_mm3, rel=2e-3)
        assert report.fallback_nodes.keys() <= {"merged"}
        assert report.filleted_nodes == report.nodes
        creased += report.creased_nodes
    assert creased >= 6


@pytest.mark.parametrize("angle", [12.0, 20.0, 30.0, 40.0, 50.0, 75.0])
@pytest.mark.parametrize("fillet", [0.0, 0.4])
def test_two_members_at_any_angle(angle, fillet) -> None:
    half = np.radians(angle) / 2
    pair = [[np.cos(half), np.sin(half), 0], [np.cos(half), -np.sin(half), 0], [-1, 0, 0]]
    report = build_solid(star(pair, length=14.0, radius=0.7), Knobs(fillet_ratio=fillet)).report
    assert report.valid
    assert report.genus == 0
    sharp = fillet == 0 and angle < 45
    assert report.fallback_nodes == ({"mitred": 1} if sharp else {})
    assert report.creased_nodes == (fillet > 0 and angle < 55)


def test_members_too_close_are_merged_and_said_so() -> None:
    half = np.radians(3.0)
    pair = [[np.cos(half), np.sin(half), 0], [np.cos(half), -np.sin(half), 0]]
    report = build_solid(star(pair, length=np.array([10.0, 8.0])), Knobs()).report
    assert report.fallback_nodes["merged"] >= 1
    assert any("led through" in text or "merged" in text for text in report.messages)


@pytest.mark.parametrize("fillet", [0.0, 0.1])
def test_three_members_enclosing_a_piece_of_sphere(fillet) -> None:
    """Caps that overlap in pairs but leave a triangle between them: the sphere face falls in two."""
    t = np.arange(3) * 2 * np.pi / 3
    a = np.arcsin(np.sin(np.radians(20.0)) / np.sin(np.radians(60.0)))  # 40 degrees from one to the next
    cone = np.stack([np.sin(a) * np.cos(t), np.sin(a) * np.sin(t), np.full(3, np.cos(a))], axis=1)
    ratio = (1 + fillet) / np.sin(np.radians(22.2)) - fillet
    solid = build_solid(star(cone), Knobs(node_ratio=ratio, fillet_ratio=fillet))
    assert (solid.face_owner[solid.face_role == FaceRole.NODE] == 0).sum() == 2
    assert solid.report.genus == 0


def test_components_are_separate_solids() -> None:
    one = star(AXES[:1])
    truss = one.truss
    curves = (
        truss.curves[0],
        dataclasses.replace(truss.curves[0], component=1, nodes=np.array([2, 3]), members=np.array([1])),
    )
    both = dataclasses.replace(
        truss,
        nodes=np.concatenate([truss.nodes, truss.nodes + [0, 20, 0]]),
        node_kinds=np.zeros(4, int),
        members=np.array([[0, 1], [2, 3]]),
        curves=curves,
        waypoints=None,
        waypoint_offsets=None,
    )
    solid = build_solid(SizedTruss(both, np.ones((2, 3))), Knobs())
    alone = build_solid(one, Knobs())
    assert solid.report.solids == 2
    assert solid.report.volume_mm3 == pytest.approx(2 * alone.report.volume_mm3, rel=1e-9)
    assert len(solid.build123d.solids()) == 2


def test_rotation_and_scale() -> None:
    thin = sized(grid_truss((3, 3, 2), warp=0.15), 1.0, 0.2)
    reference = build_solid(thin, Knobs()).report
    turn, scale = Rotation.from_rotvec([0.4, -1.1, 0.7]).as_matrix(), 37.0
    truss = dataclasses.replace(thin.truss, nodes=scale * thin.truss.nodes @ turn.T + [5, 6, 7])
    report = build_solid(SizedTruss(truss, scale * thin.radii), Knobs()).report
    assert report.volume_mm3 == pytest.approx(scale**3 * reference.volume_mm3, rel=1e-5)
    assert (report.faces, report.genus) == (reference.faces, reference.genus)
    assert report.fallback_nodes == reference.fallback_nodes


def test_objects_of_both_libraries() -> None:
    solid = build_solid(star(AXES[:3]), Knobs())
    assert solid.build123d.is_valid
    assert solid.build123d.volume == pytest.approx(solid.report.volume_mm3, rel=1e-3)
    assert solid.cadquery.val().isValid()
    assert solid.cadquery.val().Volume() == pytest.approx(solid.report.volume_mm3, rel=1e-3)


def test_a_further_boolean_works() -> None:
    import cadquery

    solid = build_solid(star(AXES), Knobs())
    plate = cadquery.Workplane("XY").box(30, 30, 1).translate((0, 0, -10))
    united = plate.union(solid.cadquery)
    both = plate.val().Volume() + solid.report.volume_mm3
    assert united.val().isValid()
    # The plate is 1 mm thick and cuts the ball of radius 1.8 mm at the member's end through its middle.
    shared = np.pi * (1.8**2 - 1 / 12) * 1.0
    assert united.val().Volume() == pytest.approx(both - shared, rel=1e-3)


def test_faces_are_named_after_their_curves() -> None:
    solid = build_solid(star(AXES[:3]), Knobs())
    curve = solid.face_curve
    assert (curve[solid.face_role == FaceRole.NODE] == -1).all()
    for number in range(3):
        assert (curve == number).sum() == 3


def test_progress_rises_to_one() -> None:
    told: list[float] = []
    build_solid(star(AXES[:2]), Knobs(), told.append)
    assert told == sorted(told)
    assert told[-1] == 1.0


def test_refuses_an_empty_truss() -> None:
    one = star(AXES[:1])
    empty = dataclasses.replace(one.truss, members=np.zeros((0, 2), int), curves=(), waypoints=None)
    with pytest.raises(InvalidInputError, match="without members"):
        build_solid(SizedTruss(empty, np.zeros((0, 3))), Knobs())


@pytest.mark.parametrize(
    ("name", "broken", "message"),
    [
        ("volume", lambda shape: 1.1 * kernel_volume(shape), "difference"),
        ("volume", lambda shape: -kernel_volume(shape), "difference"),
        ("faulty_faces", lambda solid, faces: [0], "faulty"),
    ],
)
def test_gates_trip(monkeypatch, name, broken, message) -> None:
    monkeypatch.setattr(kernel, name, broken)
    with pytest.raises(GeometryKernelError, match=message):
        build_solid(star(AXES[:2]), Knobs())


def test_more_members_than_memory_are_refused_before_any_work(monkeypatch) -> None:
    truss = sized(grid_truss((3, 3, 2)), 0.8)
    n = len(truss.truss.members)
    monkeypatch.setattr("michell_cad.cad.solid.free_memory", lambda: 20 * n * 1000)
    monkeypatch.setattr("michell_cad.cad.solid.prepare_truss", None)
    with pytest.raises(InvalidInputError, match=rf"of {n} members would take about .* set every = 3"):
        build_solid(truss, Knobs())


@pytest.mark.parametrize("times", [1, 2, 3, 5])
def test_nodes_that_the_kernel_finds_faulty_are_laid_out_in_another_way(monkeypatch, times) -> None:
    """Larger spheres first, then other directions and smaller fillets as well, straight members at last."""
    truss, real, calls = sized(grid_truss((3, 3, 2), warp=0.15), 0.8), kernel.faulty_faces, []
    first = build_solid(truss, Knobs()).prepared

    def faulty(solid, faces):
        calls.append(len(faces))
        return [0] if len(calls) <= times else real(solid, faces)

    monkeypatch.setattr(kernel, "faulty_faces", faulty)
    solid = build_solid(truss, Knobs())
    shaken = np.flatnonzero(solid.prepared.shakes)
    assert (solid.prepared.shakes[shaken] == times).all()
    assert 1 <= len(shaken) <= 2
    assert (solid.prepared.sizes.radius[shaken] != first.sizes.radius[shaken]).all()
    mine = np.isin(solid.prepared.node_of_end, shaken)
    turned = np.linalg.norm(solid.prepared.directions - first.directions, axis=1)
    assert (turned[mine] > np.radians(0.2)).all() == (times > 1)
    assert (solid.prepared.sizes.fillet[mine] < 0.9 * first.sizes.fillet[mine]).all() == (times > 1)
    assert (solid.report.straightened_members > 0) == (times >= 4)
    assert (turned < 1e-12).sum() > 0.5 * len(turned)
    # Between the first and the last check, which are of the whole, only what changed is checked again.
    assert calls[0] == calls[-1] == len(solid.faces)
    assert len(calls) == times + 2
    assert max(calls[1:-1]) < 0.5 * calls[0]


def test_where_nothing_else_helps_the_two_nearest_members_become_one(monkeypatch) -> None:
    truss, real, calls = star([*AXES, np.array([1.0, 0.4, 0.0]) / np.hypot(1.0, 0.4)]), kernel.faulty_faces, []

    first = build_solid(truss, Knobs())

    def at_center(face) -> bool:
        surface = BRepAdaptor_Surface(face)
        return surface.GetType() == GeomAbs_Sphere and surface.Sphere().Location().Distance(gp_Pnt()) < 1e-6

    def faulty(solid, faces):
        calls.append(len(faces))
        return [k for k, face in enumerate(faces) if at_center(face)] if len(calls) <= STUBBORN else real(solid, faces)

    assert not first.report.fallback_nodes
    monkeypatch.setattr(kernel, "faulty_faces", faulty)
    solid = build_solid(truss, Knobs())
    degree = np.bincount(solid.prepared.sized.truss.members.ravel()).max()
    assert degree == np.bincount(first.prepared.sized.truss.members.ravel()).max() - 1
    assert solid.report.fallback_nodes["merged"] >= 1


kernel_volume = kernel.volume


def test_kernel_check_sees_a_missing_face() -> None:
    """The gate itself: a shell without one of its faces is no valid solid."""
    from michell_cad.cad.prepare import prepare_truss
    from michell_cad.cad.shell import assemble_shell

    plan = assemble_shell(prepare_truss(star(AXES[:2]), Knobs()))
    keep = plan.coedges.face != len(plan.faces.form) - 1
    faces = dataclasses.replace(plan.faces, **{f.name: getattr(plan.faces, f.name)[:-1] for f in _fields(plan.faces)})
    coedges = dataclasses.replace(
        plan.coedges, **{f.name: getattr(plan.coedges, f.name)[keep] for f in _fields(plan.coedges)}
    )
    solids, made = kernel.make_solids(dataclasses.replace(plan, faces=faces, coedges=coedges))
    assert kernel.faulty_faces(solids[0], made) is not None


def _fields(value):
    return dataclasses.fields(value)


def test_too_thick_a_truss_names_curves_and_a_radius() -> None:
    with pytest.raises(GeometryKernelError, match=r"tension .* Use a radius of at most"):
        build_solid(star(AXES[:1], length=2.0, radius=1.5), Knobs())


def test_only_the_kernel_files_import_the_kernel() -> None:
    root = Path(michell_cad.__path__[0])
    users = [
        p.relative_to(root).as_posix()
        for p in root.rglob("*.py")
        if "import OCP" in p.read_text() or "from OCP" in p.read_text()
    ]
    assert sorted(users) == [
        "cad/kernel.py",
        "cad/kernel_booleans.py",
        "cad/kernel_files.py",
        "cad/kernel_step.py",
        "cad/kernel_sweeps.py",
    ]


def test_kernel_loads_only_when_a_solid_is_made() -> None:
    code = "import sys, michell_cad.cad; sys.exit(any(name.split('.')[0] == 'OCP' for name in sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
