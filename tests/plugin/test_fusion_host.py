"""The Fusion add-in under a recording fake: which calls it makes, in which order, with which numbers.

Nothing here has run inside Fusion: the fake proves names, arguments, classes and the plan, not the geometry.
"""

import importlib
import json
from collections import Counter

import pytest
from fusion_fake import Fake, WrongCall, walk
from fusion_layouts import write_layout
from fusion_stubs import find_dummies, read_classes
from hosts import exercised
from MichellTruss.logic.knobs import read_knobs
from MichellTruss.logic.layout import read_layout
from MichellTruss.logic.plan import LARGEST_TIMELINE, make_plan
from MichellTruss.logic.selection import apply_knobs

from michell_cad.knobs import Knobs

DRAW, EDIT, MATERIAL, STEP = "MichellTrussDraw", "MichellTrussEdit", "MichellTrussMaterial", "MichellTrussStep"
APPEARANCES, MATERIALS = "BA5EE55E-9982-449B-9D66-9F036540E140", "C1EEA57C-3F56-45FC-B8CB-A9EC46A9994C"


@pytest.fixture(scope="module")
def classes():
    dummies = find_dummies()
    if dummies is None:
        pytest.skip("the package adsk is not installed: pip install '.[test]'")
    return read_classes(dummies)


class Session:
    """Fusion with a design, and the add-in running in it; commands are started as its buttons do."""

    def __init__(self, fake: Fake, folder) -> None:
        self.fake, self.folder = fake, folder
        core = fake.modules["adsk.core"]
        types = fake.made["DesignTypes"]
        self.design = fake.new("Design", None, designType=types.ParametricDesignType)
        vars(fake.application)["state"]["activeProduct"] = self.design
        self.ui = fake.application.userInterface
        workspace = fake.new("Workspace", None, id="FusionSolidEnvironment")
        items(self.ui.workspaces).append(workspace)
        items(workspace.toolbarTabs).append(fake.new("ToolbarTab", None, id="SolidTab"))
        self.panels = items(workspace.toolbarTabs)[0].toolbarPanels
        self._library("appearances", APPEARANCES, fake.new("Appearance", None, id="Prism-093", name="Powder Coat"))
        self._library("materials", MATERIALS, fake.new("Material", None, id="m", name="Steel"))
        fake.answers["FileDialog.showOpen"] = core.DialogResults.DialogOK
        fake.answers["UserInterface.messageBox"] = core.DialogResults.DialogOK
        self.addin = importlib.import_module("MichellTruss.MichellTruss")
        self.features = importlib.import_module("MichellTruss.host.features")
        self.addin.run(None)

    def _library(self, kind: str, name: str, content) -> None:
        libraries = items(self.fake.application.materialLibraries)
        libraries.append(self.fake.new("MaterialLibrary", None, id=name))
        items(getattr(libraries[-1], kind)).append(content)

    def choose(self, path) -> None:
        """The file that the designer chooses in every file dialog from now on."""
        self.fake.answers["UserInterface.createFileDialog"] = self.fake.new("FileDialog", None, filename=str(path))

    def start(self, command: str):
        """Press a button; return the command with its dialog."""
        definition = self.ui.commandDefinitions.itemById(command)
        started = self.fake.new("Command", definition)
        self.fire(definition.commandCreated, self.fake.new("CommandCreatedEventArgs", None, command=started))
        return started

    def fire(self, event, args):
        """Call the handlers of an event."""
        for handler in items(event):
            handler.notify(args)
        return args

    def press_ok(self, command):
        """Validate, preview and execute a command; return the arguments of the last."""
        valid = self.fire(command.validateInputs, self.fake.new("ValidateInputsEventArgs", None, areInputsValid=True))
        if valid.areInputsValid:
            self.fire(command.executePreview, self.fake.new("CommandEventArgs", None))
            return self.fire(command.execute, self.fake.new("CommandEventArgs", None))
        return None

    def draw(self, knobs: Knobs):
        """Draw the curved truss with knobs; return the plan that it should follow."""
        self.choose(write_layout(self.folder / "truss.json"))
        command = self.start(DRAW)
        self.turn(command, **knobs.model_dump(mode="json"))
        args = self.press_ok(command)
        assert args is not None, self.message(command)
        assert not args.executeFailed, args.executeFailedMessage
        layout = read_layout(self.folder / "truss.json")
        return make_plan(layout, apply_knobs(layout, knobs.model_dump(mode="json")))

    def turn(self, command, **values) -> None:
        """Set widgets of a knob dialog, given in the units of the knobs."""
        inputs = command.commandInputs
        for name, value in values.items():
            widget = inputs.itemById(f"michell_{name}")
            if type(widget).__name__ == "GroupCommandInput":
                each = value if isinstance(value, list) else [value] * 3
                for spinner, number in zip(items(widget.children), each, strict=True):
                    spinner.value = number
            elif type(widget).__name__ == "DropDownCommandInput":
                for item in items(widget.listItems):
                    item.isSelected = value == "all" or item.name in ([value] if isinstance(value, str) else value)
            else:
                widget.value = 0.0 if value is None else value / 10 if widget.unitType == "mm" else value

    def message(self, command) -> str:
        """The text below the widgets."""
        return command.commandInputs.itemById("michell_message").formattedText

    def shown(self) -> list[str]:
        """The texts of all message boxes."""
        return [call.arguments[0] for call in self.fake.calls("UserInterface.messageBox")]

    def truss(self):
        """The component of the only truss."""
        (occurrence,) = items(self.design.rootComponent.occurrences)
        return occurrence.component

    def parameter(self, name: str):
        """A user parameter of the design."""
        return self.design.userParameters.itemByName(name)


