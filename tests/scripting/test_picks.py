"""What scripts write about supports and loads means what a job file would."""

import build123d as bd
import cadquery as cq
import pytest

from michell_cad.domain.cad_part import outline_from_shape
from michell_cad.errors import InvalidInputError
from michell_cad.scripting.picks import make_setup, pick_faces


@pytest.fixture(scope="module")
def box() -> cq.Workplane:
    return cq.Workplane().box(8, 4, 2)


@pytest.fixture(scope="module")
def outline(box):
    return outline_from_shape(box, "box")


def test_faces_of_both_programs_are_the_numbers_of_the_part(box, outline):
    left, right = (pick_faces(outline, box.faces(selector)) for selector in ("<X", ">X"))
    assert [outline.faces[n].centre[0] for n in (*left, *right)] == [-4.0, 4.0]
    assert pick_faces(outline, box.faces("|Z").vals()) == [n for n in range(6) if abs(outline.faces[n].centre[2]) == 1]
    other = bd.Box(8, 4, 2)
    theirs = outline_from_shape(other, "box")
    (number,) = pick_faces(theirs, other.faces().sort_by(bd.Axis.Z)[-1])
    assert theirs.faces[number].direction == (0, 0, 1)
    assert len(pick_faces(theirs, other.faces().filter_by(bd.Axis.X))) == 2


def test_selectors_and_numbers_stay_what_they_are(outline):
    assert [pick_faces(outline, place) for place in ("<X", ("%PLANE", "<Z"), 3, [1, 2])] == [
        "<X",
        ("%PLANE", "<Z"),
        3,
        [1, 2],
    ]


def test_lists_are_several_and_tuples_are_one(box, outline):
    setup = make_setup(
        outline,
        ["<X", ("%PLANE", "<Z"), {"faces": box.faces(">Y"), "axes": "y"}],
        [(">X", (1, 2, 3)), {"faces": box.faces(">Z"), "pressure": 0.5}],
        material="PLA",
        spacing=1.5,
        mesh_size=0.5,
        job={"options": {"layers": "hug"}, "knobs": {"entasis": 0.2}},
    )
    assert [support.faces for support in setup.support[:2]] == ["<X", ("%PLANE", "<Z")]
    assert setup.support[2].axes == "y"
    assert setup.load[0].force == (1.0, 2.0, 3.0)
    assert (setup.load[1].faces, setup.load[1].pressure) == (tuple(pick_faces(outline, box.faces(">Z"))), 0.5)
    assert (setup.material.name, setup.mesh.size) == ("PLA", 0.5)
    assert (setup.options.layers, setup.options.spacing, setup.knobs.entasis) == ("hug", 1.5, 0.2)


@pytest.mark.parametrize(
    ("supports", "loads", "text"),
    [
        (bd.Box(1, 1, 1).faces()[0], (">X", (0, 0, 1)), "no face of this part: pick faces of the very object"),
        (3.5, (">X", (0, 0, 1)), "expected a selector, face numbers or faces"),
        ("<X", ">X", "a load is a place with its force"),
        ("<X", (">X", (0, 1)), "too few"),
        ({"faces": "<X", "axis": "x"}, (">X", (0, 0, 1)), "did you mean axes"),
    ],
)
def test_what_is_wrong_is_said(outline, supports, loads, text):
    with pytest.raises(InvalidInputError, match=text):
        make_setup(outline, supports, loads)
