"""The form: pick faces for supports and loads, choose material and resolution, press one button, watch or cancel."""

import tempfile
from dataclasses import replace
from pathlib import Path
from threading import Thread
from typing import Any

import FreeCAD as App
import FreeCADGui as Gui
from PySide import QtCore, QtGui

from michell_workbench import messages, trusses
from michell_workbench.bodies import FacesGone, body_shape, describe_face, find_faces, surface_kinds
from michell_workbench.client import WorkerError
from michell_workbench.commands import ask_file, tell
from michell_workbench.job import LOAD_KINDS, Load, Setup, Support, from_json, write_job
from michell_workbench.session import worker
from michell_workbench.texts import translate

TICK = 100
"""Milliseconds between two looks at the computation."""

NARROW = 44
"""Smallest width of fields, and largest of buttons with one letter, pixels."""

LARGEST = 1e9
"""Bound of number fields."""


def open_panel(truss: Any | None) -> "TrussPanel":
    """Show the form of a truss, or an empty one."""
    if Gui.Control.activeDialog():
        raise ValueError(translate("MichellCAD", "Another form is open: close it first."))
    panel = TrussPanel(App.ActiveDocument, truss)
    Gui.Control.showDialog(panel)
    return panel


class Computation(Thread):
    """One computation beside the window; the document is not touched by it."""

    def __init__(self, shape: Any, setup: Setup, knobs: dict[str, Any], folder: Path) -> None:
        super().__init__(daemon=True)
        self._given = (shape, setup, knobs, folder, worker())
        self.stage, self.fraction, self.cancelled = "", 0.0, False
        self.result: trusses.Computed | None = None
        self.error: Exception | None = None

    def run(self) -> None:
        """Compute; the form looks at the attributes now and then."""
        try:
            self.result = trusses.compute(*self._given, self._show, lambda: not self.cancelled)
        except (WorkerError, ValueError, RuntimeError, OSError) as error:
            self.error = error

    def _show(self, stage: str, fraction: float) -> None:
        self.stage, self.fraction = stage, fraction


