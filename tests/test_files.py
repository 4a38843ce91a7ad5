"""Files that are whole or not there."""

import os

import pytest

from michell_cad.errors import InvalidInputError
from michell_cad.files import path_with_suffix, writing, writing_files, writing_folder


def refuse(path) -> None:
    """Act as a disk that is full: some of the file is there, then the system says no."""
    path.write_text("half")
    raise OSError(28, "No space left on device")


def test_a_full_disk_leaves_the_old_file(tmp_path) -> None:
    path = tmp_path / "truss.glb"
    path.write_text("old")
    with pytest.raises(InvalidInputError, match=r"truss\.glb cannot be written \(No space left on device\)"):
        with writing(path) as partial:
            refuse(partial)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_whole_file_has_the_usual_permissions(tmp_path) -> None:
    with writing(tmp_path / "truss.glb") as partial:
        partial.write_text("new")
    (tmp_path / "plain").write_text("")
    assert (tmp_path / "truss.glb").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_a_full_disk_leaves_no_folder(tmp_path) -> None:
    with pytest.raises(InvalidInputError, match=r"results\S* cannot be written \(No space left"):
        with writing_folder(tmp_path / "results") as partial:
            refuse(partial / "truss.step")
    assert not list(tmp_path.iterdir())


def test_messages_name_the_folder_of_the_user(tmp_path) -> None:
    with pytest.raises(InvalidInputError, match=r"/results/truss\.glb cannot be written"):
        with writing_folder(tmp_path / "results") as folder, writing(folder / "truss.glb") as partial:
            refuse(partial)


def test_a_folder_keeps_what_else_is_in_it(tmp_path) -> None:
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "mine").write_text("mine")
    with writing_folder(tmp_path / "results") as partial:
        (partial / "truss.step").write_text("new")
    assert {file.name for file in (tmp_path / "results").iterdir()} == {"mine", "truss.step"}


def test_several_files_come_all_or_none(tmp_path) -> None:
    paths = [tmp_path / "a.stl", tmp_path / "b.beams.3mf"]

    def write_one_and_a_half() -> None:
        with writing_files(paths) as partials:
            partials[0].write_text("whole")
            with writing(partials[1]) as partial:
                refuse(partial)

    with pytest.raises(InvalidInputError, match=r"/b\.beams\.3mf cannot be written \(No space"):
        write_one_and_a_half()
    assert not list(tmp_path.iterdir())
    with writing_files(paths) as partials:
        assert [partial.name for partial in partials] == [path.name for path in paths]
        for partial in partials:
            partial.write_text(partial.name)
    assert [path.read_text() for path in paths] == ["a.stl", "b.beams.3mf"]
    assert set(tmp_path.iterdir()) == set(paths)


def test_places_that_cannot_be_written(tmp_path) -> None:
    places = [tmp_path / "no" / "a.stl", *([] if os.geteuid() else [tmp_path.__class__("/proc/a.stl")])]
    for path in places:
        with pytest.raises(InvalidInputError, match=r"a\.stl cannot be written"), writing(path):
            pass
        with pytest.raises(InvalidInputError, match=r"a\.stl cannot be written"), writing_files([path]):
            pass
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidInputError, match="cannot be written"), writing_folder(tmp_path / "file" / "results"):
        pass


def test_suffixes() -> None:
    assert path_with_suffix("A.STP", ".step", ".stp").name == "A.STP"
    with pytest.raises(InvalidInputError, match=r"ends in \.step or \.stp, found \.stl"):
        path_with_suffix("a.stl", ".step", ".stp")
    with pytest.raises(InvalidInputError, match="found none"):
        path_with_suffix("a", ".stl")
