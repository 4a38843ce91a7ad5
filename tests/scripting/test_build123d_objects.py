"""The truss as an object of build123d: the package's own solid, in both modes, with joints."""

import copy

import build123d as bd
import numpy as np
import pytest
from hosts import exercised

from michell_cad.design_file import load_saved
from michell_cad.errors import InvalidInputError
from michell_cad.palette import COLOURS
from michell_cad.scripting.build123d_objects import FinishedTruss, MichellTruss, SavedTruss

SAME = 1e-4
"""Relative difference of volumes: build123d's are the kernel's plain integrals, off by less than this on the bar."""

FEW = {"radius": 1.0, "every": 2}
"""Knobs that leave few curves: build123d's boxes and volumes of many splines take seconds."""

PLAIN = 2e-3
"""Relative difference between the kernel's plain integral over splines and its adaptive one."""


@pytest.fixture(scope="module")
def part() -> bd.Part:
    return bd.Box(80, 40, 40)


@pytest.fixture(scope="module")
def truss(part, bar) -> MichellTruss:
    made = MichellTruss(part, **bar, **FEW)
    exercised("build123d", bd.__version__)
    return made


def test_it_is_the_packages_solid_as_a_valid_part(truss):
    assert isinstance(truss, bd.Part)
    assert truss.is_valid
    assert truss.label == "truss"
    assert truss.volume == pytest.approx(truss.report.volume_mm3, rel=PLAIN)
    assert len(truss.solids()) == truss.report.solids == 1
    assert len(truss.faces()) == truss.report.faces
    box = truss.bounding_box(optimal=False)
    assert box.min.X == pytest.approx(-40, abs=5)
    assert box.max.Z == pytest.approx(20, abs=5)


def test_it_comes_back_from_a_step_file(truss, tmp_path):
    third = SavedTruss(truss.finished.source.design, **(FEW | {"family": "third"}))
    bd.export_step(third, str(tmp_path / "truss.step"))
    back = bd.import_step(str(tmp_path / "truss.step"))
    assert back.is_valid
    assert len(back.solids()) == third.report.solids
    assert back.volume == pytest.approx(third.volume, rel=SAME)
    assert tuple(back.center()) == pytest.approx(tuple(third.center()), abs=1e-3)
    bd.export_step(third.families, str(tmp_path / "families.step"))
    for group, again in zip(
        third.families.children, bd.import_step(str(tmp_path / "families.step")).children, strict=True
    ):
        assert again.label == group.label
        assert len(again.faces()) == len(group.faces())
        assert tuple(again.color)[:3] == pytest.approx(tuple(group.color)[:3], abs=1e-3)


def test_moves_and_copies_compute_nothing(truss, no_stage, monkeypatch):
    monkeypatch.setattr("michell_cad.scripting.finished.build_united", lambda *values: pytest.fail("built again"))
    moved = bd.Pos(1, 2, 3) * bd.Rot(0, 0, 90) * truss
    for other in (moved, copy.copy(truss), copy.deepcopy(truss), truss.located(bd.Location((5, 0, 0)))):
        assert isinstance(other, MichellTruss)
        assert other.finished is truss.finished
        assert other.volume == pytest.approx(truss.volume, rel=1e-9)
        assert set(other.joints) == set(truss.joints)
        assert all(joint.parent is other for joint in other.joints.values())
    # the load at (40, 0, 0) turns to (0, 40, 0) and moves on
    assert tuple(moved.joints["load 1"].location.position) == pytest.approx((1, 42, 3), abs=1e-9)


def test_joints_stand_on_supports_and_loads_with_z_outwards(truss):
    frames = {name: bd.Plane(joint.location) for name, joint in truss.joints.items()}
    assert set(frames) == {"support 1", "load 1"}
    for name, x in (("support 1", -1), ("load 1", 1)):
        assert tuple(frames[name].origin) == pytest.approx((40 * x, 0, 0), abs=1e-9)
        assert tuple(frames[name].z_dir) == pytest.approx((x, 0, 0), abs=1e-9)


def test_joints_connect_the_truss_to_other_bodies(truss):
    arm, wall = copy.copy(truss), bd.Box(10, 100, 100)
    bd.RigidJoint("front", wall, bd.Plane(wall.faces().sort_by(bd.Axis.X)[-1]).location)
    wall.locate(bd.Location((300, 0, 0)))
    wall.joints["front"].connect_to(arm.joints["support 1"])
    assert bd.Plane(arm.joints["support 1"].location).origin.X == pytest.approx(305)
    second = copy.copy(truss)
    arm.joints["load 1"].connect_to(second.joints["support 1"])
    mine, theirs = (bd.Plane(j.location) for j in (arm.joints["load 1"], second.joints["support 1"]))
    assert tuple(theirs.origin) == pytest.approx(tuple(mine.origin), abs=1e-9)
    assert tuple(theirs.z_dir) == pytest.approx(tuple(mine.z_dir), abs=1e-9)
    assert second.volume == pytest.approx(truss.volume, rel=1e-9)