def items(collection) -> list:
    """What a fake collection keeps."""
    return vars(collection)["items"]


@pytest.fixture
def session(classes, monkeypatch, tmp_path):
    fake = Fake(classes)
    fake.install(monkeypatch)
    exercised("Fusion (a fake)")
    return Session(fake, tmp_path)


def test_run_and_stop_leave_nothing(session):
    definitions = session.ui.commandDefinitions
    assert {definition.id for definition in items(definitions)} == {DRAW, EDIT, MATERIAL, STEP}
    (panel,) = items(session.panels)
    assert panel.controls.count == 4
    session.addin.stop(None)
    assert definitions.count == 0
    assert session.panels.count == 0
    session.addin.run(None)
    assert definitions.count == 4
    assert not session.shown()


def test_swept_bodies_per_family_in_centimetres(session):
    plan = session.draw(Knobs(radius=0.5))
    bodies = {part.name.split()[-1]: items(part.bRepBodies) for part in walk(session.truss()) if part.bRepBodies.count}
    planned = Counter(tube.family for tube in plan.tubes)
    assert {family: len(found) for family, found in bodies.items()} == planned | {"nodes": len(plan.spheres)}
    assert {body.name for family in planned for body in bodies[family]} == {tube.name for tube in plan.tubes}
    assert len(session.fake.calls("SweepFeatures.add")) == len(plan.tubes)
    assert not session.fake.calls("LoftFeatures.add")
    radii = [call.arguments[1] for call in session.fake.calls("SketchCircles.addByCenterRadius")]
    assert radii == pytest.approx([0.05] * len(plan.tubes))
    expressions = {call.arguments[0] for call in session.fake.calls("Parameter.expression=")}
    smallest = "smallest_radius" in {knob.name for knob in read_knobs()}
    assert expressions == {"max(michell1_radius; michell1_smallest_radius)" if smallest else "michell1_radius"}
    spheres = session.fake.calls("TemporaryBRepManager.createSphere")
    assert [call.arguments[1] for call in spheres] == pytest.approx([1.8 * 0.05] * len(plan.spheres))
    assert session.truss().name == "Michell truss 1"


def test_splines_are_the_planned_ones(session):
    plan = session.draw(Knobs())
    curves = [call.arguments[0] for call in session.fake.calls("SketchFixedSplines.addByNurbsCurve")]
    assert len(curves) == len(plan.tubes)
    by_family = [tube for family in plan.families for tube in plan.tubes if tube.family == family]
    for curve, tube in zip(curves, by_family, strict=True):
        assert [(point.x, point.y, point.z) for point in curve.controlPoints] == list(tube.points)
        assert (curve.degree, tuple(curve.knots)) == (3, tube.knots)


def test_entasis_lofts_with_a_centre_line(session):
    plan = session.draw(Knobs(radius=0.5, entasis=0.4, family="tension"))
    lofts = [tube for tube in plan.tubes if not tube.is_sweep]
    assert len(session.fake.calls("LoftFeatures.add")) == len(lofts) > 0
    assert len(session.fake.calls("LoftCenterLineOrRails.addCenterLine")) == len(lofts)
    sections = [section for tube in lofts for section in tube.sections]
    assert len(session.fake.calls("LoftSections.add")) == len(sections)
    largest = max(call.arguments[1] for call in session.fake.calls("SketchCircles.addByCenterRadius"))
    assert largest == pytest.approx(max(section.radius for section in sections))
    assert 0.05 < largest <= 0.07 + 1e-9
    expressions = [call.arguments[0] for call in session.fake.calls("Parameter.expression=")]
    assert sum("michell1_radius * (1 + michell1_entasis * " in text for text in expressions) > len(lofts)


