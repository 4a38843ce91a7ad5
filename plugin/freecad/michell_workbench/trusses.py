"""The truss in a document: a `Part::FeaturePython` whose properties are the knobs.

What the computation needs is in the document itself: the picks (JSON), the design file (a file inside the .FCStd), the
schema of the knobs. So a document opens without the worker, and a knob that is turned starts it again.
"""

import json
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import FreeCAD as App
import Part

from michell_workbench import messages
from michell_workbench.bodies import body_shape, find_faces, fingerprint
from michell_workbench.client import Progress, Wanted, Worker, WorkerError
from michell_workbench.job import Setup, from_json, to_json, write_job
from michell_workbench.knob_properties import GROUP, KnobProperty, knobs_of, properties_of, rivals, values_of
from michell_workbench.session import worker as usual_worker
from michell_workbench.texts import QT_TRANSLATE_NOOP, translate

HIDDEN_TEXTS = ("Setup", "Schema", "Built", "Fingerprint", "Notes")
"""Properties that hold JSON and the like: the picks, the schema of the knobs, knobs of the shape, state of the body,
what was said when the shape was built."""

FIGURES = (
    ("App::PropertyLength", "UsedRadius", QT_TRANSLATE_NOOP("App::Property", "Smallest radius of a member")),
    ("App::PropertyLength", "CellEdge", QT_TRANSLATE_NOOP("App::Property", "Edge of a typical cell")),
    (
        "App::PropertyFloat",
        "SolidVolume",
        QT_TRANSLATE_NOOP("App::Property", "Volume of the truss, mm^3, as michell_cad measures it"),
    ),
    ("App::PropertyFloat", "SolidMass", QT_TRANSLATE_NOOP("App::Property", "Mass of the truss, g")),
    ("App::PropertyString", "Status", QT_TRANSLATE_NOOP("App::Property", "What michell_cad says about this truss")),
)
"""Properties that are shown and not to be set."""


@dataclass(frozen=True)
class Computed:
    """What the worker has made of a setup; nothing of it is in the document yet.

    Parameters
    ----------
    setup : as it was computed.
    hello : of the worker.
    design : the design file.
    knobs : as asked for.
    built : the worker's answer to ``build``.
    shape : the truss.
    fingerprint : of the body.
    """

    setup: Setup
    hello: dict[str, Any]
    design: Path
    knobs: dict[str, Any]
    built: dict[str, Any]
    shape: Any
    fingerprint: str


# --- computing: no document is touched -----------------------------------------------------------------------------


def compute(
    shape: Any,
    setup: Setup,
    knobs: Mapping[str, Any],
    folder: Path,
    worker: Worker,
    progress: Progress = lambda stage, fraction: None,
    wanted: Wanted = lambda: True,
) -> Computed:
    """Design and build the truss of a solid; may run in any thread.

    Raises
    ------
    WorkerError, ValueError
        See `Worker.ask`, `write_job`.
    """
    hello = worker.hello()
    write_job(folder / "job.toml", setup, knobs, lambda file: shape.exportBrep(str(file)))
    values = {"job": str(folder / "job.toml"), "design": str(folder / "design.npz")}
    design = Path(worker.ask("design", values, progress, wanted)["design"])
    built = worker.ask("build", {"design": str(design), "folder": str(folder / "shape")}, progress, wanted)
    return Computed(setup, hello, design, dict(knobs), built, _read_shape(built), fingerprint(shape))


def make_truss(
    document: Any,
    body: Any,
    setup: Setup,
    knobs: Mapping[str, Any] | None = None,
    truss: Any = None,
    progress: Progress = lambda stage, fraction: None,
    wanted: Wanted = lambda: True,
) -> Any:
    """Compute a truss and put it into a document; returns the object. For scripts, which wait.

    Parameters
    ----------
    document, body : where, and of what.
    setup : supports, loads, material, resolution.
    knobs : those that differ from the defaults.
    truss : an earlier truss to be replaced.
    progress, wanted : see `Worker.ask`.

    Raises
    ------
    WorkerError, FacesGone, ValueError
        The document is then as it was.
    """
    shape = body_shape(body)
    setup = find_faces(shape, setup, body.Label)
    with tempfile.TemporaryDirectory() as folder:
        computed = compute(shape, setup, knobs or {}, Path(folder), usual_worker(), progress, wanted)
        return place_truss(document, body, computed, truss)


# --- the document ----------------------------------------------------------------------------------------------------


