import dataclasses
import json

import numpy as np
import pytest
from designs import small_bar

import michell_cad.pipeline as pipeline
from michell_cad.design_file import load_edits, load_saved, open_structure, save_design
from michell_cad.edits import (
    AddSheet,
    AddStrut,
    Attach,
    EditList,
    Entasis,
    Every,
    Family,
    InSolid,
    Join,
    Near,
    Radius,
    Remove,
    RemoveOpenEnds,
    Snap,
    Tag,
    Thin,
    Where,
    change_knobs,
    read_script,
    size_structure,
    write_script,
)
from michell_cad.errors import InvalidInputError
from michell_cad.knobs import Knobs

BAR = small_bar()

EVERY_KIND = EditList(
    (
        Snap(points=((41.3, 17.2, 22.9),)),
        Thin(where=Family("third") & ~Near((0, 0, 0), 5.5), every=2, offset=1),
        Remove(where=Every(3) | Where("boundary"), prune=False),
        RemoveOpenEnds(),
        AddStrut(between=((1.0, 2.0, 3.0), (4.0, 5.0, 6.0)), reach=2.0),
        Radius(where=Family(("tension", "third"), surface=False), to=1.5, over="stress", values=(0.5, 1.0, 2.0)),
        Entasis(to=0.3),
        Tag(name='ply "A", 3 mm', where=Near((1, 2, 3), 4)),
        AddSheet(coordinate="third", low=2, high=4, thickness=0.5),
    )
)


def test_a_script_comes_back_as_it_was_written(tmp_path):
    for name in ("edits.toml", "edits.json"):
        write_script(tmp_path / name, EVERY_KIND, {"radius": 1.2, "family": ["tension"]})
        script = read_script(tmp_path / name)
        assert script.edits.edits == EVERY_KIND.edits
        assert script.knobs == {"radius": 1.2, "family": ["tension"]}


def test_paths_in_a_script_are_relative_to_it(tmp_path):
    (tmp_path / "edits.toml").write_text(
        'version = 1\n[[edit]]\ndo = "remove"\nwhere = { not = { solid = "keep.stl" } }\n'
        '[[edit]]\ndo = "join"\ndesign = "other/design.npz"\n'
        '[[edit]]\ndo = "attach"\npart = "lamp.step"\nspacing = 5.0\n'
    )
    removed, joined, attached = read_script(tmp_path / "edits.toml").edits.edits
    assert isinstance(removed, Remove)
    assert removed.where == ~InSolid(str(tmp_path / "keep.stl"))
    assert isinstance(joined, Join)
    assert joined.design == str(tmp_path / "other/design.npz")
    assert isinstance(attached, Attach)
    assert attached.part == str(tmp_path / "lamp.step")


def test_paths_are_saved_whole(tmp_path, monkeypatch):
    """What was written in one folder is read in another one, and from other places."""
    (tmp_path / "job").mkdir()
    (tmp_path / "job/edits.toml").write_text('[[edit]]\ndo = "attach"\npart = "lamp.step"\nspacing = 5.0\n')
    monkeypatch.chdir(tmp_path)
    from_script = read_script("job/edits.toml").edits
    by_hand = EditList((Attach(part="job/lamp.step", spacing=5.0),))
    for edits in (from_script, by_hand):
        write_script("edits.toml", edits)
        save_design("d.npz", BAR, Knobs(), edits)
        monkeypatch.chdir(tmp_path / "job")
        for back in (read_script("../edits.toml").edits, load_edits("../d.npz")):
            (attach,) = back.edits
            assert isinstance(attach, Attach)
            assert attach.part == str(tmp_path / "job/lamp.step")
        monkeypatch.chdir(tmp_path)


def test_the_list_is_saved_with_the_design_and_replays_to_the_same(tmp_path, monkeypatch):
    edits = EditList((Remove(where=Where("boundary")), Entasis(to=0.2), Radius(where=Family("tension"), times=1.2)))
    save_design(tmp_path / "d.npz", BAR, Knobs(every=2), edits, up=1)
    assert load_edits(tmp_path / "d.npz") == edits
    assert load_saved(tmp_path / "d.npz").up == 1
    for stage in ("solve_elasticity", "fit_frame_field", "parametrize", "trace_isocurves", "clean_network"):
        monkeypatch.delattr(pipeline, stage)
    opened, made = open_structure(tmp_path / "d.npz"), edits.replay(BAR, Knobs(every=2))
    np.testing.assert_array_equal(opened.truss.nodes, made.truss.nodes)
    np.testing.assert_array_equal(opened.truss.members, made.truss.members)
    np.testing.assert_array_equal(size_structure(opened).radii, size_structure(made).radii)


