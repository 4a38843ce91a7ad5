"""A recording fake of Fusion: the modules `adsk`, `adsk.core` and `adsk.fusion`, from the same classes as the stubs.

It proves how the add-in calls Fusion, not what Fusion makes of it. Every call is checked and recorded:

1. Only members of the dummy classes exist; only properties with a setter can be set, and only to their class.
2. A call with too few or too many arguments, or with one of another class, raises `WrongCall`. None passes for nothing.
3. Collections keep what is added to them, under its name and id, and `deleteMe` takes it away; a look-up that finds
   nothing gives None, as Fusion does.
4. `BEHAVIOUR` adds what the add-in relies on: values of inputs, bodies of sweeps and lofts, profiles of circles.
"""

import importlib
import re
import sys
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any, NamedTuple

from fusion_stubs import Argument, Class, Method

HOST_PARTS = ("host", "commands", "MichellTruss")
"""Parts of the add-in that import `adsk`."""


class WrongCall(Exception):
    """A call that Fusion would refuse."""


class Call(NamedTuple):
    """A recorded call or setting: ``Class.member``, the object, and the arguments."""

    member: str
    owner: Any
    arguments: tuple[Any, ...]


class Constant(int):
    """A constant that remembers its enumeration."""

    enumeration: str


class Object:
    """Base of all fake classes; `state` holds property values, `items` what a collection keeps."""

    def __init__(self) -> None:
        vars(self).setdefault("state", {})
        vars(self).setdefault("items", [])
        vars(self).setdefault("parent_", None)

    def __setattr__(self, name: str, value: Any) -> None:
        member = getattr(type(self), name, None)
        if not name.startswith("_") and not (isinstance(member, property) and member.fset):
            raise WrongCall(f"{type(self).__name__}.{name} cannot be set")
        super().__setattr__(name, value)

    def up(self, name: str) -> Any:
        """The nearest object of a class above this one."""
        above = vars(self)["parent_"]
        while above is not None and type(above).__name__ != name:
            above = vars(above)["parent_"]
        return above