def test_builder_and_algebra_mode_give_the_same(truss, bar, no_stage):
    with bd.BuildPart() as built:
        bd.Box(80, 40, 40)
        inside = MichellTruss(**bar, **FEW, mode=bd.Mode.REPLACE)
    with bd.BuildPart() as placed:
        with bd.Locations((0, 0, 100)):
            shifted = SavedTruss(truss.finished.source.design, **FEW, rotation=(0, 0, 90))
    algebra = bd.Pos(0, 0, 100) * bd.Rot(0, 0, 90) * truss
    for part in (built.part, placed.part, inside, shifted, algebra):
        assert part.is_valid
        assert part.volume == pytest.approx(truss.volume, rel=SAME)
    assert tuple(placed.part.center()) == pytest.approx(tuple(algebra.center()), abs=1e-2)
    assert tuple(shifted.joints["load 1"].location.position) == pytest.approx((0, 40, 100), abs=1e-3)


def test_align_puts_its_box_where_it_is_wanted(truss):
    design = truss.finished.source.design
    low = SavedTruss(design, **(FEW | {"family": "third"}), align=bd.Align.MIN)
    assert tuple(low.bounding_box().min) == pytest.approx((0, 0, 0), abs=1e-6)
    assert low.joints["load 1"].location.position.X - low.joints["support 1"].location.position.X == pytest.approx(80)


def test_families_are_labelled_coloured_and_stand_where_the_truss_stands(truss):
    moved = bd.Pos(0, 0, 50) * truss
    groups = {child.label: child for child in moved.families.children}
    assert {"tension", "compression", "third", "node"} <= set(groups)
    assert sum(len(group.faces()) for group in groups.values()) == len(truss.faces())
    assert sum(group.area for group in groups.values()) == pytest.approx(truss.area, rel=1e-6)
    for name, group in groups.items():
        assert tuple(group.color)[:3] == pytest.approx(COLOURS[name], abs=1e-6)
    faces = moved.faces_of("tension")
    assert len(faces) == len(groups["tension"].faces())
    # a face of a curve lies around its centre line, which knows where it is in the design
    assert min(face.center().Z for face in moved.faces()) > 50 - 25
    with pytest.raises(InvalidInputError, match="no faces of 'brace'"):
        truss.faces_of("brace")


def test_knobs_turn_in_place_without_any_stage(truss, no_stage):
    placed = bd.Pos(0, 0, 50) * bd.Rot(90, 0, 0) * truss
    thin = placed.turned(radius=0.7, entasis=0.2)
    assert isinstance(thin, FinishedTruss)
    assert (thin.knobs.radius, thin.knobs.entasis, truss.knobs.radius) == (0.7, 0.2, 1.0)
    assert thin.report.volume_mm3 < 0.8 * truss.report.volume_mm3
    assert tuple(thin.joints["load 1"].location.position) == pytest.approx((40, 0, 50), abs=1e-9)
    assert np.allclose(tuple(thin.center()), tuple(placed.center()), atol=1)
    with pytest.raises(InvalidInputError, match="entasys"):
        truss.turned(entasys=0.2)


def test_a_design_is_saved_and_opened_with_other_knobs(truss, tmp_path, no_stage):
    truss.save(tmp_path / "design.npz")
    assert load_saved(tmp_path / "design.npz").knobs.radius == 1.0
    again = SavedTruss(tmp_path / "design.npz")
    assert again.report.volume_mm3 == pytest.approx(truss.report.volume_mm3, rel=1e-9)
    # the file knows held and loaded vertices instead of faces: of a box the same places
    for name, joint in truss.joints.items():
        assert tuple(again.joints[name].location.position) == pytest.approx(tuple(joint.location.position), abs=1e-2)
    third = SavedTruss(truss.finished.source.design.truss, radius=1.0, family="third")
    assert not third.joints
    assert third.report.volume_mm3 < truss.report.volume_mm3
    with pytest.raises(InvalidInputError, match="cannot be saved"):
        third.save(tmp_path / "other.npz")


def test_what_a_builder_cannot_mean_is_refused(bar):
    with pytest.raises(InvalidInputError, match="give a part"):
        MichellTruss(**bar)
    with bd.BuildPart():
        bd.Box(80, 40, 40)
        with pytest.raises(InvalidInputError, match=r"use mode=Mode\.REPLACE"):
            MichellTruss(**bar)
    with pytest.raises(RuntimeError, match="BuildSketch doesn't have"), bd.BuildSketch():
        MichellTruss(bd.Box(80, 40, 40), **bar)
    with pytest.raises(InvalidInputError, match="radios"):
        MichellTruss(bd.Box(80, 40, 40), **bar, radios=1.0)
