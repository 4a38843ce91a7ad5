"""Translation: every text that a designer sees goes through `translate`, as Qt's lupdate finds it."""

try:
    from FreeCAD import Qt

    translate = Qt.translate
except ImportError:  # outside FreeCAD, in tests

    def translate(context: str, text: str) -> str:
        """The text itself."""
        return text