class Fake:
    """The fake modules, the classes in them, and the log of calls."""

    def __init__(self, classes: list[Class]) -> None:
        self.log: list[Call] = []
        self.made: dict[str, type] = {}
        self.told: dict[str, Class] = {one.name: one for one in classes}
        self.answers: dict[str, Any] = {}
        """What the designer answers, by ``Class.member``."""
        self.modules = {name: ModuleType(name) for name in ("adsk", "adsk.core", "adsk.fusion")}
        for name in self.told:
            self._make(name)
        for one in classes:
            setattr(self.modules[f"adsk.{one.module}"], one.name, self.made[one.name])
        self.modules["adsk"].__dict__.update(core=self.modules["adsk.core"], fusion=self.modules["adsk.fusion"])
        self.application = self.new("Application")

    def install(self, monkeypatch: Any) -> None:
        """Put the fake in the place of `adsk` for one test, with the add-in imported anew."""
        addin = importlib.import_module("MichellTruss")
        for part in HOST_PARTS:
            monkeypatch.delattr(addin, part, raising=False)
        for name in list(sys.modules):
            if name.startswith("MichellTruss.") and name.split(".")[1] in HOST_PARTS:
                monkeypatch.delitem(sys.modules, name)
        for name, module in self.modules.items():
            monkeypatch.setitem(sys.modules, name, module)

    def new(self, kind: str, parent: Object | None = None, /, **state: Any) -> Any:
        """A new object of a class."""
        created = self.made[kind].__new__(self.made[kind])
        Object.__init__(created)
        vars(created)["parent_"] = parent
        vars(created)["state"].update(state)
        return created

    def calls(self, pattern: str) -> list[Call]:
        """The recorded calls whose ``Class.member`` matches a pattern."""
        return [call for call in self.log if re.fullmatch(pattern, call.member)]

    def _make(self, name: str) -> type:
        if name in self.made:
            return self.made[name]
        one = self.told[name]
        base = self._make(one.base.split(".")[-1]) if one.base else Object
        members: dict[str, Any] = {"__module__": f"adsk.{one.module}"}
        for constant, value in one.constants.items():
            members[constant] = Constant(value)
            members[constant].enumeration = name
        for member, kind in one.properties.items():
            members[member] = self._property(name, member, kind, member in one.writable)
        for member, method in one.methods.items():
            call = self._method(name, member, method)
            members[member] = staticmethod(call) if method.static else call
        self.made[name] = type(name, (base,), members)
        return self.made[name]

    def _property(self, owner: str, member: str, kind: str, writable: bool) -> property:
        def get(this: Object) -> Any:
            behaviour = _behaviour(self, this, member)
            if behaviour:
                return behaviour(self, this)
            if member == "count":
                return len(vars(this)["items"])
            state = vars(this)["state"]
            if member not in state:
                state[member] = False if kind == "bool" else self._plain(kind, this)
            return state[member]

        def put(this: Object, value: Any) -> None:
            self._check(f"{owner}.{member}", "value", kind, value)
            self.log.append(Call(f"{owner}.{member}=", this, (value,)))
            vars(this)["state"][member] = value

        return property(get, put if writable else None)

    def _method(self, owner: str, member: str, method: Method) -> Callable[..., Any]:
        def call(*given: Any, **named: Any) -> Any:
            this, values = (None, given) if method.static else (given[0], given[1:])
            values = self._arguments(f"{owner}.{member}", method.arguments, values, named)
            self.log.append(Call(f"{owner}.{member}", this, values))
            if f"{owner}.{member}" in self.answers:
                return self.answers[f"{owner}.{member}"]
            if member == "cast":
                return values[0] if isinstance(values[0], self.made[owner]) else None
            behaviour = BEHAVIOUR.get(f"{owner}.{member}") if this is None else _behaviour(self, this, member)
            if behaviour:
                return behaviour(self, this, *values)
            return self._collect(this, member, method, values)

        return call

    def _collect(self, this: Any, member: str, method: Method, values: tuple[Any, ...]) -> Any:
        """What a method of a collection does, and else a new object of the class that it returns."""
        items = vars(this)["items"] if this is not None else []
        if member == "item":
            if not 0 <= values[0] < len(items):
                raise WrongCall(f"{type(this).__name__} has {len(items)} items, asked for number {values[0]}")
            return items[values[0]]
        if member in ("itemByName", "itemById"):
            key = "name" if member == "itemByName" else "id"
            return next((item for item in items if getattr(item, key) == values[-1]), None)
        if member == "deleteMe":
            vars(vars(this)["parent_"])["items"].remove(this)
            return True
        kind = method.returns.split(".")[-1]
        if kind not in self.told:
            if member.startswith("add") and len(values) == 1 and isinstance(values[0], Object):
                items.append(values[0])
            return self._plain(method.returns, this)
        named = dict(zip((argument.name for argument in method.arguments), values, strict=False))
        created = self.new(kind, this, **{k: v for k, v in named.items() if hasattr(self.made[kind], k)})
        if member.startswith("add"):
            items.append(created)
        return created

    def _arguments(
        self, member: str, arguments: tuple[Argument, ...], given: tuple[Any, ...], named: dict[str, Any]
    ) -> tuple[Any, ...]:
        least = sum(not argument.optional for argument in arguments)
        unknown = set(named) - {argument.name for argument in arguments[len(given) :]}
        if unknown or not least <= len(given) + len(named) <= len(arguments):
            raise WrongCall(f"{member} takes {least} to {len(arguments)} arguments, found {len(given)} and {named}")
        values = (*given, *(named[argument.name] for argument in arguments[len(given) :] if argument.name in named))
        for argument, value in zip(arguments, values, strict=False):
            self._check(member, argument.name, argument.kind, value)
        return values

    def _check(self, member: str, name: str, kind: str, value: Any) -> None:
        if not self._fits(kind, value):
            raise WrongCall(f"{member}: {name} must be {kind}, found {value!r}")

    def _fits(self, kind: str, value: Any) -> bool:
        if kind == "object":
            return True
        if kind.startswith("list["):
            return isinstance(value, list) and all(self._fits(kind[5:-1], one) for one in value)
        name = kind.split(".")[-1]
        if name in self.told:
            if self.told[name].constants:
                return isinstance(value, Constant) and value.enumeration == name
            return isinstance(value, self.made[name])
        if isinstance(value, bool):
            return name == "bool"
        return isinstance(value, {"float": (int, float), "int": int, "str": str, "bool": bool}[name])

    def _plain(self, kind: str, parent: Object | None) -> Any:
        """A value of a class where nothing else is said."""
        name = kind.split(".")[-1]
        if name in self.told and self.told[name].constants:
            return getattr(self.made[name], next(iter(self.told[name].constants)))
        if name in self.told:
            return self.new(name, parent)
        return {"str": "", "int": 0, "float": 0.0, "bool": True, "None": None}.get(name, [])


