"""What the workbench does without FreeCAD: asking a worker, job files, properties from the schema, messages."""

import json
import sys
import tomllib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from michell_workbench import client, interpreter, messages
from michell_workbench.bodies import FacesGone, find_faces
from michell_workbench.client import Worker, WorkerError
from michell_workbench.job import Face, Load, Setup, Support, from_json, job_text, to_json, write_job
from michell_workbench.knob_properties import knobs_of, properties_of, rivals, values_of

from michell_cad.job import parse_job
from michell_cad.knobs import SIZES, Knobs
from michell_cad.worker import PROTOCOL

SCHEMA = Knobs.model_json_schema()["properties"]

FAKE = """
import json, sys, time, os
for line in sys.stdin:
    r = json.loads(line)
    say = lambda **v: print(json.dumps({"id": r["id"], **v}), flush=True)
    if r["do"] == "hello":
        say(event="done", result={"materials": ["ABS"]})
    elif r["do"] == "work":
        say(event="progress", stage="half", fraction=0.5)
        say(event="done", result={"got": r["x"]})
    elif r["do"] == "fail":
        say(event="error", kind="input", message="the part is no part")
    elif r["do"] == "die":
        sys.stderr.write("segmentation fault, say"); sys.stderr.flush(); os._exit(7)
    elif r["do"] == "hang":
        time.sleep(60)
"""


@pytest.fixture
def worker():
    made = Worker([sys.executable, "-c", FAKE])
    yield made
    made.close()


def face(name: str, x: float, area: float = 4.0) -> Face:
    return Face(name, "Part::GeomPlane", area, (x, 0.0, 0.0))


def whole_setup() -> Setup:
    loads = (
        Load((face("Face2", 8.0),), "force", (0.0, 1.5, -2.0)),
        Load((face("Face3", 4.0),), "pressure", value=0.2, case="wind"),
        Load((face("Face3", 4.0),), "torque", (0.0, 0.0, 1.0), 30.0),
        Load((), "self_weight", (0.0, 0.0, -1.0)),
    )
    kinds = ("Part::GeomPlane",) * 3
    return Setup((Support((face("Face1", 0.0),), "xz"),), loads, kinds, "PLA", 12.0, 0.0, 2.5)


def test_an_answer_comes_with_its_progress(worker):
    seen = []
    assert worker.ask("work", {"x": 3}, lambda *step: seen.append(step)) == {"got": 3}
    assert seen == [("half", 0.5)]
    assert worker.hello() == {"materials": ["ABS"]}


def test_an_error_keeps_the_worker(worker):
    with pytest.raises(WorkerError, match="the part is no part") as info:
        worker.ask("fail", {})
    assert info.value.kind == "input"
    process = worker._process
    assert worker.ask("work", {"x": 1}) == {"got": 1}
    assert worker._process is process


def test_a_worker_that_dies_is_told_and_started_again(worker):
    with pytest.raises(
        WorkerError, match=r"exit code 7[\s\S]*document was changed[\s\S]*segmentation fault, say"
    ) as info:
        worker.ask("die", {})
    assert info.value.kind == "died"
    assert worker.ask("work", {"x": 2}) == {"got": 2}


def test_a_worker_that_does_not_answer_a_cancel_is_killed(worker, monkeypatch):
    monkeypatch.setattr(client, "GRACE", 0.2)
    with pytest.raises(WorkerError) as info:
        worker.ask("hang", {}, wanted=lambda: False)
    assert info.value.kind == "cancelled"
    assert worker._process is None


def test_only_one_asks_at_a_time(worker):
    def ask_again(stage: str, fraction: float) -> None:
        worker.ask("work", {"x": 2})

    with pytest.raises(WorkerError, match="still computing"):
        worker.ask("work", {"x": 1}, ask_again)