def test_undo_and_reorder():
    one, two, three = Entasis(to=0.1), Entasis(to=0.2), RemoveOpenEnds()
    edits = EditList((one, two)).then(three)
    assert edits.undone(2).edits == (one,)
    assert edits.undone(0) == edits
    assert edits.moved(2, 0).edits == (three, one, two)
    assert edits.moved(0, 1).edits == (two, one, three)
    last = size_structure(edits.replay(BAR, Knobs())).radii.max()
    first = size_structure(edits.moved(0, 1).replay(BAR, Knobs())).radii.max()
    assert first < last
    for wrong in (lambda: edits.undone(4), lambda: edits.moved(3, 0), lambda: edits.moved(0, 3)):
        with pytest.raises(InvalidInputError):
            wrong()


def test_the_folder_of_results_stands_for_its_design_file(tmp_path):
    (tmp_path / "made").mkdir()
    save_design(tmp_path / "made/design.npz", BAR, Knobs(every=2))
    assert load_saved(tmp_path / "made").knobs == Knobs(every=2)


def test_a_design_file_of_before_edits_has_none(tmp_path):
    save_design(tmp_path / "d.npz", BAR, Knobs())
    with np.load(tmp_path / "d.npz") as file:
        arrays = dict(file)
    meta = json.loads(str(arrays.pop("meta")))
    del meta["edits"], meta["up"]
    np.savez(tmp_path / "old.npz", meta=np.array(json.dumps(meta | {"version": 1})), **arrays)
    assert load_edits(tmp_path / "old.npz") == EditList()
    assert load_saved(tmp_path / "old.npz").up == 2
    assert len(open_structure(tmp_path / "old.npz").truss.members) == len(BAR.truss.members)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("version = 9", "version 9, this program reads up to 1: install a newer"),
        ("version = '1'", "version = '1' is none of an edit script; write version = 1"),
        ("version = -3", "version = -3 is none"),
        ("knobs = [1]", r"\[knobs\] is a table such as radius = 1.2, found \[1\]"),
        ("nonsense", "not valid TOML"),
        ("[edit]\ndo = 'remove'", r"write \[\[edit\]\], with two brackets"),
        ("edits = 3", "unknown key edits"),
        ("[[edit]]\ndo = 'explode'", r"\[\[edit\]\] 1: .*'explode'"),
        ("[[edit]]\ndo = 'radius'", "say how thick"),
        ("[[edit]]\ndo = 'radius'\nto = -1.0", "greater than 0"),
        ("[[edit]]\ndo = 'radius'\nto = 1.0\ntimes = 2.0", "not both"),
        ("[[edit]]\ndo = 'radius'\nover = 'depth'\nvalues = [1.0]", "at least two values"),
        ("[[edit]]\ndo = 'entasis'\nto = 0.1\nwhere = { famly = 'third' }", "did you mean family"),
        ("[[edit]]\ndo = 'sheet'\ncoordinate = 0\nlow = 4\nhigh = 2\nthickness = 1.0", "low must not exceed high"),
    ],
)
def test_bad_scripts_say_what_is_wrong(tmp_path, text, message):
    (tmp_path / "edits.toml").write_text(text)
    with pytest.raises(InvalidInputError, match=message) as caught:
        read_script(tmp_path / "edits.toml")
    assert "edits.toml" in str(caught.value)


def test_a_script_that_is_not_there(tmp_path):
    with pytest.raises(InvalidInputError, match="cannot be read"):
        read_script(tmp_path / "none.toml")


def test_changing_knobs():
    assert change_knobs(Knobs(radius=1.0), {"mass": 20.0}) == Knobs(mass=20.0)
    assert change_knobs(Knobs(radius=1.0), {"entasis": 0.2}) == Knobs(radius=1.0, entasis=0.2)
    with pytest.raises(InvalidInputError, match="entasis"):
        change_knobs(Knobs(), {"entasis": 9})
    with pytest.raises(InvalidInputError, match="found radius and mass"):
        change_knobs(Knobs(), {"radius": 1.0, "mass": 2.0})


def test_edits_are_frozen():
    with pytest.raises(dataclasses.FrozenInstanceError):
        EVERY_KIND.edits = ()  # pyright: ignore[reportAttributeAccessIssue]
    with pytest.raises(ValueError, match="frozen"):
        EVERY_KIND.edits[-1].low = 3.0  # pyright: ignore[reportAttributeAccessIssue]
