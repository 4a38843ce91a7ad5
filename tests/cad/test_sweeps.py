"""Swept profiles: paths, frames, meshes and solids, against volumes and angles that are known."""

import numpy as np
import pytest

from michell_cad.cad import kernel, kernel_sweeps
from michell_cad.cad.sweep_frames import turn_profiles
from michell_cad.cad.sweep_mesh import mesh_sweep
from michell_cad.cad.sweep_paths import Paths, lay_paths
from michell_cad.cad.sweeps import Sweep, lay_sweeps
from michell_cad.curves import CurveKind
from michell_cad.moving_frames import transport_normals
from michell_cad.profiles import Profile, named_profile, outline_profile
from michell_cad.rotations import rotation_matrix
from michell_cad.truss import SizedTruss
from tests.cad.layouts import curve_truss, grid_truss, sized, star, turned

SQUARE, ROUND = named_profile("square"), named_profile("round")
CHANNEL = outline_profile([(0, 0), (4, 0), (4, 3), (3, 3), (3, 1), (1, 1), (1, 3), (0, 3)])


def sweeps_of(truss: SizedTruss, profile: Profile = SQUARE) -> tuple[Paths, tuple[Sweep, ...]]:
    paths = lay_paths(truss, profile.reach)
    return paths, lay_sweeps(paths, truss.truss)


def volumes(truss: SizedTruss, profile: Profile = SQUARE) -> tuple[np.ndarray, np.ndarray]:
    """Of the meshes and of the kernel's solids of all paths, all of them valid."""
    _, sweeps = sweeps_of(truss, profile)
    solids = [kernel_sweeps.make_sweep(sweep, profile, 1.0) for sweep in sweeps]
    assert all(kernel.is_valid(solid) for solid in solids)
    meshes = np.array([mesh_sweep(sweep, profile).volume for sweep in sweeps])
    return meshes, np.array([kernel.volume(solid, 1e-5) for solid in solids])


def arc(angle: float, n: int, radius: float = 20.0) -> np.ndarray:
    t = np.linspace(0, angle, n)
    return radius * np.stack([np.cos(t), np.sin(t), np.zeros(n)], axis=1)


@pytest.mark.parametrize("profile", [SQUARE, ROUND, CHANNEL, named_profile("triangle", 3.0)])
def test_along_a_straight_line_the_volume_is_area_times_length(profile) -> None:
    line = np.arange(4)[:, None] * np.array([[3.0, 4.0, 5.0]])
    mesh, solid = volumes(curve_truss(line, 0.5), profile)
    exact = np.pi * 0.25 * 3 * np.sqrt(50)
    assert mesh == pytest.approx([exact], rel=1e-12)
    # The kernel's round profile is a cubic outline.
    assert solid == pytest.approx([exact], rel=1e-5 if profile is ROUND else 1e-12)


@pytest.mark.parametrize("profile", [SQUARE, ROUND, CHANNEL])
def test_along_an_arc_the_volume_is_that_of_pappus(profile) -> None:
    """Area times the way of its centre; points of the truss lie on the arc, its splines beside it by 1e-4."""
    mesh, solid = volumes(curve_truss(arc(2.0, 9)), profile)
    assert solid == pytest.approx([np.pi * 40.0], rel=1e-3)
    assert mesh == pytest.approx(solid, rel=1e-3)


@pytest.mark.parametrize("profile", [SQUARE, ROUND])
def test_a_closed_curve_is_a_ring_without_ends(profile) -> None:
    ring = curve_truss(arc(2 * np.pi, 13)[:-1], closed=True)
    mesh, solid = volumes(ring, profile)
    assert solid == pytest.approx([2 * np.pi**2 * 20], rel=1e-3)
    assert mesh == pytest.approx(solid, rel=1e-3)
    _, (sweep,) = sweeps_of(ring, profile)
    assert sweep.closed
    assert len(kernel_sweeps.faces_of(kernel_sweeps.make_sweep(sweep, profile, 1.0))) == 2 * len(profile.sides)


def test_the_radius_is_followed() -> None:
    """Volume pi times the integral of r^2 along the line, by the quartic of a member's radius."""
    truss = curve_truss(np.arange(3)[:, None] * np.array([[10.0, 0, 0]]), 1.0, entasis=0.5)
    s = np.linspace(0, 1, 2001)
    exact = 20 * np.pi * np.trapezoid((1 + 8 * (s * (1 - s)) ** 2) ** 2, s)
    mesh, solid = volumes(truss)
    # A cubic through five stations of the quartic: entasis over a whole curve is far smoother than that of a member.
    assert solid == pytest.approx([exact], rel=2e-3)
    assert mesh == pytest.approx(solid, rel=1e-3)


def test_a_bend_is_a_mitre_joint_of_two_prisms() -> None:
    """Two prisms cut by the plane between them keep the area times the length of the path; eight plane walls."""
    truss = curve_truss([(0, 0, 0), (10, 0, 0), (10, 10, 0)], 0.8, kind=CurveKind.FEATURE)
    mesh, solid = volumes(truss)
    assert mesh == pytest.approx([np.pi * 0.64 * 20], rel=1e-12)
    assert solid == pytest.approx(mesh, rel=1e-12)
    _, (sweep,) = sweeps_of(truss)
    assert [stretch.degree for stretch in sweep.stretches] == [1, 1]


