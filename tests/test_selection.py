"""Regions of a part: what each way of naming them picks, and how a wrong name is answered."""

from pathlib import Path

import cadquery as cq
import numpy as np
import pytest
from pydantic import ValidationError
from shapes import box_mesh

from michell_cad.domain import Part, part_from_tets, read_outline
from michell_cad.domain.cad_part import outline_from_shape
from michell_cad.domain.outline import Outline
from michell_cad.errors import InvalidInputError
from michell_cad.selection import Region, list_faces, select_faces, select_triangles, suggest_selectors


@pytest.fixture(scope="module")
def plate() -> Outline:
    """60 x 40 x 10 about the origin, two holes of radius 6 at x = -15 and 15."""
    return outline_from_shape(
        cq.Workplane().box(60, 40, 10).faces(">Z").workplane().rarray(30, 20, 2, 1).hole(12), "plate"
    )


@pytest.fixture(scope="module")
def bar() -> Part:
    """Tets only: 4 x 2 x 2 mm in cells of 0.5 mm, a corner at the origin."""
    return part_from_tets(box_mesh((8, 4, 4), (4.0, 2.0, 2.0)), "bar")


def area(part, region) -> float:
    return float(part.surface.areas[select_triangles(part, region)].sum())


def test_cadquery_strings_mean_what_cadquery_means(plate):
    """The faces are those that CadQuery itself returns, found again by their centres."""
    for selector in (">Z", "<X", "|Y", "#Z", "%CYLINDER", "%PLANE and >X", "not %PLANE", "+Z or -Z", ">>X[-2]"):
        wanted = sorted(face.Center().toTuple() for face in cq.Workplane(plate.shape).faces(selector).vals())
        found = sorted(plate.faces[number].centre for number in select_faces(plate, selector))
        assert np.allclose(wanted, found), selector


def test_selectors_one_after_the_other(plate):
    assert area(plate, ["%CYLINDER", "<X"]) == pytest.approx(2 * np.pi * 6 * 10, rel=0.01)
    assert len(select_faces(plate, "%CYLINDER")) == 2
    # Among the cylinders the leftmost; "and" would ask for a cylinder that is the leftmost of all faces.
    with pytest.raises(InvalidInputError, match="matches nothing"):
        select_faces(plate, "%CYLINDER and <X")


def test_numbers(plate):
    assert select_faces(plate, 3) == [3]
    assert select_faces(plate, [5, 1, 5]) == [1, 5]
    assert area(plate, [0, 1]) == pytest.approx(plate.faces[0].area + plate.faces[1].area)


def test_every_suggestion_picks_exactly_its_face(plate):
    bracket = read_outline(Path(__file__).parents[1] / "examples" / "bracket.step")
    for part in (plate, bracket):
        for number, selector in enumerate(suggest_selectors(part)):
            assert select_faces(part, selector) == [number]
    assert suggest_selectors(plate).count(">Z") == 1


def test_faces_that_no_selector_tells_apart_get_their_number():
    cross = cq.Workplane().box(10, 10, 10).faces(">Z").workplane().polarArray(3, 0, 360, 4).hole(1)
    outline = outline_from_shape(cross)
    for number, selector in enumerate(suggest_selectors(outline)):
        assert select_faces(outline, selector) == [number]


def test_box(bar):
    assert area(bar, Region(box=((0, 0, 0), (0, 2, 2)))) == pytest.approx(4)
    assert area(bar, Region(box=((3, 2, 2), (-1, -1, 2)))) == pytest.approx(6)  # corners in any order


def test_sphere(bar):
    chosen = select_triangles(bar, Region.model_validate({"sphere": {"centre": [4, 1, 1], "radius": 0.8}}))
    distance = np.linalg.norm(bar.surface.centroids - [4, 1, 1], axis=1)
    assert (np.isin(np.arange(len(distance)), chosen) == (distance <= 0.8)).all()
    assert len(chosen) > 4


def test_plane(bar):
    assert area(bar, Region.model_validate({"plane": {"point": [9, 9, 2], "normal": [0, 0, 3]}})) == pytest.approx(8)
    wide = {"point": [0, 0, 1.9], "normal": [0, 0, 1], "tolerance": 0.2}
    assert area(bar, Region.model_validate({"plane": wide})) == pytest.approx(8)


