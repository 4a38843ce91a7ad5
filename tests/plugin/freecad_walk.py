"""Runs inside FreeCAD: makes a truss as a designer would, turns knobs, breaks things; notes everything as JSON."""

import json
import os
import shutil
import signal

import FreeCAD as App
import Part
from freecad_steps import FOLDER, clamps, describe, state, turn
from michell_workbench import headless

TURNS = ({"Radius": 0.9}, {"VolumeFraction": 0.1}, {"Mass": 14.0})
"""Changes of properties, one after the other: each size replaces the one before. See `freecad_bracket` for the rest."""


def main() -> None:
    """Walk, and write what was found."""
    found: dict = {}
    document = App.newDocument("Walk")
    document.UndoMode = 1
    body = document.addObject("Part::Feature", "Bar")
    body.Shape = Part.read(str(FOLDER / "bar.step"))
    found["cancelled"] = refused(document, body, cancel=True)
    found["died"] = refused(document, body, cancel=False)
    truss = make(document, body)
    found["made"] = state(truss, "made.brep")
    found["properties"] = describe(truss)
    shutil.copy(truss.DesignFile, FOLDER / "design.npz")
    found["turns"] = [turn(document, truss, changes, f"turn{k}.brep") for k, changes in enumerate(TURNS)]
    found["turned_back"] = cancel_a_turn(document, truss)
    found["died_in_a_turn"] = kill_in_a_turn(document, truss)
    found["expression"] = drive_by_spreadsheet(document, truss)
    export(truss)
    found["body_statuses"] = edit_and_delete_body(document, truss)
    document.saveAs(str(FOLDER / "walk.FCStd"))
    App.closeDocument(document.Name)
    found["reopened"] = reopen()
    found["missing"] = without_michell_cad()
    found["bodies"] = edited_bodies()
    (FOLDER / "found.json").write_text(json.dumps(found))


def picks(body, resolution=4.0):
    """A support on one end of the bar, a load on the other."""
    from michell_workbench.bodies import body_shape, describe_face, surface_kinds
    from michell_workbench.job import Load, Setup, Support

    shape = body_shape(body)
    ends = sorted(range(1, 7), key=lambda n: shape.Faces[n - 1].CenterOfMass.x)
    held, loaded = (describe_face(shape, f"Face{n}") for n in (ends[0], ends[-1]))
    return Setup(
        (Support((held,)),),
        (Load((loaded,), "force", (0.0, 0.0, -500.0)),),
        surface_kinds(shape),
        resolution=resolution,
        mesh_size=10.0,
    )


def make(document, body, **options):
    """The truss of the bar."""
    from michell_workbench.trusses import make_truss

    return make_truss(document, body, picks(body), {"radius": 1.0}, **options)


def refused(document, body, cancel):
    """What is left when the designer cancels, or the worker is killed, in the middle of a run."""
    from michell_workbench import session
    from michell_workbench.client import WorkerError

    seen = []

    def progress(stage, fraction):
        seen.append(stage)
        if not cancel and stage == "elasticity":
            os.killpg(session.worker()._process.pid, signal.SIGKILL)

    try:
        make(document, body, progress=progress, wanted=lambda: not (cancel and "elasticity" in seen))
    except WorkerError as error:
        objects = [obj.Name for obj in document.Objects]
        return {"kind": error.kind, "text": str(error), "objects": objects, "undo": document.UndoCount}
    return {"kind": "none", "stages": seen}


def cancel_a_turn(document, truss):
    """Esc while the truss is rebuilt: knobs and shape are as before."""
    from michell_workbench import trusses

    before, original = state(truss), trusses._Bar.wanted
    trusses._Bar.wanted = lambda self: False
    try:
        truss.Radius = 0.8
        document.recompute()
    finally:
        trusses._Bar.wanted = original
    return {"before": before, "after": state(truss)}


