"""Outlines from CAD: files and objects, lines and curves, and what is no outline."""

import build123d as bd
import cadquery as cq
import numpy as np
import pytest

from michell_cad.cad.profile_files import profile_from_cad, read_profile
from michell_cad.errors import InvalidInputError
from michell_cad.profile_source import with_profile_file
from michell_cad.profiles import named_profile, outline_profile

TWO_TO_ONE = named_profile("square", 2.0)
RECTANGLE = cq.Workplane().rect(4, 2)
SVG = '<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"><path d="M 0 0 L 4 0 L 4 2 L 0 2 Z"/></svg>'


def is_rectangle(rows) -> bool:
    """Whether an outline is the rectangle of 2 : 1, begun at any corner."""
    corners, expected = (
        np.array(sorted(p.pieces[:, 0].round(6).tolist())) for p in (outline_profile(rows), TWO_TO_ONE)
    )
    return corners.shape == expected.shape and np.allclose(corners, expected, atol=1e-5)


@pytest.mark.parametrize(
    "shape", [RECTANGLE, RECTANGLE.wires().val(), bd.Rectangle(4, 2), cq.Sketch().rect(4, 2), bd.Rectangle(4, 2).wire()]
)
def test_objects_of_both_libraries_give_their_corners(shape) -> None:
    rows = profile_from_cad(shape)
    assert all(len(row) == 2 for row in rows)
    assert is_rectangle(rows)


@pytest.mark.parametrize("suffix", [".dxf", ".svg", ".step", ".brep"])
def test_files_of_all_kinds_give_the_same_outline(suffix, tmp_path) -> None:
    path = tmp_path / f"section{suffix}"
    if suffix == ".dxf":
        cq.exporters.exportDXF(RECTANGLE, str(path))
    elif suffix == ".svg":
        path.write_text(SVG)
    elif suffix == ".step":
        bd.export_step(bd.Rectangle(4, 2), str(path))
    else:
        cq.Face.makeFromWires(RECTANGLE.wires().val()).exportBrep(str(path))
    assert is_rectangle(read_profile(path))
    assert with_profile_file({"profile": path.name, "radius": 1}, tmp_path)["profile"] == read_profile(path)


def test_values_without_a_file_stay() -> None:
    assert with_profile_file({"profile": "square", "radius": 1}) == {"profile": "square", "radius": 1}
    assert with_profile_file({"radius": 1}) == {"radius": 1}


def test_a_circle_is_the_round_profile() -> None:
    profile = outline_profile(profile_from_cad(cq.Workplane().circle(3)))
    assert len(profile.sides) == 1
    t = np.linspace(0, 1, 9)[:, None, None]
    P = profile.pieces.transpose(1, 0, 2)
    X = (1 - t) ** 3 * P[0] + 3 * (1 - t) ** 2 * t * P[1] + 3 * (1 - t) * t**2 * P[2] + t**3 * P[3]
    assert np.abs(np.linalg.norm(X, axis=-1) - 1).max() < 1e-5


def test_an_ellipse_in_any_plane_is_the_stretched_round_profile() -> None:
    profile = outline_profile(profile_from_cad(cq.Workplane("XZ").ellipse(3, 1)))
    assert profile.reach == pytest.approx(np.sqrt(3), rel=1e-4)


def test_roundings_join_smoothly() -> None:
    assert len(outline_profile(profile_from_cad(bd.RectangleRounded(4, 2, 0.5))).sides) == 1
    assert len(outline_profile(profile_from_cad(bd.Trapezoid(4, 2, 60))).sides) == 4


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        (cq.Workplane().moveTo(0, 0).lineTo(1, 0).lineTo(1, 1).wire(), "is open: its 2 edges do not come back"),
        (cq.Workplane().polyline([(0, 0), (1, 1), (1, 0), (0, 1)]).close(), "crosses .* in the order 1, 3, 2, 4"),
        (bd.Rectangle(3, 3) - bd.Circle(1), r"has holes \(1\), a profile has none"),
        (
            [RECTANGLE.val(), cq.Workplane().center(9, 9).rect(1, 1).val()],
            "one closed outline, found 2 that do not join",
        ),
        (cq.Workplane().polyline([(0, 0, 0), (1, 0, 0), (1, 1, 1), (0, 1, 0)]).close(), "not plane"),
        (cq.Workplane(), "there is no outline in it"),
        (3, "found int"),
    ],
)
def test_what_is_no_outline_is_refused(shape, message) -> None:
    with pytest.raises(InvalidInputError, match=message):
        profile_from_cad(shape)


def test_files_that_cannot_be_read_are_refused(tmp_path) -> None:
    with pytest.raises(InvalidInputError, match=r"none\.dxf: there is no such file"):
        read_profile(tmp_path / "none.dxf")
    with pytest.raises(InvalidInputError, match=r"not from '\.txt'"):
        read_profile(tmp_path / "none.txt")
    for suffix in (".dxf", ".step", ".brep", ".svg"):
        broken = tmp_path / f"broken{suffix}"
        broken.write_text("no geometry")
        with pytest.raises(InvalidInputError, match=r"cannot be read|no outline"):
            read_profile(broken)
