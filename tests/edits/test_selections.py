import numpy as np
import pytest
import trimesh
from designs import small_bar

from michell_cad.edits import Box, Every, Everything, Family, InSolid, Label, Length, Near, Where, selection_from
from michell_cad.errors import InvalidInputError
from michell_cad.truss import CurveKind

TRUSS = small_bar().truss


def middles() -> np.ndarray:
    return TRUSS.nodes[TRUSS.members].mean(1)


def test_families_divide_curves_and_members():
    parts = [Family(name) for name in ("tension", "compression", "third", "feature")]
    for ask in ("curves", "members"):
        assert np.sum([getattr(part, ask)(TRUSS) for part in parts], axis=0).tolist() == [1] * len(
            getattr(Everything(), ask)(TRUSS)
        )


def test_a_family_takes_its_boundary_curves_along_unless_told_otherwise():
    with_surface, without = Family("tension").curves(TRUSS), Family("tension", surface=False).curves(TRUSS)
    kinds = np.array([str(curve.kind) for curve in TRUSS.curves])
    assert set(kinds[with_surface]) == {"interior", "boundary"}
    assert set(kinds[without]) == {"interior"}


def test_a_label_range_selects_a_layer():
    layer = Label(0, 3, 3).curves(TRUSS)
    assert layer.any()
    assert {c.isovalues[0] for c, mine in zip(TRUSS.curves, layer, strict=True) if mine} == {3}
    axis = next(c.axis for c in TRUSS.curves if c.family == "compression")
    by_family, by_axis = Label("compression", 2, 3).curves(TRUSS), Label(axis, 2, 3).curves(TRUSS)
    np.testing.assert_array_equal(by_family, by_axis)


def test_every_second_label():
    for curve, mine in zip(TRUSS.curves, Every(2, 1).curves(TRUSS), strict=True):
        values = [v for v in curve.isovalues if v is not None]
        assert mine == (bool(values) and all(v % 2 == 1 for v in values))


def test_regions_go_by_the_middles_of_members():
    x = middles()
    np.testing.assert_array_equal(Box((0, 0, 0), (40, 40, 40)).members(TRUSS), x[:, 0] <= 40)
    near = Near((80, 20, 20), 15).members(TRUSS)
    np.testing.assert_array_equal(near, np.linalg.norm(x - [80, 20, 20], axis=1) <= 15)
    curves = Near((80, 20, 20), 15).curves(TRUSS)
    assert [near[c.members].any() for c in TRUSS.curves] == curves.tolist()


def test_inside_a_solid(tmp_path):
    trimesh.creation.box(bounds=[(-1, -1, -1), (30, 41, 41)]).export(tmp_path / "block.stl")
    selection = InSolid(str(tmp_path / "block.stl"))
    np.testing.assert_array_equal(selection.members(TRUSS), middles()[:, 0] < 30)


def test_lengths_and_places():
    long = Length(60).curves(TRUSS)
    assert [TRUSS.lengths[c.members].sum() >= 60 for c in TRUSS.curves] == long.tolist()
    inside = Where("inside").curves(TRUSS)
    assert [c.kind is CurveKind.INTERIOR for c in TRUSS.curves] == inside.tolist()
    np.testing.assert_array_equal(Where("boundary").curves(TRUSS), ~inside)


def test_and_or_not_combine_curves_and_members_alike():
    a, b = Family("tension"), Box((0, 0, 0), (40, 40, 40))
    for ask in ("curves", "members"):
        one, other = getattr(a, ask)(TRUSS), getattr(b, ask)(TRUSS)
        np.testing.assert_array_equal(getattr(a & b, ask)(TRUSS), one & other)
        np.testing.assert_array_equal(getattr(a | b, ask)(TRUSS), one | other)
        np.testing.assert_array_equal(getattr(~a, ask)(TRUSS), ~one)


@pytest.mark.parametrize(
    "selection",
    [
        Everything(),
        Family(("tension", "third"), surface=False),
        Label("third", 2, 4),
        Every(3, 1),
        Length(10, 20),
        Length(10),
        Where("inside"),
        Box((0, 0, 0), (1, 2, 3)),
        Near((1, 2, 3), 4),
        InSolid("block.stl"),
        (Family("tension") | Every(2)) & ~Where("inside"),
    ],
)
def test_the_plain_form_comes_back(selection):
    assert selection_from(selection.plain()) == selection


def test_a_table_reads_like_a_sentence():
    table = {"family": "compression", "length": [20, 80], "not": {"near": [0, 0, 40], "within": 5}}
    expected = Family("compression") & Length(20, 80)
    expected = expected & ~Near((0, 0, 40), 5)
    np.testing.assert_array_equal(selection_from(table).curves(TRUSS), expected.curves(TRUSS))


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"familly": "tension"}, "did you mean family"),
        ({"family": "tensoin"}, "did you mean 'tension'"),
        ({"near": [0, 0, 0]}, "near needs within"),
        ({"within": 3}, "within goes with near"),
        ({"label": [4, 2], "coordinate": 0}, "must ascend"),
        ({"label": [2, 4], "coordinate": 3}, "coordinate must be"),
        ({"box": [[0, 0], [1, 1]]}, "three numbers"),
        ({"every": 0}, "at least 1"),
        ({"where": "outside"}, "must be one of"),
        ({"length": "long"}, r"length takes \[from\] or \[from, to\], found 'long'"),
        ({"length": []}, "length takes"),
        ({"length": ["a", "b"]}, "length must be a number, found 'a'"),
        ({"label": ["a", "b"], "coordinate": 0}, "label must be whole, found 'a'"),
        ({"label": [1.5, 2.5], "coordinate": 0}, "must be whole, found 1.5"),
        ({"label": [1, 2], "coordinate": True}, "coordinate must be whole, found True"),
        ({"every": 2.5}, "every must be whole, found 2.5"),
        ({"every": 2, "offset": "1"}, "offset must be whole, found '1'"),
        ({"family": "tension", "surface": "no"}, "surface must be true or false, found 'no'"),
        ({"family": 3}, "family must be a text, found 3"),
        ({"near": [0, 0, 0], "within": "far"}, "within must be a number, found 'far'"),
        ({"solid": 5}, "solid must be a text, found 5"),
        ({"any": []}, "any takes a list of tables, at least one"),
        ({"all": {"family": "tension"}}, "all takes a list of tables"),
    ],
)
def test_bad_selections_say_what_is_wrong(table, message):
    with pytest.raises(InvalidInputError, match=message):
        selection_from(table)
