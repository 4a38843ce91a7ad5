"""The worker: requests and events as documented, over pipes as a host has them; files whole or not at all."""

import io
import json
import subprocess
import sys
import time
from pathlib import Path

import cadquery as cq
import numpy as np
import pytest
from shapes import box_mesh

from michell_cad.cad import read_step_summary
from michell_cad.knobs import Knobs
from michell_cad.worker import PROTOCOL, loop
from michell_cad.worker.tasks import Session

JOB = '[part]\nfile = "bar.npz"\n[options]\nresolution = 5\n[knobs]\nradius = 0.9\n'


def serve(*requests: dict | str) -> list[dict]:
    """Events of a worker in this process that gets these requests."""
    lines = [request if isinstance(request, str) else json.dumps(request) for request in requests]
    events = io.StringIO()
    loop.serve(Waiting(lines, events), events)
    return [json.loads(line) for line in events.getvalue().splitlines()]


class Waiting:
    """Lines whose end comes only when all of them are answered, as a host waits for the last answer."""

    def __init__(self, lines: list[str], events: io.StringIO) -> None:
        self._lines, self._events = lines, events

    def __iter__(self):
        until = time.monotonic() + 120
        for line in self._lines:
            while '"cancel"' in line and "progress" not in self._events.getvalue() and time.monotonic() < until:
                time.sleep(0.01)  # a cancel comes while something runs
            yield line + "\n"
        asked = sum('"cancel"' not in line for line in self._lines)
        while self._answers() < asked and time.monotonic() < until:
            time.sleep(0.01)

    def _answers(self) -> int:
        return sum('"event": "progress"' not in line for line in self._events.getvalue().splitlines())


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("worker")
    mesh = box_mesh((6, 3, 3), (0.06, 0.03, 0.03))
    force = np.where(mesh.vertices[:, :1] == 0.06, [[0.0, 0.0, -2.0]], 0.0)
    np.savez(folder / "bar.npz", vertices=mesh.vertices, tets=mesh.tets, fixed=mesh.vertices[:, 0] == 0, force=force)
    (folder / "bar.toml").write_text(JOB)
    return folder


@pytest.fixture(scope="module")
def design(folder) -> str:
    request = {"id": 1, "do": "design", "job": str(folder / "bar.toml"), "design": str(folder / "bar-design.npz")}
    events = serve(request)
    assert events[-1]["event"] == "done", events[-1]
    assert events[-1]["result"]["knobs"]["radius"] == 0.9
    stages = list(dict.fromkeys(event["stage"] for event in events[:-1]))
    assert stages == ["mesh", "elasticity", "frames", "parametrization", "isocurves", "truss"]
    return events[-1]["result"]["design"]


def test_hello_tells_the_schema_and_refuses_another_protocol():
    good, newer, older = serve(*({"id": k, "do": "hello", "protocol": PROTOCOL + k} for k in (0, 1, -1)))
    assert set(good["result"]["knobs"]) == set(Knobs.model_fields)
    assert good["result"]["default_material"] in good["result"]["materials"]
    assert newer["kind"] == older["kind"] == "input"
    assert "install a newer michell_cad" in newer["message"]
    assert "add-in of this michell_cad" in older["message"]


def test_build_writes_the_solid_and_the_faces_of_each_family(folder, design):
    request = {"id": 7, "do": "build", "design": design, "folder": str(folder / "out"), "families": True}
    result = serve(request)[-1]["result"]
    shape = cq.Shape.importBrep(result["brep"])
    assert shape.isValid()
    assert shape.Volume() == pytest.approx(result["volume_mm3"], rel=1e-3)
    assert len(result["face_families"]) == len(shape.Faces()) == result["faces"]
    areas = dict.fromkeys(result["family_names"], 0.0)
    for face, family in zip(shape.Faces(), result["face_families"], strict=True):
        areas[result["family_names"][family]] += face.Area()
    assert {"tension", "compression", "third", "node"} <= set(areas)
    for name, path in result["families"].items():
        part = cq.Shape.importBrep(path)
        assert sum(face.Area() for face in part.Faces()) == pytest.approx(areas[name], rel=1e-6)
    assert set(result["colours"]) == set(areas)


def test_knobs_change_the_solid_and_the_design_stays(folder, design):
    before = Path(design).read_bytes()
    requests = [
        {"id": k, "do": "build", "design": design, "knobs": knobs, "folder": str(folder / f"knobs{k}")}
        for k, knobs in enumerate(({}, {"radius": 0.6}, {"family": ["tension", "third"]}, {"mass": 8.0}))
    ]
    plain, thin, some, heavy = (e["result"] for e in serve(*requests) if e["event"] == "done")
    assert thin["volume_mm3"] < plain["volume_mm3"]
    assert thin["radius_mm"] == pytest.approx(0.6)
    assert "compression" not in some["family_names"]
    assert heavy["mass_g"] == pytest.approx(8.0, rel=0.01)
    assert heavy["knobs"]["radius"] is not None
    assert Path(design).read_bytes() == before


