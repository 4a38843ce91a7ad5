import build123d as bd
import numpy as np
import pytest
from designs import small_bar

from michell_cad.cad.plates import mesh_copies, place_copies
from michell_cad.curves import Curve, CurveKind
from michell_cad.edits import Attach, EditList, Family, Where, attachment_frames
from michell_cad.edits.attachments import frames_along, transport
from michell_cad.errors import InvalidInputError
from michell_cad.knobs import Knobs
from michell_cad.splines import fit_splines
from michell_cad.truss import Truss

BAR = small_bar()


def ring(closed: bool, n: int = 24, radius: float = 50.0) -> Truss:
    angle = np.arange(n) * 2 * np.pi / n
    nodes = radius * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    pairs = [(i, i + 1) for i in range(n - 1)] + ([(0, n - 1)] if closed else [])
    curve = Curve(CurveKind.INTERIOR, "tension", 0, (None, 0, 0), 0, np.arange(n), np.arange(len(pairs)), closed)
    return Truss(nodes, np.zeros(n, int), np.array(pairs), (curve,), radius / 5)


def test_frames_around_a_ring_are_evenly_spaced_and_do_not_twist():
    truss = ring(closed=True)
    frames = frames_along(truss, fit_splines(truss), truss.curves[0], 50 * 2 * np.pi / 12, np.array([0.0, 0, 1]))
    assert len(frames.origins) == 12
    angle = np.unwrap(np.arctan2(frames.origins[:, 1], frames.origins[:, 0]))
    np.testing.assert_allclose(np.diff(angle), 2 * np.pi / 12, atol=1e-4)
    np.testing.assert_allclose(frames.axes[:, :, 0], np.tile([0, 0, 1], (12, 1)), atol=1e-6)
    np.testing.assert_allclose(frames.axes[:, :, 2] @ [0, 0, 1], 0, atol=1e-6)
    np.testing.assert_allclose(np.linalg.det(frames.axes), 1)


def test_frames_on_an_open_curve_leave_equal_rests():
    truss = ring(closed=False)
    frames = frames_along(truss, fit_splines(truss), truss.curves[0], 40.0, np.array([0.0, 0, 1]))
    length = 50 * 2 * np.pi * 23 / 24
    count = int(length // 40)
    assert len(frames.origins) == count + 1
    first = np.arccos(frames.origins[0, 0] / 50) * 50
    assert first == pytest.approx((length - 40 * count) / 2, rel=5e-3)


def test_transport_along_a_helix_turns_by_its_torsion():
    """Against the Frenet normal a frame without twist turns by the integral of the torsion."""
    t = np.linspace(0, 4 * np.pi, 4001)
    a, b = 10.0, 3.0
    points = np.stack([a * np.cos(t), a * np.sin(t), b * t], axis=1)
    tangents, normals = transport(points, np.array([-1.0, 0, 0]))
    np.testing.assert_allclose((normals * tangents).sum(1), 0, atol=1e-9)
    frenet = np.stack([-np.cos(t), -np.sin(t), 0 * t], axis=1)
    binormal = np.cross(tangents, frenet)
    turn = np.unwrap(np.arctan2((normals * binormal).sum(1), (normals * frenet).sum(1)))
    torsion_length = b / np.hypot(a, b) * t
    np.testing.assert_allclose(turn, -torsion_length, atol=2e-3)


def test_copies_stand_on_the_curves_of_a_selection():
    edit = Attach(where=Family("third") & Where("boundary"), part="lamp.step", spacing=6.0)
    structure = EditList((edit,)).replay(BAR, Knobs())
    frames = attachment_frames(structure, edit)
    lamps = place_copies(bd.Cylinder(0.5, 1), frames)
    assert len(lamps.solids()) == len(frames.origins)
    assert lamps.volume == pytest.approx(len(frames.origins) * np.pi * 0.25, rel=1e-6)
    corners, triangles = mesh_copies(bd.Box(1, 2, 3), frames)
    a, b, c = corners[triangles].transpose(1, 0, 2)
    drawn = np.einsum("td,td->t", a, np.cross(b, c)).reshape(len(frames.origins), -1).sum(1) / 6
    np.testing.assert_allclose(drawn, 6.0)
    np.testing.assert_allclose(corners.reshape(len(drawn), -1, 3).mean(1), frames.origins, atol=1e-9)
    centres = np.array([tuple(solid.center()) for solid in lamps.solids()])
    np.testing.assert_allclose(np.sort(centres, axis=0), np.sort(frames.origins, axis=0), atol=1e-6)


def test_what_cannot_be_attached_is_said(tmp_path):
    edit = Attach(where=Family("third"), part=str(tmp_path / "no.step"), spacing=500.0)
    structure = EditList((edit,)).replay(BAR, Knobs())
    frames = attachment_frames(structure, edit)  # one in the middle of each curve
    assert len(frames.origins) == Family("third").curves(BAR.truss).sum()
    with pytest.raises(InvalidInputError, match="there is no file"):
        place_copies(edit.part, frames)
    with pytest.raises(InvalidInputError, match="up must not be the zero vector"):
        EditList((Attach(part="x.step", spacing=5.0, up=(0.0, 0.0, 0.0)),)).replay(BAR, Knobs())
    with pytest.raises(InvalidInputError, match=r"copies, more than 20000; use a larger spacing"):
        EditList((Attach(part="x.step", spacing=1e-4),)).replay(BAR, Knobs())
