"""`michell-cad edit`: from a design file to new results, the old file untouched."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from designs import small_bar

from michell_cad.cli_edit import read_knob_options
from michell_cad.delivery_edit import deliver_edit
from michell_cad.design_file import load_design, load_edits, save_design
from michell_cad.edits import change_knobs, read_script
from michell_cad.errors import InvalidInputError
from michell_cad.knobs import Knobs
from michell_cad.output_section import OutputSection

FLAT = '<svg xmlns="http://www.w3.org/2000/svg"><path d="M 0 0 L 6 0 L 6 2 L 0 2 Z"/></svg>'

SCRIPT = """
version = 1
[knobs]
entasis = 0.2
[[edit]]
do = "radius"
where = { family = "compression", not = { where = "boundary" } }
times = 1.2
[[edit]]
do = "sheet"
coordinate = "compression"
low = 3
high = 3
thickness = 0.6
[[edit]]
do = "tag"
name = "oak"
where = { family = "compression" }
"""


def run(*arguments: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "michell_cad.cli", *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("edit")
    save_design(folder / "design.npz", small_bar(), Knobs(radius=0.9))
    (folder / "edits.toml").write_text(SCRIPT)
    (folder / "short.npz").write_bytes((folder / "design.npz").read_bytes()[:2000])
    return folder


def test_knobs_and_a_script_make_new_results(folder):
    old = (folder / "design.npz").read_bytes()
    options = ("--set", "radius=0.7", "--family=tension,compression", "--every", "2", "--script", "edits.toml")
    done = run("edit", "design.npz", *options, "--out", "new", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert (folder / "design.npz").read_bytes() == old
    report = json.loads((folder / "new/report.json").read_text())
    knobs = report["knobs"]
    assert (knobs["radius"], knobs["family"], knobs["every"], knobs["entasis"]) == (
        0.7,
        ["tension", "compression"],
        2,
        0.2,
    )
    assert set(report["cpu_s"]) == {"sizing", "solid", "export", "strength"}
    assert len(report["edits"]) == 3
    assert report["sheets"][0]["volume_mm3"] > 0
    assert report["tags"]["oak"]
    names = {file.name for file in (folder / "new").iterdir()}
    assert {"truss.step", "design.npz", "edits.toml", "sheets.step"} <= names
    script = read_script(folder / "new/edits.toml")
    assert change_knobs(Knobs(), script.knobs) == Knobs.model_validate(knobs)
    assert script.edits == load_edits(folder / "new")
    little = OutputSection(formats=(), preview=False)
    deliver_edit(folder / "new", folder / "back", {"entasis": 0.3}, undo=3, output=little)
    assert len(load_edits(folder / "back/design.npz")) == 0
    assert json.loads((folder / "back/report.json").read_text())["knobs"]["radius"] == 0.7


def test_a_profile_from_a_file_is_kept_with_the_design(folder):
    (folder / "flat.svg").write_text(FLAT)
    (folder / "flat.toml").write_text("version = 1\n[knobs]\nprofile = 'flat.svg'\nnode_form = 'hull'\n")
    formats = OutputSection(formats=("stl", "step"), preview=True)
    report = deliver_edit(folder / "design.npz", folder / "flat", {"every": 3}, folder / "flat.toml", output=formats)
    assert (report["solid"]["profile"], report["solid"]["node_form"]) == ("own", "hull")
    assert report["solid"]["step_forms"] == ["assembly"]
    assert report["summary"]["mass_g"] > 0
    assert any("no common CAD solid" in note for note in report["notes"])
    (folder / "flat.svg").unlink()
    corners = load_design(folder / "flat/design.npz")[1].profile
    assert sorted(corners) == [(0.0, -2.0), (0.0, 0.0), (6.0, -2.0), (6.0, 0.0)]
    shutil.rmtree(folder / "flat")


def test_a_volume_is_met_with_another_profile(folder):
    little = OutputSection(formats=(), preview=False)
    changes = {"profile": "square", "volume_fraction": 0.05, "every": 3}
    report = deliver_edit(folder / "design.npz", folder / "squares", changes, output=little)
    assert report["summary"]["volume_fraction"] == pytest.approx(0.05, rel=0.01)
    shutil.rmtree(folder / "squares")


def test_one_step_solid_of_another_profile_is_refused(folder):
    with pytest.raises(InvalidInputError, match="take the form 'assembly'"):
        deliver_edit(
            folder / "design.npz", folder / "failed", {"profile": "square"}, output=OutputSection(step_form="solid")
        )
    assert not (folder / "failed").exists()


@pytest.mark.parametrize(
    ("design", "options", "message"),
    [
        ("none.npz", {}, "no design file"),
        ("design.npz", {"changes": {"radius": "thick"}}, "radius: expected a number, found 'thick'"),
        ("design.npz", {"changes": {"every": 400, "offset": 100}}, "no curve is left"),
        ("design.npz", {"undo": 2}, "cannot undo 2 edits: there are 0"),
        ("design.npz", {"script": "none.toml"}, "cannot be read"),
        ("short.npz", {}, "not a complete design file"),
        ("design.npz", {"changes": {"family": "steel"}}, "family: expected 'all' or 'tension', .* found 'steel'"),
        ("design.npz", {"changes": {"profile": "none.dxf"}}, r"none\.dxf: there is no such file"),
        (
            "design.npz",
            {"changes": {"profile": [[0, 0], [1, 1], [1, 0], [0, 1]]}},
            "knobs: profile: the profile crosses",
        ),
    ],
)
def test_mistakes_are_one_message_and_leave_nothing(folder, design, options, message):
    with pytest.raises(InvalidInputError, match=message):
        deliver_edit(folder / design, folder / "failed", **options)
    assert not (folder / "failed").exists()


@pytest.mark.parametrize(
    ("script", "message"),
    [
        ('[[edit]]\nwhere = { family = "tension" }', "`do` is missing"),
        ('[[edit]]\ndo = "remvoe"', "unknown edit; did you mean remove"),
        ('[[edit]]\ndo = "radius"\nto = -1', r"1 \(radius\): to: expected greater than 0, found -1"),
        ('[[edit]]\ndo = "radius"\nfor = 1', r"1 \(radius\): for: unknown key"),
        ('[[edit]]\ndo = "tag"', r"1 \(tag\): name: is missing"),
        ('[[edit]]\ndo = "radius"\nwhere = { family = "steel" }\ntimes = 2', "family 'steel' does not exist"),
        ('[[edit]]\ndo = "attach"\npart = "no.step"\nspacing = 5', "there is no file .*no.step"),
        ("version = 9", "this program reads up to 1"),
        ('[[edit]]\ndo = "remove"', "leaves nothing"),
        ('[[edit]]\ndo = "thin"\nevery = 500\noffset = 250', "keeps none of the"),
    ],
)
def test_a_bad_script_is_one_message_and_leaves_nothing(folder, script, message):
    old = (folder / "design.npz").read_bytes()
    (folder / "bad.toml").write_text(script)
    with pytest.raises(InvalidInputError, match=message) as caught:
        deliver_edit(folder / "design.npz", folder / "failed", script=folder / "bad.toml")
    assert len(str(caught.value).splitlines()) == 1
    assert not (folder / "failed").exists()
    assert (folder / "design.npz").read_bytes() == old


def test_the_command_says_what_is_wrong_and_leaves_nothing(folder):
    done = run("edit", "design.npz", "--radiu", "1", "--out", "failed", cwd=folder)
    assert done.returncode == 2
    assert "did you mean radius" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (folder / "failed").exists()


def test_the_folder_of_the_design_itself_is_refused(folder):
    with pytest.raises(InvalidInputError, match="stays as it is"):
        deliver_edit(folder / "design.npz", folder, force=True)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [(["x"], "unexpected 'x'"), (["--radius"], "--radius needs a value"), (["--widht=3"], "unknown option or knob")],
)
def test_bad_options_are_refused(arguments, message):
    with pytest.raises(InvalidInputError, match=message):
        read_knob_options(arguments, [])
    with pytest.raises(InvalidInputError, match="name=value"):
        read_knob_options([], ["radius"])


def test_options_are_the_knobs_of_the_schema(folder):
    arguments = [text for name in Knobs.model_fields for text in (f"--{name.replace('_', '-')}", "1")]
    assert set(read_knob_options(arguments, [])) == set(Knobs.model_fields)
    assert read_knob_options(["--profile", "[[0, 0], [2, 0], [0, 1]]"], []) == {"profile": [[0, 0], [2, 0], [0, 1]]}
    assert read_knob_options(["--every", "2,1,1"], ["family=third"]) == {"family": "third", "every": (2, 1, 1)}
    shown = run("knobs", cwd=folder).stdout
    for name in Knobs.model_fields:
        assert name in shown