def test_knobs_become_user_parameters_and_a_custom_feature(session):
    plan = session.draw(Knobs(radius=0.5, every=[1, 2, 1]))
    assert session.parameter("michell1_radius").value == pytest.approx(0.05)
    assert session.parameter("michell1_radius").unit == "mm"
    assert session.parameter("michell1_entasis").unit == ""
    assert session.parameter("michell1_every_compression").value == 2
    described = {knob.name: knob.description for knob in read_knobs()}
    assert session.parameter("michell1_node_ratio").comment == described["node_ratio"]
    groups = session.fake.calls("CustomFeatures.add")
    assert len(groups) == len(plan.families) + 1
    bound = {call.arguments[2].stringValue for call in session.fake.calls("CustomFeatureInput.addCustomParameter")}
    assert bound == {parameter.name for parameter in items(session.design.userParameters)}
    assert session.features._definition.editCommandId == EDIT


def test_the_dialog_shows_the_schema(session):
    """Every knob, in order, with its bounds, unit, default and help text."""
    session.choose(write_layout(session.folder / "truss.json"))
    inputs = session.start(DRAW).commandInputs
    assert [one.id for one in items(inputs)] == [f"michell_{name}" for name in Knobs.model_fields] + ["michell_message"]
    for name, entry in Knobs.model_json_schema()["properties"].items():
        widget = inputs.itemById(f"michell_{name}")
        assert entry["description"] in widget.tooltip
        options = {option["type"]: option for option in entry.get("anyOf", [entry])}
        if "integer" in options:
            for spinner in items(widget.children):
                bounds = (spinner.minimumValue, spinner.maximumValue, spinner.value)
                assert bounds == (options["integer"]["minimum"], options["integer"]["maximum"], entry["default"])
        elif "number" in options:
            unit = {"1": "", "g": "g", "mm": "mm"}[entry["unit"]]
            assert widget.unitType == unit
            assert widget.value == pytest.approx((entry["default"] or 0) * (0.1 if unit == "mm" else 1))


def test_values_out_of_bounds_cannot_be_drawn(session):
    session.choose(write_layout(session.folder / "truss.json"))
    command = session.start(DRAW)
    for knob, value, says in (
        ("entasis", 9.0, "Entasis is 9: give at most 2"),
        ("radius", 3.0, "too large for cells of 6 mm"),
        ("radius", -1.0, "Radius is -1 mm: give more than 0 mm"),
        ("every", [100, 100, 100], "No curve is left"),
        ("family", [], "choose at least one of"),
    ):
        before = {name: entry for name, entry in Knobs().model_dump(mode="json").items()}
        session.turn(command, **before | {"offset": 50} | {knob: value})
        assert session.press_ok(command) is None
        assert says in session.message(command)
    assert not session.fake.calls("SweepFeatures.add")


def test_preview_draws_the_curves_in_their_colours(session):
    plan = session.draw(Knobs(family="third"))
    assert len(session.fake.calls("CustomGraphicsGroup.addCurve")) == len(plan.tubes)
    colours = [call.arguments[0].color for call in session.fake.calls("CustomGraphicsEntity.color=")]
    assert len(colours) == len(plan.tubes)
    assert (0, 158, 115) in {(colour.red, colour.green, colour.blue) for colour in colours}