def _behaviour(fake: Fake, this: Object, member: str) -> Callable[..., Any] | None:
    names = (base.__name__ for base in type(this).__mro__ if base.__name__ in fake.told)
    return next((BEHAVIOUR[key] for key in (f"{name}.{member}" for name in names) if key in BEHAVIOUR), None)


def walk(component: Any) -> Iterator[Any]:
    """A component and all below it."""
    yield component
    for occurrence in vars(component.occurrences)["items"]:
        yield from walk(occurrence.component)


def _curve(fake: Fake, _: Any, points: list[Any], degree: int, knots: list[float], periodic: bool) -> Any:
    if len(knots) != len(points) + degree + 1 or sorted(knots) != knots:
        raise WrongCall(f"{len(points)} control points of degree {degree} do not go with the knots {knots}")
    return fake.new("NurbsCurve3D", None, controlPoints=points, degree=degree, knots=knots, isPeriodic=periodic)


def _distance_on_path(fake: Fake, this: Any, path: Any, distance: Any) -> bool:
    if not 0 <= distance.realValue <= 1:
        raise WrongCall(f"a distance on a path is from 0 to 1, found {distance.realValue}")
    return True


def _add_circle(fake: Fake, this: Any, centre: Any, radius: float) -> Any:
    circle = fake.new("SketchCircle", this, radius=radius)
    vars(this)["items"].append(circle)
    profiles = this.up("Sketch").profiles
    vars(profiles)["items"].append(fake.new("Profile", profiles))
    return circle


def _add_body_feature(kind: str) -> Callable[..., Any]:
    def add(fake: Fake, this: Any, given: Any) -> Any:
        if kind == "LoftFeature" and given.loftSections.count < 2:
            raise WrongCall("a loft needs two sections")
        component = this.up("Component")
        feature = fake.new(kind, this, parentComponent=component)
        body = fake.new("BRepBody", component.bRepBodies, parentComponent=component)
        vars(component.bRepBodies)["items"].append(body)
        vars(feature.bodies)["items"].append(body)
        vars(this)["items"].append(feature)
        return feature

    return add


def _add_body(fake: Fake, this: Any, body: Any, base: Any) -> Any:
    copy = fake.new("BRepBody", this, parentComponent=this.up("Component"))
    vars(this)["items"].append(copy)
    vars(base.bodies)["items"].append(copy)
    return copy


def _add_component(fake: Fake, this: Any, matrix: Any) -> Any:
    occurrence = fake.new("Occurrence", this)
    vars(this)["items"].append(occurrence)
    return occurrence


def _add_custom(fake: Fake, this: Any, given: Any) -> Any:
    feature = fake.new("CustomFeature", this, parentComponent=this.up("Component"))
    vars(this)["items"].append(feature)
    return feature


def _custom_range(fake: Fake, this: Any, first: Any, last: Any) -> bool:
    here = this.up("Component")
    if first.up("Component") is not here or last.up("Component") is not here:
        raise WrongCall("a custom feature groups features of its own component")
    return True


def _add_attribute(fake: Fake, this: Any, group: str, name: str, value: str) -> Any:
    there = _attribute(fake, this, group, name)
    if there is None:
        there = fake.new("Attribute", this, groupName=group, name=name)
        vars(this)["items"].append(there)
    vars(there)["state"]["value"] = value
    return there