@pytest.mark.parametrize("command", [["/no/such/python", "-m", "x"], [sys.executable, "-m", "no_such_module"]])
def test_no_michell_cad_says_how_to_install(command):
    with pytest.raises(WorkerError, match=r"pip install") as info:
        Worker(command).hello()
    assert info.value.kind == "missing"
    assert command[0] in str(info.value)


def test_both_ends_speak_one_protocol():
    assert client.PROTOCOL == PROTOCOL


def test_which_python(tmp_path):
    record = tmp_path / "installed.json"
    record.write_text(json.dumps({"python": "/recorded/python"}))
    find, none = interpreter.find_python, tmp_path / "none"
    assert find("/chosen/python", {interpreter.VARIABLE: "/named"}, record) == "/chosen/python"
    assert find("", {interpreter.VARIABLE: "/named"}, record) == "/named"
    assert find("", {}, record) == "/recorded/python"
    assert find("", {"PATH": str(tmp_path)}, none) == "python3"
    kept = interpreter.worker_environment({"PYTHONHOME": "/freecad", "LD_LIBRARY_PATH": "/freecad/lib", "HOME": "/h"})
    assert kept == {"HOME": "/h"}


def test_the_setup_goes_to_text_and_back():
    setup = whole_setup()
    assert from_json(to_json(setup)) == setup
    assert from_json("") == Setup()


def test_a_document_of_a_newer_add_in_is_refused_in_plain_words():
    text = json.dumps(json.loads(to_json(whole_setup())) | {"version": 2, "gravity": 9.8})
    with pytest.raises(ValueError, match=r"newer add-in \(version 2; this one reads up to 1\).*plugin install freecad"):
        from_json(text)
    unversioned = json.loads(to_json(whole_setup()))
    del unversioned["version"]
    assert from_json(json.dumps(unversioned)) == whole_setup()


def test_the_job_file_is_one_that_the_package_reads():
    knobs = {"family": ["tension", "third"], "radius": None, "mass": 12.0, "every": [1, 2, 2]}
    job = parse_job(tomllib.loads(job_text(whole_setup(), "x-part.brep", knobs)))
    assert job.part.file == "x-part.brep"
    assert (job.material.name, job.mesh.size, job.options.resolution) == ("PLA", 2.5, 12.0)
    assert (job.support[0].faces, job.support[0].axes) == ((0,), "xz")
    assert [load.faces for load in job.load] == [(1,), (2,), (2,), None]
    assert job.load[0].force == (0.0, 1.5, -2.0)
    assert (job.load[1].pressure, job.load[1].case) == (0.2, "wind")
    assert job.load[2].torque is not None
    assert job.load[2].torque.moment == 30.0
    assert job.load[3].self_weight == (0.0, 0.0, -1.0)
    assert job.knobs == Knobs(family=("tension", "third"), mass=12.0, every=(1, 2, 2))
    spaced = parse_job(tomllib.loads(job_text(replace(whole_setup(), spacing=3.0), "x.brep", {})))
    assert (spaced.options.spacing, spaced.options.resolution) == (3.0, None)


def test_a_job_is_written_with_its_part_or_not_at_all(tmp_path):
    path = tmp_path / "lug.toml"
    write_job(path, whole_setup(), {}, lambda file: file.write_text("a body"))
    assert {file.name for file in tmp_path.iterdir()} == {"lug.toml", "lug-part.brep"}
    empty = tmp_path / "empty"
    empty.mkdir()

    def fail(file: Path) -> None:
        file.write_text("half a b")
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        write_job(empty / "lug.toml", whole_setup(), {}, fail)
    with pytest.raises(ValueError, match="a support, a load"):
        write_job(empty / "lug.toml", Setup(), {}, fail)
    assert list(empty.iterdir()) == []