def place_truss(document: Any, body: Any, computed: Computed, truss: Any = None) -> Any:
    """Put a computed truss into a document, as one step that can be undone; returns the object."""
    document.openTransaction(translate("MichellCAD", "Michell truss"))
    try:
        if truss is None:
            truss = document.addObject("Part::FeaturePython", "MichellTruss")
            truss.Label = translate("MichellCAD", "Michell truss")
            MichellTruss(truss)
        truss.Body = body
        truss.Setup, truss.Fingerprint = to_json(computed.setup), computed.fingerprint
        truss.DesignFile = str(computed.design)
        truss.Schema = json.dumps({"knobs": computed.hello["knobs"], "one_of": computed.hello["one_of"]})
        properties = _add_knobs(truss)
        truss.Built = ""  # while knobs change one by one nothing is known about the shape
        for name, value in values_of(properties, computed.knobs).items():
            setattr(truss, name, value)
        _show(truss, computed.built, computed.shape)
        if App.GuiUp:
            from michell_workbench.views import TrussView

            TrussView(truss.ViewObject)
        truss.recompute()
        truss.purgeTouched()
    except BaseException:
        document.abortTransaction()
        raise
    document.commitTransaction()
    return truss


def update(document: Any) -> None:
    """Recompute a document and raise what is wrong with its trusses; for scripts, which see no red marks.

    Raises
    ------
    WorkerError
        With the messages of all trusses that are in error.
    """
    document.recompute()
    wrong = [f"{o.Label}: {o.Status}" for o in document.Objects if is_truss(o) and "Invalid" in o.State]
    if wrong:
        raise WorkerError("input", "\n".join(wrong))


def is_truss(obj: Any) -> bool:
    """Whether an object is a truss of this add-in."""
    return isinstance(getattr(obj, "Proxy", None), MichellTruss)


def export(truss: Any, path: str) -> None:
    """Write a truss as .step (faces named and coloured after their curves) or .stl, by michell_cad itself.

    Raises
    ------
    WorkerError
        See `Worker.ask`.
    """
    values = {"design": _design_of(truss), "knobs": read_knobs(truss), "file": path}
    usual_worker().ask("export", values)


def save_job(truss: Any, path: str) -> None:
    """Write the job of a truss, with its knobs as they are, for `michell-cad design`.

    Raises
    ------
    FacesGone, ValueError
        If the body is no longer what was picked.
    """
    if truss.Body is None:
        raise ValueError(messages.body_gone())
    shape = body_shape(truss.Body)
    setup = find_faces(shape, from_json(truss.Setup), truss.Body.Label)
    write_job(Path(path), setup, read_knobs(truss), lambda file: shape.exportBrep(str(file)))


def read_knobs(truss: Any) -> dict[str, Any]:
    """The knobs as the properties have them."""

    def plain(name: str) -> Any:
        value = getattr(truss, name)
        return getattr(value, "Value", value)

    return knobs_of(_properties(truss), plain)


class MichellTruss:
    """What FreeCAD asks of the truss."""

    def __init__(self, obj: Any) -> None:
        body = QT_TRANSLATE_NOOP("App::Property", "The body that the truss is made of")
        obj.addProperty("App::PropertyLinkGlobal", "Body", "Design", body)
        obj.addProperty("App::PropertyFileIncluded", "DesignFile", "Design", "", 0, True, True)
        for name in HIDDEN_TEXTS:
            obj.addProperty("App::PropertyString", name, "Design", "", 0, True, True)
        for kind, name, tip in FIGURES:
            obj.addProperty(kind, name, "Truss", tip, 8, True)  # 8: what is shown does not make the truss stale
        obj.addProperty("App::PropertyStringList", "FamilyNames", "Design", "", 0, True, True)
        obj.addProperty("App::PropertyIntegerList", "FaceFamilies", "Design", "", 0, True, True)
        obj.addProperty("App::PropertyColorList", "FamilyColours", "Design", "", 0, True, True)
        obj.Proxy = self

    def execute(self, obj: Any) -> None:
        """Build the truss anew if its knobs are not those of its shape.

        Raises
        ------
        RuntimeError
            If it cannot be; the shape stays, the object shows the error and says why in `Status`.
        """
        knobs = read_knobs(obj)
        if json.dumps(knobs) == obj.Built and not obj.Shape.isNull():
            _look_at_body(obj)
            return
        try:
            with tempfile.TemporaryDirectory() as folder, _Bar() as bar:
                values = {"design": _design_of(obj), "knobs": knobs, "folder": str(Path(folder) / "shape")}
                built = usual_worker().ask("build", values, bar.show, bar.wanted)
                _show(obj, built, _read_shape(built))
        except WorkerError as error:
            if error.kind == "cancelled":
                _turn_back(obj)
                return
            obj.Status = str(error)
            raise RuntimeError(str(error)) from None
        _look_at_body(obj)

    def onChanged(self, obj: Any, name: str) -> None:
        """Let a newly set size replace the one that was set."""
        if App.isRestoring() or not getattr(obj, "Schema", "") or not getattr(obj, "Built", ""):
            return
        properties, value = _properties(obj), getattr(obj, name)
        driven = {path.lstrip(".") for path, _ in obj.ExpressionEngine}
        for rival in rivals(properties, json.loads(obj.Schema)["one_of"], name):
            if getattr(value, "Value", value) and rival.name not in driven:
                if getattr(getattr(obj, rival.name), "Value", getattr(obj, rival.name)):
                    setattr(obj, rival.name, rival.unset)

    def onDocumentRestored(self, obj: Any) -> None:
        """Bounds are not saved with a document."""
        touched = "Touched" in obj.State
        for p in _properties(obj):
            if p.bounds is not None:
                setattr(obj, p.name, _constraint(p, getattr(obj, p.name)))
        if not touched:
            obj.purgeTouched()

    def dumps(self) -> None:
        """Everything is in properties."""

    def loads(self, state: None) -> None:
        """Everything is in properties."""

    __getstate__, __setstate__ = dumps, loads  # their names before FreeCAD 0.22


