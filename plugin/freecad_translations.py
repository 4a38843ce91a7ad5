"""Collect the texts of the FreeCAD workbench into its translation files and compile these: `python FILE`.

Texts are those in calls of `translate` and `QT_TRANSLATE_NOOP`, those of the forms made by Qt's designer, and the
tooltips that properties get from the schema of the knobs. A new text is added as unfinished, one that is gone is taken
out. Compiling needs `lrelease` (Debian: qttools5-dev-tools). Qt's own `lupdate` does not read Python.
"""

import ast
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

from michell_cad.knobs import Knobs

FOLDER = Path(__file__).parent / "freecad"
TRANSLATIONS = FOLDER / "resources" / "translations"
PROPERTIES = "App::Property"
"""Context in which FreeCAD translates the tooltips of properties."""

Text = tuple[str, str]
"""Context and source text."""


def collect() -> list[Text]:
    """All texts of the workbench, each once."""
    found: dict[Text, None] = {}
    for file in sorted(FOLDER.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if is_translated(node):
                found[ast.literal_eval(node.args[0]), ast.literal_eval(node.args[1])] = None
    for file in sorted(FOLDER.rglob("*.ui")):
        form = ET.parse(file).getroot()
        for text in form.iter("string"):
            found[form.findtext("class", ""), text.text or ""] = None
    found |= {(PROPERTIES, text): None for text in knob_tooltips()}
    return list(found)


def is_translated(node: ast.AST) -> bool:
    """Whether this is a call that marks a text for translation."""
    if not isinstance(node, ast.Call):
        return False
    name = getattr(node.func, "id", getattr(node.func, "attr", ""))
    return name in ("translate", "QT_TRANSLATE_NOOP") and len(node.args) == 2


def knob_tooltips() -> list[str]:
    """The tooltips of the properties that are knobs."""
    sys.path.insert(0, str(FOLDER))
    from michell_workbench.knob_properties import properties_of

    return [p.help for p in properties_of(Knobs.model_json_schema()["properties"])]


def read(file: Path) -> dict[Text, str]:
    """The finished translations of a file."""
    return {
        (context.findtext("name", ""), message.findtext("source", "")): message.findtext("translation") or ""
        for context in ET.parse(file).getroot().iter("context")
        for message in context.iter("message")
        if message.find("translation[@type]") is None
    }


def write(file: Path, language: str, texts: list[Text], translations: dict[Text, str]) -> None:
    """Write a translation file."""
    root = ET.Element("TS", version="2.1", language=language, sourcelanguage="en")
    for name in dict.fromkeys(context for context, _ in texts):
        context = ET.SubElement(root, "context")
        ET.SubElement(context, "name").text = name
        for source in (source for owner, source in texts if owner == name):
            message = ET.SubElement(context, "message")
            ET.SubElement(message, "source").text = source
            done = translations.get((name, source), "")
            ET.SubElement(message, "translation", {} if done else {"type": "unfinished"}).text = done
    ET.indent(root)
    text = ET.tostring(root, encoding="unicode")
    file.write_text(f'<?xml version="1.0" encoding="utf-8"?>\n<!DOCTYPE TS>\n{text}\n', encoding="utf-8")


def main() -> None:
    """Bring every translation file up to date and compile it."""
    texts = collect()
    for file in sorted(TRANSLATIONS.glob("*.ts")):
        write(file, file.stem.partition("_")[2], texts, read(file))
        compiler = shutil.which("lrelease")
        if compiler is None:
            sys.exit("lrelease is not installed (Debian: apt-get install qttools5-dev-tools)")
        subprocess.run([compiler, str(file), "-qm", str(file.with_suffix(".qm"))], check=True)


if __name__ == "__main__":
    main()