def test_nearest(bar, plate):
    assert area(bar, Region(nearest=(10, 1, 1))) == pytest.approx(4)
    assert area(bar, Region(nearest=(2, 1, -0.1))) == pytest.approx(8)
    assert area(plate, Region(nearest=(15, 0, 0))) == pytest.approx(2 * np.pi * 60, rel=0.01)


def test_coordinates_are_in_the_units_of_the_part(tmp_path):
    mesh = box_mesh((4, 2, 2), (0.4, 0.2, 0.2))
    np.savez(tmp_path / "p.npz", vertices=mesh.vertices, tets=mesh.tets)
    outline = read_outline(tmp_path / "p.npz")
    assert area(outline, Region(box=((0.4, 0, 0), (0.4, 0.2, 0.2)))) == pytest.approx(200 * 200)
    assert area(outline, Region.model_validate({"sphere": {"centre": [0, 0.1, 0.1], "radius": 0.2}})) >= 200 * 200
    assert area(outline, Region(nearest=(0.2, 0.1, 0.3))) == pytest.approx(400 * 200)


def test_patches_of_a_mesh_are_its_faces(bar):
    assert [face.kind for face in bar.faces] == ["PLANE"] * 6
    assert sum(face.area for face in bar.faces) == pytest.approx(40)
    assert all(select_faces(bar, selector) == [number] for number, selector in enumerate(suggest_selectors(bar)))


# --- wrong names -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("selector", "words"),
    [
        ("%CONE", ["%CONE", "matches nothing", "CYLINDER at (15, 0, 0)"]),
        (["%CYLINDER", "|X and #X"], ["matches nothing", "at the step '|X and #X'"]),
        (">Q", ["'>Q'", "not a CadQuery selector", "PLANE"]),
        ("upper left", ["not a CadQuery selector"]),
        (">Z[9]", ["'>Z[9]'", "fails"]),
        (99, ["no face 99", "0 to 7"]),
    ],
)
def test_selectors_that_fail_list_the_faces(plate, selector, words):
    with pytest.raises(InvalidInputError) as caught:
        select_triangles(plate, selector)
    for word in ["plate", "The part has 8 faces", *words]:
        assert word in str(caught.value)


def test_regions_that_match_nothing(bar):
    for region in (
        {"box": [[9, 9, 9], [10, 10, 10]]},
        {"sphere": {"centre": [9, 9, 9], "radius": 1}},
        {"plane": {"point": [9, 9, 9], "normal": [0, 0, 1]}},
    ):
        with pytest.raises(InvalidInputError, match="matches nothing") as caught:
            select_triangles(bar, Region.model_validate(region))
        assert next(iter(region)) in str(caught.value)
        assert "PLANE at" in str(caught.value)


def test_strings_need_a_cad_part(bar):
    with pytest.raises(InvalidInputError, match="mesh"):
        select_triangles(bar, ">Z")


def test_nearest_on_a_smooth_mesh_is_no_answer():
    import trimesh

    from michell_cad.domain import outline_from_triangles

    ball = trimesh.creation.icosphere(3)
    with pytest.raises(InvalidInputError, match="100 %"):
        select_triangles(outline_from_triangles(ball.vertices, ball.faces), Region(nearest=(0, 0, 1)))


@pytest.mark.parametrize(
    "region",
    [
        {"faces": 2.5},
        {"faces": []},
        {"faces": ["<X", 3]},
        {"faces": ""},
        {"faces": ">Z", "nearest": [0, 0, 0]},
        {"box": [[0, 0, 0]]},
        {"sphere": {"centre": [0, 0, 0], "radius": 0}},
        {"plane": {"point": [0, 0, 0], "normal": [0, 0, 0]}},
        {"nearest": [0, float("nan"), 0]},
        {"face": ">Z"},
    ],
)
def test_regions_that_are_none(region):
    with pytest.raises(ValidationError):
        Region.model_validate(region)


def test_a_long_list_of_faces_is_cut():
    teeth = outline_from_shape(cq.Workplane().polygon(40, 20).extrude(5))
    assert "and 18 more" in list_faces(teeth)