def test_a_bend_too_sharp_for_a_mitre_ends_a_path() -> None:
    paths, _ = sweeps_of(curve_truss([(0, 0, 0), (30, 0, 0), (2, 9, 0)], kind=CurveKind.FEATURE))
    assert len(paths.curves) == 2
    assert paths.curves.tolist() == [0, 0]
    crowded, _ = sweeps_of(curve_truss([(0, 0, 0), (2, 0, 0), (2, 2, 0)], 1.0, kind=CurveKind.FEATURE))
    assert len(crowded.curves) == 2


def test_a_closed_curve_with_one_corner_is_still_closed() -> None:
    """A drop: round, with one bend of 90 degrees, at which the path begins and ends in a mitre joint."""
    t = np.linspace(-0.75 * np.pi, 0.75 * np.pi, 13)
    points = np.stack([20 * np.cos(t), 20 * np.sin(t), np.zeros(13)], axis=1)
    drop = curve_truss(np.concatenate([points, [[-20 * np.sqrt(2), 0, 0]]]), closed=True, kind=CurveKind.FEATURE)
    paths, (sweep,) = sweeps_of(drop)
    assert sweep.closed
    assert paths.kinked.sum() == 1
    mesh, solid = volumes(drop)
    assert mesh == pytest.approx(solid, rel=1e-3)


def test_a_bend_too_narrow_for_the_profile_is_straightened() -> None:
    """A square of 1.3 mm reaches 1.63 mm, over the middle of a bend of 1.5 mm."""
    assert len(lay_paths(curve_truss(arc(np.pi, 5, 1.5), 1.3), SQUARE.reach).straightened) == 4
    assert len(lay_paths(curve_truss(arc(2.0, 9)), SQUARE.reach).straightened) == 0


def normals_of(truss: SizedTruss) -> tuple[Paths, np.ndarray]:
    paths = lay_paths(truss, SQUARE.reach)
    return paths, turn_profiles(paths, truss.truss)


def test_profiles_lie_along_the_next_family() -> None:
    """On a straight grid: x of tension along compression, of compression along third, of third along tension."""
    truss = sized(grid_truss((3, 3, 3), warp=0.0), 1.0)
    paths, normals = normals_of(truss)
    axis = np.array([curve.axis for curve in truss.truss.curves])[paths.curves[paths.path]]
    along = np.abs(np.einsum("nd,nd->n", normals, np.eye(3)[(axis + 1) % 3]))
    assert along == pytest.approx(np.ones(len(along)), abs=1e-9)


def test_profiles_turn_with_the_design() -> None:
    R = rotation_matrix(np.array([0.4, 1.2, -0.5]))
    truss = sized(grid_truss((4, 3, 3)), 1.0)
    _, normals = normals_of(truss)
    _, after = normals_of(turned(truss, R))
    assert after == pytest.approx(normals @ R.T, abs=1e-9)


def test_x_axes_point_outward() -> None:
    truss = sized(grid_truss((4, 3, 3)), 1.0)
    paths, normals = normals_of(truss)
    outward = ((paths.points - truss.truss.nodes.mean(0)) * normals).sum(1)
    assert (np.bincount(paths.path, outward) >= 0).all()


def test_along_a_plane_curve_the_profile_does_not_turn() -> None:
    _, normals = normals_of(curve_truss(arc(2.0, 9)))
    height = normals[:, 2]
    assert height == pytest.approx(np.full(len(height), height[0]), abs=1e-9)


def test_around_a_closed_space_curve_the_profile_comes_back_to_itself() -> None:
    """What is left over of a frame without twist is spread: the profile turns against it by one rate all around."""
    t = 2 * np.pi * np.arange(16) / 16
    r = 20 + 3 * np.sin(2 * t)
    points = np.stack([r * np.cos(t), r * np.sin(t), 6 * np.cos(2 * t)], axis=1)
    paths, normals = normals_of(curve_truss(points, closed=True))
    n = len(normals)
    around = np.append(np.arange(n), 0)
    X, T, N = paths.points[around], paths.leaving[around], normals[around]
    free = transport_normals(X, T, T, np.array([0, n + 1]), N[:1])
    turn = np.unwrap(np.arctan2((np.cross(free, N) * T).sum(1), (free * N).sum(1)))
    run = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(X, axis=0), axis=1))])
    assert abs(turn[-1]) > 0.1
    assert turn == pytest.approx(turn[-1] * run / run[-1], abs=1e-9)


def test_members_of_two_curves_are_swept_once() -> None:
    truss = star(np.eye(3))
    paths, _ = sweeps_of(truss)
    assert sorted(np.unique(paths.members).tolist()) == [0, 1, 2]
    assert len(paths.curves) == 3