class TrussPanel:
    """A task panel; FreeCAD asks it for its form and its standard buttons."""

    def __init__(self, document: Any, truss: Any | None) -> None:
        self.document, self.truss = document, truss
        self.setup = from_json(truss.Setup) if truss is not None else Setup()
        self.body = truss.Body if truss is not None else None
        self._computation: Computation | None = None
        self._folder: Any = None
        self._timer = QtCore.QTimer()
        self._timer.timeout.connect(self._look)
        self.form = QtGui.QWidget()
        self.form.setWindowTitle(translate("MichellCAD", "Michell truss"))
        self._lay_out()
        self._fill()

    # --- what FreeCAD asks ---------------------------------------------------------------------------------------

    def getStandardButtons(self) -> int:
        """Close only: the form has its own button to compute."""
        return int(QtGui.QDialogButtonBox.Close)

    def reject(self) -> bool:
        """Close, and cancel what runs."""
        self.cancel()
        self._timer.stop()
        Gui.Control.closeDialog()
        return True

    # --- the form ------------------------------------------------------------------------------------------------

    def _lay_out(self) -> None:
        column = QtGui.QVBoxLayout(self.form)
        self.body_label = QtGui.QLabel()
        column.addWidget(self.body_label)
        column.addWidget(self._supports_box())
        column.addWidget(self._loads_box())
        column.addLayout(self._options_form())
        self.bar = QtGui.QProgressBar()
        self.bar.setRange(0, 100)
        self.note = QtGui.QLabel()
        self.note.setWordWrap(True)
        self.compute_button = _button(
            translate("MichellCAD", "Compute truss"),
            translate("MichellCAD", "Compute the truss of the body; the document changes only when all is done"),
            self.compute,
        )
        self.cancel_button = _button(
            translate("MichellCAD", "Cancel"),
            translate("MichellCAD", "Stop computing; the document stays as it is"),
            self.cancel,
        )
        self.job_button = _button(
            translate("MichellCAD", "Save job file..."),
            translate("MichellCAD", "Write a job file and the body beside it, for: michell-cad design JOB.toml"),
            self._save_job,
        )
        self.cancel_button.setEnabled(False)
        row = QtGui.QHBoxLayout()
        row.addWidget(self.compute_button)
        row.addWidget(self.cancel_button)
        for widget in (self.bar, self.note):
            column.addWidget(widget)
        column.addLayout(row)
        column.addWidget(self.job_button)

    def _supports_box(self) -> Any:
        box = QtGui.QGroupBox(translate("MichellCAD", "Supports"))
        column = QtGui.QVBoxLayout(box)
        self.supports = QtGui.QListWidget()
        self.supports.setMaximumHeight(80)
        row = QtGui.QHBoxLayout()
        self.axes = _narrow(QtGui.QComboBox())
        self.axes.addItems(["xyz", "xy", "xz", "yz", "x", "y", "z"])
        self.axes.setToolTip(translate("MichellCAD", "Axes of the document along which the faces cannot move"))
        row.addWidget(self.axes)
        row.addWidget(
            _button(
                translate("MichellCAD", "Add selected faces"),
                translate("MichellCAD", "Hold the faces that are selected in the 3-D view"),
                self._guarded(self.add_support),
            )
        )
        row.addWidget(_button("-", translate("MichellCAD", "Remove the marked support"), self._remove_support, True))
        column.addWidget(self.supports)
        column.addLayout(row)
        return box

    def _loads_box(self) -> Any:
        box = QtGui.QGroupBox(translate("MichellCAD", "Loads"))
        column = QtGui.QVBoxLayout(box)
        self.loads = QtGui.QListWidget()
        self.loads.setMaximumHeight(80)
        self.kind = QtGui.QComboBox()
        titles = {
            "force": translate("MichellCAD", "force, N"),
            "pressure": translate("MichellCAD", "pressure, MPa"),
            "torque": translate("MichellCAD", "torque, N mm, axis"),
            "self_weight": translate("MichellCAD", "own weight, direction"),
        }
        for kind in LOAD_KINDS:
            self.kind.addItem(titles[kind], kind)
        self.kind.currentIndexChanged.connect(self._show_load_fields)
        self.vector = [_number(-LARGEST, LARGEST, value) for value in (0.0, 0.0, -100.0)]
        self.value = _number(-LARGEST, LARGEST, 1.0)
        self.case = _narrow(QtGui.QLineEdit("main"))
        self.case.setToolTip(translate("MichellCAD", "Name of the load case; loads of the same case act together"))
        fields = QtGui.QHBoxLayout()
        for field in (*self.vector, self.value):
            fields.addWidget(field)
        row = QtGui.QHBoxLayout()
        row.addWidget(self.case)
        row.addWidget(
            _button(
                translate("MichellCAD", "Add selected faces"),
                translate("MichellCAD", "Load the faces that are selected in the 3-D view"),
                self._guarded(self.add_load),
            )
        )
        row.addWidget(_button("-", translate("MichellCAD", "Remove the marked load"), self._remove_load, True))
        column.addWidget(self.loads)
        column.addWidget(self.kind)
        column.addLayout(fields)
        column.addLayout(row)
        self._show_load_fields()
        return box

    def _options_form(self) -> Any:
        form = QtGui.QFormLayout()
        self.material = QtGui.QComboBox()
        self.material.setEditable(True)
        self.resolution = _number(0.0, 1000.0, self.setup.resolution, 1)
        self.spacing = _number(0.0, LARGEST, self.setup.spacing)
        self.mesh_size = _number(0.0, LARGEST, self.setup.mesh_size)
        rows = (
            (translate("MichellCAD", "Material"), self.material, translate("MichellCAD", "Material of the body")),
            (
                translate("MichellCAD", "Resolution"),
                self.resolution,
                translate("MichellCAD", "Cells of the truss along the body"),
            ),
            (
                translate("MichellCAD", "or cell edge, mm"),
                self.spacing,
                translate("MichellCAD", "Instead of a resolution; 0: by the resolution"),
            ),
            (
                translate("MichellCAD", "Mesh size, mm"),
                self.mesh_size,
                translate("MichellCAD", "Edge of the tetrahedra for the stress; 0: from the body"),
            ),
        )
        for title, field, tip in rows:
            field.setToolTip(tip)
            form.addRow(title, field)
        return form

    def _fill(self) -> None:
        """Show the setup."""
        nothing = translate("MichellCAD", "Select faces of a body and add them below.")
        name = self.body.Label if self.body is not None else ""
        self.body_label.setText(translate("MichellCAD", "Body: {name}").format(name=name) if name else nothing)
        self.supports.clear()
        for support in self.setup.supports:
            self.supports.addItem(f"{_names(support.faces)}: {support.axes}")
        self.loads.clear()
        for load in self.setup.loads:
            self.loads.addItem(f"{_names(load.faces)}: {_amount(load)} ({load.case})")
        if not self.material.count():
            try:
                self.material.addItems(worker().hello()["materials"])
            except WorkerError as error:
                self.note.setText(str(error))
            self.material.setEditText(self.setup.material)

    def _show_load_fields(self, *_: object) -> None:
        kind = self.kind.currentData()
        for field in self.vector:
            field.setVisible(kind != "pressure")
        self.value.setVisible(kind in ("pressure", "torque"))

    # --- picking -------------------------------------------------------------------------------------------------

    def add_support(self) -> None:
        """Hold the selected faces."""
        faces = self._picked(translate("MichellCAD", "supports"))
        self.setup = replace(self.setup, supports=(*self.setup.supports, Support(faces, self.axes.currentText())))
        self._fill()

    def add_load(self) -> None:
        """Load the selected faces; the own weight takes none."""
        kind = self.kind.currentData()
        faces = () if kind == "self_weight" else self._picked(translate("MichellCAD", "loads"))
        vector = tuple(field.value() for field in self.vector)
        load = Load(faces, kind, vector, self.value.value(), self.case.text() or "main")
        self.setup = replace(self.setup, loads=(*self.setup.loads, load))
        self._fill()

    def _picked(self, what: str) -> tuple[Any, ...]:
        """The selected faces, all of the body of this truss."""
        picked = [
            (item.Object, name)
            for item in Gui.Selection.getSelectionEx()
            for name in item.SubElementNames
            if name.startswith("Face")
        ]
        if not picked:
            raise ValueError(messages.nothing_picked(what))
        body = self.body or picked[0][0]
        for obj, _ in picked:
            if obj is not body and obj.Name != body.Name:
                raise ValueError(messages.two_bodies(body.Label, obj.Label))
        shape = body_shape(body)
        if self.setup.places():
            self.setup = find_faces(shape, self.setup, body.Label)
        self.setup = replace(self.setup, surfaces=surface_kinds(shape))
        self.body = body
        return tuple(describe_face(shape, name) for _, name in picked)

    def _remove_support(self) -> None:
        row = self.supports.currentRow()
        self.setup = replace(self.setup, supports=tuple(s for k, s in enumerate(self.setup.supports) if k != row))
        self._fill()

    def _remove_load(self) -> None:
        row = self.loads.currentRow()
        self.setup = replace(self.setup, loads=tuple(x for k, x in enumerate(self.setup.loads) if k != row))
        self._fill()

    # --- computing -----------------------------------------------------------------------------------------------

    def compute(self) -> None:
        """Start; `_look` sees how it goes."""
        try:
            shape, setup = self._ready()
            self._folder = tempfile.TemporaryDirectory()
            self._computation = Computation(shape, setup, self._knobs(), Path(self._folder.name))
        except (WorkerError, FacesGone, ValueError) as error:
            tell(str(error))
            return
        self._computation.start()
        self._timer.start(TICK)
        self._switch(computing=True)

    def cancel(self) -> None:
        """Stop computing."""
        if self._computation is not None:
            self._computation.cancelled = True

    def _look(self) -> None:
        running = self._computation
        if running is None:
            return
        if running.is_alive():
            self.bar.setValue(int(100 * running.fraction))
            self.note.setText(running.stage)
            return
        self._timer.stop()
        self._computation = None
        self._switch(computing=False)
        try:
            if running.result is not None:
                self._place(running.result)
            else:
                self.note.setText(str(running.error))
                if not running.cancelled:
                    tell(str(running.error))
        finally:
            self._folder.cleanup()

    def _place(self, computed: "trusses.Computed") -> None:
        self.setup = computed.setup
        self.truss = trusses.place_truss(self.document, self.body, computed, self.truss)
        self.body.ViewObject.Visibility = False
        name = self.document.Label
        self.note.setText(messages.unsaved_document(name) if not self.document.FileName else self.truss.Status)

    def _ready(self) -> tuple[Any, Setup]:
        """The body's shape and the whole setup, as the form has them."""
        missing = self.setup.missing()
        if missing or self.body is None:
            raise ValueError(messages.incomplete(missing or [translate("MichellCAD", "a body")]))
        shape = body_shape(self.body)
        setup = replace(
            find_faces(shape, self.setup, self.body.Label),
            material=self.material.currentText(),
            resolution=self.resolution.value(),
            spacing=self.spacing.value(),
            mesh_size=self.mesh_size.value(),
        )
        return shape, setup

    def _knobs(self) -> dict[str, Any]:
        return trusses.read_knobs(self.truss) if self.truss is not None else {}

    def _save_job(self) -> None:
        try:
            shape, setup = self._ready()
            path = ask_file(translate("MichellCAD", "Save job file"), "truss.toml", "TOML (*.toml)")
            if path:
                write_job(Path(path), setup, self._knobs(), lambda file: shape.exportBrep(str(file)))
        except (FacesGone, ValueError, OSError) as error:
            tell(str(error))

    def _switch(self, computing: bool) -> None:
        self.compute_button.setEnabled(not computing)
        self.cancel_button.setEnabled(computing)
        self.bar.setValue(0 if computing else self.bar.value())

    def _guarded(self, act: Any) -> Any:
        def acting() -> None:
            try:
                act()
            except (FacesGone, ValueError) as error:
                tell(str(error))

        return acting


def _narrow(field: Any) -> Any:
    """Let a field be as narrow as FreeCAD's column of tasks needs it."""
    field.setMinimumWidth(NARROW)
    return field


def _button(text: str, tip: str, act: Any, small: bool = False) -> Any:
    button = QtGui.QPushButton(text)
    if small:
        button.setMaximumWidth(NARROW)
    button.setToolTip(tip)
    button.clicked.connect(lambda *_: act())
    return button


def _number(low: float, high: float, value: float, decimals: int = 3) -> Any:
    field = _narrow(QtGui.QDoubleSpinBox())
    field.setRange(low, high)
    field.setDecimals(decimals)
    field.setValue(value)
    return field


def _names(faces: tuple[Any, ...]) -> str:
    return ", ".join(face.name for face in faces) or translate("MichellCAD", "whole body")


def _amount(load: Load) -> str:
    vector = "(" + ", ".join(f"{x:g}" for x in load.vector) + ")"
    texts = {"pressure": f"{load.value:g} MPa", "torque": f"{load.value:g} N mm, {vector}", "self_weight": vector}
    return texts.get(load.kind, f"{vector} N")
