"""Translation: every text that a designer sees goes through `translate`, or waits for FreeCAD to translate it."""

try:
    from FreeCAD import Qt

    translate = Qt.translate
except ImportError:  # outside FreeCAD, in tests

    def translate(context: str, text: str) -> str:
        """The text itself."""
        return text


def QT_TRANSLATE_NOOP(context: str, text: str) -> str:
    """The text itself, which FreeCAD translates when it shows it (tooltips of properties)."""
    return text
