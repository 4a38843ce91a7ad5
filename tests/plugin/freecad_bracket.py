"""Runs inside FreeCAD: the bracket of the examples, from its STEP file through every knob to a reopened document."""

import json
import os
import shutil

import FreeCAD as App
import Part
from freecad_steps import FOLDER, describe, state, turn
from michell_workbench import headless
from michell_workbench.knob_properties import AS_DESIGNED

BOLT, EYE = 4.5, 8.0
"""Radii of the holes that are picked, mm."""

TURNS = (
    {"Radius": 1.0, "Entasis": 0.2, "SmallestRadius": 1.1, "NodeRatio": 2.0, "FilletRatio": 0.3},
    {"Family": "tension, compression", "Every": 2, "Offset": 1, "EveryTension": 1, "OffsetTension": 0},
    {"VolumeFraction": 0.08, "SmallestRadius": 0, "EveryCompression": 2, "OffsetCompression": 1},
    {"Mass": 6.0, "EveryThird": 3, "OffsetThird": 0, "Family": "all"},
)
"""Changes of properties, one after the other. The last one also turns what is named nowhere, see `turn_the_rest`."""


def main() -> None:
    """Pick, cancel, compute, turn, save, reopen."""
    found: dict = {}
    document = App.newDocument("Bracket")
    document.UndoMode = 1
    Part.insert(os.environ["BRACKET"], document.Name)
    (body,) = document.Objects
    found["picked"] = {"supports": holes(body, BOLT), "loads": holes(body, EYE)}
    found["before"] = contents(document)
    found["cancelled"] = cancel(document, body)
    truss = make(document, body)
    found["made"] = state(truss, "made.brep")
    found["properties"] = sorted(describe(truss))
    shutil.copy(truss.DesignFile, FOLDER / "design.npz")
    last = len(TURNS) - 1
    found["turns"] = [
        turn(document, truss, changes | (turn_the_rest(truss) if k == last else {}), f"turn{k}.brep")
        for k, changes in enumerate(TURNS)
    ]
    found["cancelled_again"] = cancel(document, body, truss) | {"state": state(truss)}
    document.saveAs(str(FOLDER / "bracket.FCStd"))
    App.closeDocument(document.Name)
    found["reopened"] = reopen()
    (FOLDER / "bracket.json").write_text(json.dumps(found))


def holes(body, radius):
    """Names of the cylinders of a radius, as clicking on them would give."""
    return [
        f"Face{number}"
        for number, face in enumerate(body.Shape.Faces, 1)
        if face.Surface.TypeId == "Part::GeomCylinder" and abs(face.Surface.Radius - radius) < 1e-6
    ]


def make(document, body, truss=None, **options):
    """The truss of the bracket, with large cells: bolted down, pulled at its eye."""
    from michell_workbench.bodies import body_shape, describe_face, surface_kinds
    from michell_workbench.job import Load, Setup, Support
    from michell_workbench.trusses import make_truss

    shape = body_shape(body)
    bolts, eye = (tuple(describe_face(shape, name) for name in holes(body, radius)) for radius in (BOLT, EYE))
    setup = Setup(
        (Support(bolts),),
        (Load(eye, "force", (0.0, 30.0, 40.0)),),
        surface_kinds(shape),
        spacing=20.0,
        mesh_size=10.0,
    )
    return make_truss(document, body, setup, {"radius": 1.2, "every": 3}, truss, **options)


def contents(document):
    """What a cancelled run must not change."""
    return {
        "objects": [[o.Name, list(o.State), o.Shape.Volume] for o in document.Objects],
        "undo": document.UndoCount,
    }


def cancel(document, body, truss=None):
    """Cancel in the middle of a run; the document before and after."""
    from michell_workbench.client import WorkerError

    seen, before = [], contents(document)
    try:
        make(
            document,
            body,
            truss,
            progress=lambda stage, fraction: seen.append(stage),
            wanted=lambda: not seen,
        )
    except WorkerError as error:
        return {"kind": error.kind, "text": str(error), "before": before, "after": contents(document)}
    return {"kind": "none"}


def turn_the_rest(truss):
    """A change for every knob that no turn names: the last of its choices, or a little more."""
    named, changes = {name for changes in TURNS for name in changes}, {}
    for name, row in describe(truss).items():
        if name in named:
            continue
        changes[name] = (
            [c for c in row["choices"] if c != AS_DESIGNED][-1]
            if "choices" in row
            else row["value"] + (row["bounds"][1] - row["value"]) / 20
        )
    return changes


def reopen():
    """The saved document, recomputed as it is and with a knob turned back."""
    from michell_workbench.trusses import update

    document = App.openDocument(str(FOLDER / "bracket.FCStd"))
    truss = document.getObject("MichellTruss")
    document.recompute()
    as_saved = state(truss)
    truss.Every, truss.Radius = 3, 1.5
    update(document)
    return {"as_saved": as_saved, "turned": state(truss, "reopened.brep")}


headless.run(main)
