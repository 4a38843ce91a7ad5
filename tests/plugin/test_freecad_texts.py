"""Every text of the FreeCAD workbench can be translated, and is, into German."""

import ast
import re
from string import Formatter

import pytest
from freecad_translations import FOLDER, TRANSLATIONS, collect, is_translated, main, read

GERMAN = TRANSLATIONS / "MichellCAD_de.ts"

NO_TEXTS = (
    "User parameter:",  # a path of FreeCAD's preferences
    "python3 -m venv",  # what is typed
    r"\(\*\.",  # kinds of files
    " N mm, ",  # units
    "^as designed$",  # a value of a property, which documents save
    r" 0: not set\.|: as ",  # parts of tooltips, which are translated as wholes
)
"""What has a space and is no text for the eye, as patterns."""


def untranslated(code: str) -> list[str]:
    """Strings with a space that are neither docstrings nor marked for translation."""
    tree = ast.parse(code)
    known: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr):
            known.add(id(node.value))
        if is_translated(node):
            known |= {id(argument) for argument in node.args}
    texts = [
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in known
    ]
    return [text for text in texts if " " in text.strip() and not any(re.search(p, text) for p in NO_TEXTS)]


@pytest.mark.parametrize("file", sorted(FOLDER.rglob("*.py")), ids=lambda file: file.stem)
def test_every_text_can_be_translated(file):
    assert untranslated(file.read_text(encoding="utf-8")) == []


def test_a_text_that_cannot_be_is_found():
    assert untranslated('"""A docstring here."""\nlabel.setText("Compute the truss")') == ["Compute the truss"]
    assert untranslated('label.setText(translate("MichellCAD", "Compute the truss"))') == []


def test_german_is_complete():
    texts, german = collect(), read(GERMAN)
    assert len(texts) > 80
    missing = [text for _, text in texts if not any(german.get((c, t)) for c, t in texts if t == text)]
    assert missing == [], "translate these in MichellCAD_de.ts and run plugin/freecad_translations.py"
    assert set(german) == set(texts), "run plugin/freecad_translations.py"
    for (_, source), translation in german.items():
        fields = [{name for _, name, _, _ in Formatter().parse(text) if name} for text in (source, translation)]
        assert fields[0] == fields[1], source


def test_what_is_compiled_is_what_is_written():
    core = pytest.importorskip("PyQt5.QtCore", reason="PyQt5 is not installed; it comes with CQ-editor")
    translator = core.QTranslator()
    assert translator.load(str(GERMAN.with_suffix(".qm")))
    for (context, source), translation in read(GERMAN).items():
        assert translator.translate(context, source) == translation


def test_new_texts_wait_unfinished_and_old_ones_go(tmp_path, monkeypatch):
    file = tmp_path / "MichellCAD_xx.ts"
    file.write_text(GERMAN.read_text().replace("<source>Compute truss</source>", "<source>Reckon truss</source>"))
    monkeypatch.setattr("freecad_translations.TRANSLATIONS", tmp_path)
    monkeypatch.setattr("freecad_translations.shutil.which", lambda name: None)
    with pytest.raises(SystemExit, match="qttools5-dev-tools"):
        main()
    kept = read(file)
    assert ("MichellCAD", "Compute truss") not in kept
    assert ("MichellCAD", "Reckon truss") not in kept
    assert len(kept) == len(read(GERMAN)) - 1