def _attribute(fake: Fake, this: Any, group: str, name: str) -> Any:
    items = vars(this)["items"]
    return next((one for one in items if (one.groupName, one.name) == (group, name)), None)


def _add_input(kind: str, initial: int) -> Callable[..., Any]:
    def add(fake: Fake, this: Any, name: str, title: str, *rest: Any) -> Any:
        value = rest[initial]
        value = value.realValue if type(value).__name__ == "ValueInput" else value
        made = fake.new(kind, this, id=name, name=title, value=value, unitType=rest[0], isValidExpression=True)
        if kind == "IntegerSpinnerCommandInput":
            vars(made)["state"].update(minimumValue=rest[0], maximumValue=rest[1])
        vars(this)["items"].append(made)
        return made

    return add


def _add_list_item(fake: Fake, this: Any, name: str, selected: bool, icon: str, before: int) -> Any:
    item = fake.new("ListItem", this, name=name, isSelected=selected, index=len(vars(this)["items"]))
    vars(this)["items"].append(item)
    return item


def _copy_appearance(fake: Fake, this: Any, original: Any, name: str) -> Any:
    copy = fake.new("Appearance", this, name=name)
    vars(copy.appearanceProperties)["items"].append(fake.new("ColorProperty", copy))
    vars(this)["items"].append(copy)
    return copy


def _add_parameter(fake: Fake, this: Any, name: str, value: Any, units: str, comment: str) -> Any:
    made = fake.new("UserParameter", this, name=name, value=value.realValue, unit=units, comment=comment)
    vars(this)["items"].append(made)
    return made


def _add_control(fake: Fake, this: Any, definition: Any, beside: str, before: bool) -> Any:
    control = fake.new("CommandControl", this, id=definition.id, commandDefinition=definition)
    vars(this)["items"].append(control)
    return control


BEHAVIOUR: dict[str, Callable[..., Any]] = {
    "Application.get": lambda fake, _: fake.application,
    "Point3D.create": lambda fake, _, x, y, z: fake.new("Point3D", None, x=x, y=y, z=z),
    "ValueInput.createByReal": lambda fake, _, x: fake.new("ValueInput", None, realValue=x),
    "ValueInput.createByString": lambda fake, _, text: fake.new("ValueInput", None, stringValue=text),
    "Color.create": lambda fake, _, r, g, b, a: fake.new("Color", None, red=r, green=g, blue=b, opacity=a),
    "NurbsCurve3D.createNonRational": _curve,
    "TemporaryBRepManager.createSphere": lambda fake, _, centre, radius: fake.new("BRepBody", None, volume=radius),
    "ConstructionPlaneInput.setByDistanceOnPath": _distance_on_path,
    "Sketch.modelToSketchSpace": lambda fake, this, point: point,
    "SketchCircles.addByCenterRadius": _add_circle,
    "SweepFeatures.add": _add_body_feature("SweepFeature"),
    "LoftFeatures.add": _add_body_feature("LoftFeature"),
    "BRepBodies.add": _add_body,
    "Occurrences.addNewComponent": _add_component,
    "CustomFeatures.add": _add_custom,
    "CustomFeatureInput.setStartAndEndFeatures": _custom_range,
    "Attributes.add": _add_attribute,
    "Attributes.itemByName": _attribute,
    "CommandInputs.addValueInput": _add_input("ValueCommandInput", 1),
    "CommandInputs.addIntegerSpinnerCommandInput": _add_input("IntegerSpinnerCommandInput", 3),
    "CommandInputs.addBoolValueInput": _add_input("BoolValueCommandInput", 2),
    "DropDownCommandInput.selectedItem": lambda fake, this: next(
        item for item in vars(this.listItems)["items"] if item.isSelected
    ),
    "ListItems.add": _add_list_item,
    "UserParameters.add": _add_parameter,
    "ToolbarControls.addCommand": _add_control,
    "Appearances.addByCopy": _copy_appearance,
}
"""What the classes do beyond keeping what they are given."""