def test_export_builds_once(folder, design, monkeypatch):
    import michell_cad.building as building

    built = []
    original = building.build_united
    monkeypatch.setattr(building, "build_united", lambda *a: built.append(1) or original(*a))
    knobs = {"radius": 0.7}
    events = serve(
        {"id": 1, "do": "build", "design": design, "knobs": knobs, "folder": str(folder / "e")},
        {"id": 2, "do": "export", "design": design, "knobs": knobs, "file": str(folder / "e.step")},
        {"id": 3, "do": "export", "design": design, "knobs": knobs, "file": str(folder / "e.stl")},
    )
    assert [e["event"] for e in events if e["event"] != "progress"] == ["done"] * 3
    assert built == [1]
    done = next(e["result"] for e in events if e["id"] == 1 and e["event"] == "done")
    summary = read_step_summary(folder / "e.step")
    assert summary.valid
    assert summary.volume_mm3 == pytest.approx(done["volume_mm3"], rel=1e-4)


@pytest.mark.parametrize(
    ("request_", "kind", "text"),
    [
        ("{", "protocol", "not a line of JSON"),
        ("[1]", "protocol", "JSON object"),
        ({"do": "dance"}, "input", "unknown request 'dance'"),
        ({"do": "build", "folder": "x"}, "input", "design: Field required"),
        ({"do": "build", "design": "none.npz", "folder": "x"}, "input", "no design file"),
        ({"do": "design", "job": "none.toml", "design": "x.npz"}, "input", "does not exist"),
        ({"do": "design", "job": "a.toml", "design": "/no/such/x.npz"}, "input", "no folder"),
        ({"do": "export", "design": "d.npz", "file": "truss.obj"}, "input", "unknown kind of file"),
    ],
)
def test_mistakes_are_one_message_and_the_next_request_works(request_, kind, text):
    request = request_ if isinstance(request_, str) else {"id": 4, **request_}
    events = serve(request, {"id": 5, "do": "hello", "protocol": PROTOCOL})
    wrong, right = sorted(events, key=lambda event: event["id"] == 5)
    assert (wrong["event"], wrong["kind"]) == ("error", kind)
    assert text in wrong["message"]
    assert right["event"] == "done"


def test_a_bad_knob_names_it(folder, design):
    knobs = {"radius": 90.0}
    (*_, event) = serve({"id": 1, "do": "build", "design": design, "knobs": knobs, "folder": str(folder / "bad")})
    assert event["kind"] == "input"
    assert "radius of 90 mm" in event["message"]
    assert not (folder / "bad").exists()


def test_what_nobody_foresaw_is_an_error_too(monkeypatch):
    def fail(session: Session, values: object, progress: object) -> dict:
        raise ZeroDivisionError("of all things")

    monkeypatch.setitem(loop.TASKS, "hello", fail)
    (event,) = serve({"id": 1, "do": "hello"})
    assert (event["kind"], event["message"]) == ("bug", "unexpected ZeroDivisionError: of all things")


def test_cancel_stops_and_leaves_nothing(folder, monkeypatch):
    def slow(session: Session, values: object, progress) -> dict:
        for step in range(1000):
            progress("waiting", step / 1000)
            time.sleep(0.01)
        raise AssertionError("it was not cancelled")

    monkeypatch.setitem(loop.TASKS, "design", slow)
    events = serve({"id": 1, "do": "design"}, {"id": 2, "do": "cancel", "of": 1}, {"id": 3, "do": "dance"})
    kinds = {event["id"]: event.get("kind") for event in events if event["event"] == "error"}
    assert kinds == {1: "cancelled", 3: "input"}


def test_events_alone_are_on_standard_output_and_the_end_of_input_ends_it(folder):
    code = (
        "import os; from michell_cad.worker import __main__ as m, loop\n"
        "def noisy(*_): os.write(1, b'from a library\\n'); print('from Python'); return {}\n"
        "loop.TASKS['noise'] = noisy\n"
        "m.main()\n"
    )
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, "-c", code], stdin=pipe, stdout=pipe, stderr=pipe, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdin.write('{"id": 1, "do": "noise"}\n')
        process.stdin.flush()
        assert json.loads(process.stdout.readline()) == {"id": 1, "event": "done", "result": {}}
        process.stdin.close()
        assert process.stdout.read() == ""
        assert process.wait(20) == 0
        assert "from a library" in process.stderr.read()


def test_a_killed_worker_leaves_no_file_under_its_name(folder):
    target = folder / "killed" / "design.npz"
    target.parent.mkdir()
    command = [sys.executable, "-m", "michell_cad.worker"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        request = {"id": 1, "do": "design", "job": str(folder / "bar.toml"), "design": str(target)}
        process.stdin.write(json.dumps(request) + "\n")
        process.stdin.flush()
        while json.loads(process.stdout.readline())["stage"] != "frames":
            pass
        process.kill()
        assert process.wait(20) != 0
    assert list(target.parent.iterdir()) == []