def test_edit_draws_again_with_changed_parameters(session):
    session.draw(Knobs(radius=0.5))
    session.parameter("michell1_radius").value = 0.06
    session.parameter("michell1_every_tension").value = 2
    command = session.start(EDIT)
    assert command.commandInputs.itemById("michell_radius").value == pytest.approx(0.06)
    assert [spinner.value for spinner in items(command.commandInputs.itemById("michell_every").children)] == [2, 1, 1]
    session.turn(command, family=["tension", "third"])
    session.fake.log.clear()
    args = session.press_ok(command)
    assert not args.executeFailed, args.executeFailedMessage
    layout = read_layout(session.folder / "truss.json")
    values = Knobs(radius=0.6, every=[2, 1, 1], family=["tension", "third"]).model_dump(mode="json")
    plan = make_plan(layout, apply_knobs(layout, values))
    assert len(session.fake.calls("SweepFeatures.add")) == len(plan.tubes)
    assert len(session.fake.calls("Occurrence.deleteMe")) == 1
    names = [part.name for part in walk(session.truss())]
    assert names == [f"Michell truss 1{end}" for end in ("", *(f" {family}" for family in plan.families), " nodes")]
    assert not session.fake.calls("UserParameters.add")
    assert not session.fake.calls("Parameter.value="), "an expression of the designer would be lost"
    command = session.start(EDIT)
    session.turn(command, radius=0.7)
    session.press_ok(command)
    assert [call.arguments[0] for call in session.fake.calls("Parameter.value=")] == [pytest.approx(0.07)]


def test_changed_parameters_move_the_spheres(session):
    plan = session.draw(Knobs(radius=0.5))
    nodes = next(part for part in walk(session.truss()) if part.name.endswith("nodes"))
    feature = items(nodes.features.customFeatures)[0]
    session.parameter("michell1_radius").value = 0.1
    session.fake.log.clear()
    args = session.fake.new("CustomFeatureEventArgs", None, customFeature=feature)
    session.fire(session.features._definition.customFeatureCompute, args)
    updated = session.fake.calls("BaseFeature.updateBody")
    assert [call.arguments[1].volume for call in updated] == pytest.approx([0.18] * len(plan.spheres))
    session.parameter("michell1_radius").value = 0.9
    session.fire(session.features._definition.customFeatureCompute, args)
    assert len(session.fake.calls("StatusMessages.addError")) == 1
    assert len(session.fake.calls("BaseFeature.updateBody")) == len(plan.spheres)


def test_material_along_an_isosurface_outlives_an_edit(session):
    session.draw(Knobs())
    command = session.start(MATERIAL)
    surfaces = [item.name for item in items(command.commandInputs.itemById("michell_surface").listItems)]
    assert "across tension, level 2" in surfaces
    for item in items(command.commandInputs.itemById("michell_surface").listItems):
        item.isSelected = item.name == "across tension, level 2"
    args = session.press_ok(command)
    assert not args.executeFailed, args.executeFailedMessage

    def steel() -> set[str]:
        return {
            body.name.split(", part")[0]
            for part in walk(session.truss())
            for body in items(part.bRepBodies)
            if body.material.name == "Steel"
        }

    layout = read_layout(session.folder / "truss.json")
    axis = next(curve.isovalues.index(None) for curve in layout.curves if curve.name.startswith("tension ("))
    expected = {curve.name for curve in layout.curves if curve.isovalues[axis] == 2}
    assert steel() <= expected
    assert len(steel()) > 3
    session.press_ok(session.start(EDIT))
    assert steel() <= expected
    assert len(steel()) > 3


def test_a_large_layout_offers_the_step_beside_it(session, monkeypatch):
    plan_module = importlib.import_module("MichellTruss.logic.plan")
    monkeypatch.setattr(plan_module, "LARGEST_TIMELINE", 10)
    assert LARGEST_TIMELINE > 10
    session.choose(write_layout(session.folder / "truss.json"))
    (session.folder / "truss.step").write_text("ISO-10303-21;")
    session.fake.answers["UserInterface.messageBox"] = session.fake.made["DialogResults"].DialogYes
    args = session.press_ok(session.start(DRAW))
    assert not args.executeFailed
    (options,) = session.fake.calls("ImportManager.createSTEPImportOptions")
    assert options.arguments == (str(session.folder / "truss.step"),)
    (imported,) = session.fake.calls("ImportManager.importToTarget")
    assert imported.arguments[1] is session.design.rootComponent
    assert "Import the STEP now?" in session.shown()[-1]
    session.fake.answers["UserInterface.messageBox"] = session.fake.made["DialogResults"].DialogNo
    args = session.press_ok(session.start(DRAW))
    assert args.executeFailed
    assert "timeline entries" in args.executeFailedMessage
    assert not session.fake.calls("Occurrences.addNewComponent")