class _Bar:
    """FreeCAD's progress bar while a truss is rebuilt; Esc cancels."""

    def __enter__(self) -> "_Bar":
        self._steps, self._stopped = 0, False
        self._bar = App.Base.ProgressIndicator() if App.GuiUp else None
        if self._bar is not None:
            self._bar.start(translate("MichellCAD", "Building the truss..."), 100)
        return self

    def show(self, stage: str, fraction: float) -> None:
        """Advance."""
        while self._bar is not None and self._steps < min(99, 100 * fraction) and not self._stopped:
            self._steps += 1
            try:
                self._bar.next(True)
            except RuntimeError:  # how the bar says that Esc was pressed
                self._stopped = True

    def wanted(self) -> bool:
        """Whether nobody has pressed Esc."""
        return not self._stopped

    def __exit__(self, *error: object) -> None:
        if self._bar is not None:
            self._bar.stop()


# --- properties ------------------------------------------------------------------------------------------------------


def _properties(obj: Any) -> list[KnobProperty]:
    return properties_of(json.loads(obj.Schema)["knobs"]) if obj.Schema else []


def _constraint(p: KnobProperty, value: Any) -> Any:
    low, high, step = p.bounds or (0, 0, 0)
    return (value, low, high, step)


def _add_knobs(obj: Any) -> list[KnobProperty]:
    """Add the properties of all knobs that the object does not have yet."""
    properties = _properties(obj)
    for p in properties:
        if p.name in obj.PropertiesList:
            continue
        obj.addProperty(p.kind, p.name, GROUP, p.help)
        if p.choices:
            setattr(obj, p.name, list(p.choices))
        setattr(obj, p.name, p.default if p.bounds is None else _constraint(p, p.default))
    return properties


def _show(obj: Any, built: Mapping[str, Any], shape: Any) -> None:
    """Give the object its shape, families and figures."""
    placement = obj.Placement
    obj.FamilyNames, obj.FaceFamilies = built["family_names"], built["face_families"]
    obj.FamilyColours = [tuple(built["colours"][name]) for name in built["family_names"]]
    obj.Shape = shape
    obj.Placement = placement
    obj.Built = json.dumps(read_knobs(obj))
    obj.UsedRadius, obj.CellEdge = built["radius_mm"], built["spacing_mm"]
    obj.SolidVolume, obj.SolidMass = built["volume_mm3"], built["mass_g"]
    obj.Notes = "; ".join(built["messages"]) or translate("MichellCAD", "up to date")


def _look_at_body(obj: Any) -> None:
    """Say how the truss is: what was said when it was built, unless the body is no longer the one that it is for."""
    obj.Status = obj.Notes
    if obj.Body is None:
        obj.Status = messages.body_gone()
        return
    try:
        same = fingerprint(body_shape(obj.Body)) == obj.Fingerprint
    except ValueError:  # no longer one solid
        same = False
    if not same:
        obj.Status = messages.body_changed(obj.Body.Label)
        App.Console.PrintWarning(obj.Status + "\n")


def _turn_back(obj: Any) -> None:
    """Give the knobs the values of the shape that is there."""
    for name, value in values_of(_properties(obj), json.loads(obj.Built)).items():
        setattr(obj, name, value)
    obj.Status = messages.cancelled()


def _design_of(obj: Any) -> str:
    path = obj.DesignFile
    if not path or not Path(path).is_file():
        raise WorkerError("input", messages.no_design())
    return path


def _read_shape(built: Mapping[str, Any]) -> Any:
    shape = Part.Shape()
    shape.read(built["brep"])
    return shape