def kill_in_a_turn(document, truss):
    """What the truss says when the worker is killed while it rebuilds it, and after another try."""
    from michell_workbench import session, trusses

    before, original = state(truss), trusses._Bar.show
    trusses._Bar.show = lambda self, stage, fraction: os.killpg(session.worker()._process.pid, signal.SIGKILL)
    try:
        truss.FilletRatio = 0.2
        document.recompute()
    finally:
        trusses._Bar.show = original
    after = state(truss)
    truss.touch()
    document.recompute()
    again = state(truss)
    truss.FilletRatio = 0.4
    document.recompute()
    return {"before": before, "after": after, "again": again}


def drive_by_spreadsheet(document, truss):
    """A knob follows a cell."""
    from michell_workbench.trusses import update

    sheet = document.addObject("Spreadsheet::Sheet", "Sheet")
    sheet.set("A1", "0.5")
    document.recompute()
    truss.setExpression("Entasis", "Sheet.A1 / 2")
    update(document)
    first = state(truss)
    sheet.set("A1", "0.2")
    update(document)
    return [first, state(truss)]


def export(truss):
    """STEP, STL and the job file."""
    from michell_workbench.trusses import export, save_job

    export(truss, str(FOLDER / "out.step"))
    export(truss, str(FOLDER / "out.stl"))
    save_job(truss, str(FOLDER / "job.toml"))


def edit_and_delete_body(document, truss):
    """What the truss says when its body is longer, no solid, gone, and itself again; its volume each time."""
    rows, body, bar = [], truss.Body, truss.Body.Shape
    for shape in (Part.makeBox(100, 40, 40), Part.makePlane(10, 10), bar):
        body.Shape = shape
        document.recompute()
        rows.append([truss.Status, truss.Shape.Volume])
    truss.Body = None
    document.recompute()
    rows.append([truss.Status, truss.Shape.Volume])
    truss.Body = body
    document.recompute()
    return rows


def reopen():
    """The saved document without the worker, then with a turned knob."""
    from michell_workbench import session
    from michell_workbench.trusses import update

    session.close()
    document = App.openDocument(str(FOLDER / "walk.FCStd"))
    truss = document.getObject("MichellTruss")
    document.recompute()
    as_saved = state(truss) | {"workers": len(session._workers)}
    bounds = clamps(truss, "NodeRatio")
    truss.setExpression("Entasis", None)
    truss.Entasis, truss.Radius = 0.0, 1.0
    update(document)
    turned = state(truss, "reopened.brep") | {"workers": len(session._workers)}
    App.closeDocument(document.Name)
    return {"as_saved": as_saved, "bounds": bounds, "turned": turned}


def without_michell_cad():
    """A Python that does not have it, and none at all."""
    from michell_workbench import session
    from michell_workbench.client import WorkerError

    texts, preferences = [], App.ParamGet(session.PREFERENCES)
    for python in ("/usr/bin/python3", str(FOLDER / "no-such-python")):
        preferences.SetString("Python", python)
        try:
            session.worker().hello()
        except WorkerError as error:
            texts.append([error.kind, str(error)])
    preferences.SetString("Python", "")
    session.close()
    return texts


def edited_bodies():
    """Picks after edits of the body: longer, with an edge cut off, and with the loaded face gone."""
    from michell_workbench.bodies import FacesGone, find_faces

    document = App.newDocument("Bodies")
    body = document.addObject("Part::Feature", "Block")
    body.Shape = Part.makeBox(80, 40, 40)
    setup = picks(body)
    texts = {}
    longer = find_faces(Part.makeBox(100, 40, 40), setup, "Block")
    texts["longer"] = [longer.loads[0].faces[0].centre[0], longer.supports[0].faces[0].centre[0]]
    hole = Part.makeBox(80, 40, 40).cut(Part.makeCylinder(5, 40, App.Vector(40, 20, 0)))
    drilled = find_faces(hole, setup, "Block")
    texts["drilled"] = [drilled.loads[0].faces[0].centre[0], drilled.supports[0].faces[0].centre[0]]
    slanted = Part.makeBox(80, 40, 40).cut(Part.makeBox(40, 40, 40, App.Vector(80, 0, 20), App.Vector(1, 0, 1)))
    try:
        find_faces(slanted, setup, "Block")
    except FacesGone as error:
        texts["gone"] = str(error)
    return texts


headless.run(main)
