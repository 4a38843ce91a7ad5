"""Type stubs of Fusion's Python interface, made from the dummy classes of the PyPI package `adsk`.

The dummies (2.0.12157, early 2022) carry names, argument classes and docstrings of every member, and nothing else. Made
stricter and closer to Fusion where the dummies say less than they know:

1. A constant of an enumeration has the enumeration as its class, so that one enumeration cannot pass for another.
2. An argument whose text calls it optional, or speaks of a default, may be left out; so may those of `LEFT_OUT`, of
   which only the samples of Autodesk show that they may be.
3. What returns an object "or null" when asked for by name, id or cast returns None as well.
4. A setter and its getter become one property; a property without setter is read-only.
"""

import ast
import importlib.util
import re
from dataclasses import dataclass
from pathlib import Path

MODULES = ("core", "fusion")

LEFT_OUT = {
    ("Sketches", "add", "occurrenceForCreation"),
    ("ConstructionPlanes", "createInput", "occurrenceForCreation"),
}
"""Optional arguments whose text does not say so."""

_OPTIONAL = re.compile(r"\boptional\b|\bdefault value\b", re.IGNORECASE)
_LOOK_UPS = ("itemByName", "itemById", "cast")


@dataclass(frozen=True)
class Argument:
    """An argument of a method: name, class as written, and whether it may be left out."""

    name: str
    kind: str
    optional: bool


@dataclass(frozen=True)
class Method:
    """A method: arguments without self, class of what it returns as written, and whether it is static."""

    arguments: tuple[Argument, ...]
    returns: str
    static: bool


@dataclass(frozen=True)
class Class:
    """A class of the interface. Constants make it an enumeration; `writable` names the properties with a setter."""

    module: str
    name: str
    base: str | None
    methods: dict[str, Method]
    properties: dict[str, str]
    writable: frozenset[str]
    constants: dict[str, int]


def find_dummies() -> Path | None:
    """The folder of the package `adsk`, or None where it is not installed."""
    found = importlib.util.find_spec("adsk")
    return None if found is None or found.origin is None else Path(found.origin).parent


def read_classes(dummies: Path) -> list[Class]:
    """All classes of the dummies, in the order of their files."""
    trees = {module: ast.parse((dummies / f"{module}.py").read_text(encoding="utf-8")) for module in MODULES}
    return [_class(module, node) for module in MODULES for node in trees[module].body if isinstance(node, ast.ClassDef)]


def write_stubs(classes: list[Class], folder: Path) -> None:
    """Write `adsk/__init__.pyi`, `adsk/core.pyi` and `adsk/fusion.pyi` into a folder."""
    package = folder / "adsk"
    package.mkdir(parents=True)
    (package / "__init__.pyi").write_text("def doEvents() -> None: ...\n")
    for module in MODULES:
        lines = ["from __future__ import annotations", "from . import core" if module == "fusion" else "", ""]
        for one in classes:
            if one.module == module:
                lines += _stub(one)
        (package / f"{module}.pyi").write_text("\n".join(lines) + "\n")


def _class(module: str, node: ast.ClassDef) -> Class:
    methods, properties, writable, constants = {}, {}, set(), {}
    for part in node.body:
        if isinstance(part, ast.Assign) and isinstance(part.targets[0], ast.Name):
            value = ast.literal_eval(part.value)
            if isinstance(value, int):
                constants[part.targets[0].id] = value
        elif isinstance(part, ast.FunctionDef) and part.name != "__init__":
            decorators = [ast.unparse(decorator) for decorator in part.decorator_list]
            if "property" in decorators:
                properties[part.name] = ast.unparse(part.returns) if part.returns else "None"
            elif f"{part.name}.setter" in decorators:
                writable.add(part.name)
            else:
                methods[part.name] = _method(node.name, part, "staticmethod" in decorators)
    base = ast.unparse(node.bases[0]) if node.bases else None
    return Class(module, node.name, base, methods, properties, frozenset(writable), constants)


def _method(owner: str, part: ast.FunctionDef, static: bool) -> Method:
    texts = dict(re.findall(r"^\s*(\w+) : (.*(?:\n(?!\s*\w+ : ).*)*)", ast.get_docstring(part) or "", re.MULTILINE))
    arguments = [
        Argument(
            argument.arg,
            ast.unparse(argument.annotation) if argument.annotation else "object",
            bool(_OPTIONAL.search(texts.get(argument.arg, ""))) or (owner, part.name, argument.arg) in LEFT_OUT,
        )
        for argument in part.args.args[not static :]
    ]
    # Only trailing arguments can be left out.
    for place in reversed(range(len(arguments) - 1)):
        if arguments[place].optional and not arguments[place + 1].optional:
            arguments[place] = Argument(arguments[place].name, arguments[place].kind, False)
    returns = ast.unparse(part.returns) if part.returns else "None"
    return Method(tuple(arguments), returns, static)


def _stub(one: Class) -> list[str]:
    lines = [f"class {one.name}({one.base or ''}):"]
    lines += [f"    {name}: {one.name}" for name in one.constants]
    # A property may have the name of a class that later members speak of; methods first keeps those readable.
    for name, method in one.methods.items():
        arguments = [] if method.static else ["self"]
        arguments += [f"{a.name}: {a.kind}" + (" = ..." if a.optional else "") for a in method.arguments]
        returns = f"{method.returns} | None" if name in _LOOK_UPS and method.returns != "None" else method.returns
        lines += ["    @staticmethod"] * method.static + [f"    def {name}({', '.join(arguments)}) -> {returns}: ..."]
    for name, kind in one.properties.items():
        lines += ["    @property", f"    def {name}(self) -> {kind}: ..."]
        if name in one.writable:
            lines += [f"    @{name}.setter", f"    def {name}(self, value: {kind}) -> None: ..."]
    return [*lines, "    ...", ""]