def test_handlers_live_as_long_as_their_command(session):
    """Fusion keeps no reference to them; and what a dialog holds must not outlive it."""
    events = importlib.import_module("MichellTruss.host.events")
    assert [len(handlers) for handlers in events._alive] == [5]
    session.choose(write_layout(session.folder / "truss.json"))
    first, second = session.start(DRAW), session.start(DRAW)
    assert [len(handlers) for handlers in events._alive] == [5, 4, 4]
    session.fire(first.destroy, session.fake.new("CommandEventArgs", None))
    assert [len(handlers) for handlers in events._alive] == [5, 4]
    session.fire(second.destroy, session.fake.new("CommandEventArgs", None))
    assert [len(handlers) for handlers in events._alive] == [5]


def test_step_of_the_whole_model(session):
    session.choose(session.folder / "model.step")
    args = session.press_ok(session.start(STEP))
    assert "model.step is not there any more" in args.executeFailedMessage
    (session.folder / "model.step").write_text("ISO-10303-21;")
    assert not session.press_ok(session.start(STEP)).executeFailed
    session.fake.answers["ImportManager.importToTarget"] = False
    assert "could not import model.step" in session.press_ok(session.start(STEP)).executeFailedMessage


def test_bad_input_is_answered_in_words(session):
    session.start(EDIT)
    assert "There is no truss in this design" in session.shown()[-1]
    path = write_layout(session.folder / "truss.json")
    path.write_text(json.dumps(json.loads(path.read_text()) | {"version": 2}))
    session.choose(path)
    session.start(DRAW)
    assert "written by a newer michell_cad" in session.shown()[-1]
    vars(session.design)["state"]["designType"] = session.fake.made["DesignTypes"].DirectDesignType
    session.start(DRAW)
    assert "Capture Design History" in session.shown()[-1]
    vars(session.fake.application)["state"]["activeProduct"] = session.fake.new("Product", None)
    session.start(DRAW)
    assert "No design is open" in session.shown()[-1]


def test_cancelling_and_faults_undo_the_command(session, monkeypatch):
    session.choose(write_layout(session.folder / "truss.json"))
    cancelled = session.fake.new("ProgressDialog", None, wasCancelled=True)
    session.fake.answers["UserInterface.createProgressDialog"] = cancelled
    args = session.press_ok(session.start(DRAW))
    assert args.executeFailed
    assert "Cancelled" in args.executeFailedMessage
    assert len(session.fake.calls("ProgressDialog.hide")) == 1
    drawing = importlib.import_module("MichellTruss.host.drawing")
    monkeypatch.setattr(drawing, "free_prefix", lambda design: 1 / 0)
    args = session.press_ok(session.start(DRAW))
    assert args.executeFailed
    assert "ZeroDivisionError" in session.shown()[-1]
    assert any("Traceback" in call.arguments[0] for call in session.fake.calls("Application.log"))


def test_choosing_no_file_ends_the_command(session):
    session.fake.answers["FileDialog.showOpen"] = session.fake.made["DialogResults"].DialogCancel
    command = session.start(DRAW)
    assert command.commandInputs.count == 0
    assert not session.shown()


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (lambda core, fusion, design: design.rootComponent.sketches.ad(None), "no attribute 'ad'"),
        (lambda core, fusion, design: core.Point3D.create(1.0, 2.0), "takes 3 to 3 arguments"),
        (lambda core, fusion, design: core.Point3D.create(1.0, 2.0, "3"), "z must be float"),
        (lambda core, fusion, design: core.Point3D.create(1.0, 2.0, depth=3.0), "takes 3 to 3"),
        (lambda core, fusion, design: setattr(design.rootComponent, "colour", "red"), "colour cannot be set"),
        (lambda core, fusion, design: setattr(design, "rootComponent", None), "rootComponent cannot be set"),
        (lambda core, fusion, design: setattr(design.rootComponent, "name", 3), "value must be str"),
        (lambda core, fusion, design: design.rootComponent.features.loftFeatures.createInput(3), "FeatureOperations"),
        (
            lambda core, fusion, design: design.rootComponent.features.loftFeatures.createInput(
                core.DialogResults.DialogYes
            ),
            "FeatureOperations",
        ),
        (lambda core, fusion, design: design.rootComponent.sketches.add(None), "planarEntity must be"),
        (
            lambda core, fusion, design: core.NurbsCurve3D.createNonRational(
                [core.Point3D.create(0.0, 0.0, 0.0)] * 4, 3, [0.0] * 7, False
            ),
            "control points",
        ),
    ],
)
def test_the_fake_refuses_what_fusion_would(session, wrong, says):
    with pytest.raises((WrongCall, AttributeError), match=says):
        wrong(session.fake.modules["adsk.core"], session.fake.modules["adsk.fusion"], session.design)