@pytest.mark.parametrize(
    "knobs",
    [
        Knobs(),
        Knobs(radius=1.2, entasis=-0.25, smallest_radius=0.4),
        Knobs(family=("tension", "compression"), every=(1, 3, 2), offset=(0, 2, 0)),
        Knobs(family="third", every=4, offset=1, volume_fraction=0.1),
        Knobs(profile="hexagon", profile_aspect=2.0, node_form="hull"),
    ],
)
def test_knobs_go_through_the_properties_and_back(knobs):
    properties = properties_of(SCHEMA)
    values = values_of(properties, knobs.model_dump(mode="json"))
    assert set(values) == {p.name for p in properties}
    assert Knobs.model_validate(knobs_of(properties, values.__getitem__)) == knobs
    for p in properties:
        assert p.bounds is None or p.bounds[0] <= values[p.name] <= p.bounds[1]
        assert not p.choices or values[p.name] in p.choices


def test_an_outline_of_ones_own_stays_as_designed():
    properties = properties_of(SCHEMA)
    own = Knobs(profile=((0, 0), (3, 0), (0, 2)))
    values = values_of(properties, own.model_dump(mode="json"))
    assert values["Profile"] == "as designed"
    assert "profile" not in knobs_of(properties, values.__getitem__)
    assert knobs_of(properties, (values | {"Profile": "square"}).__getitem__)["profile"] == "square"


def test_a_size_has_the_other_sizes_as_rivals():
    properties = properties_of(SCHEMA)
    assert [p.name for p in rivals(properties, list(SIZES), "Mass")] == ["Radius", "VolumeFraction"]
    assert rivals(properties, list(SIZES), "Entasis") == []
    assert rivals(properties, list(SIZES), "Placement") == []


class Shape:
    """As much of a FreeCAD shape as picks need: plane faces by their positions along x."""

    def __init__(self, *places: tuple[float, float], kind: str = "Part::GeomPlane") -> None:
        self.Faces = [
            SimpleNamespace(
                Surface=SimpleNamespace(TypeId=kind), Area=area, CenterOfMass=SimpleNamespace(x=x, y=0.0, z=0.0)
            )
            for x, area in places
        ]
        self.BoundBox = SimpleNamespace(DiagonalLength=10.0)


def test_picks_follow_new_dimensions_and_new_numbers_and_say_when_they_are_gone():
    setup = whole_setup()
    longer = find_faces(Shape((0, 4), (9, 4), (4, 4)), setup, "Lug")
    assert longer.loads[0].faces[0].centre == (9, 0.0, 0.0)
    renumbered = find_faces(Shape((5, 1), (4, 4), (8, 4), (0, 4)), setup, "Lug")
    assert renumbered.supports[0].faces[0].name == "Face4"
    assert renumbered.loads[0].faces[0].number == 2
    assert len(renumbered.surfaces) == 4
    with pytest.raises(FacesGone, match=r"Lug has been edited[\s\S]*Face2 \(load 1\)[\s\S]*pick the faces again"):
        find_faces(Shape((0, 4), (4, 4), (7, 4), (1, 1)), setup, "Lug")


def test_every_message_says_what_to_do():
    texts = {
        "Install it once": messages.not_installed("/usr/bin/python3", "No module named michell_cad"),
        "Try again": messages.worker_died(-9),
        "pick the faces again": messages.faces_gone("Lug", ["Face3 (load 1)"]),
        "compute again": messages.body_changed("Lug"),
        "make a new": messages.body_gone(),
        "Double click": messages.no_design(),
        "install a newer": messages.newer_document(2, 1),
        "Save it": messages.unsaved_document("Unnamed"),
        "Select one or more faces": messages.nothing_picked("supports"),
        "Pick faces of A": messages.two_bodies("A", "B"),
        "give: a support": messages.incomplete(["a support"]),
        "Unite them": messages.not_a_solid("Lug", 2),
        "Select a Michell truss": messages.not_a_truss(),
        "wait until it is done": messages.busy(),
    }
    for advice, text in texts.items():
        assert advice in text
        assert "{" not in text
