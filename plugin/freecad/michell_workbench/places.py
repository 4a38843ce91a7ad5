"""Where the add-in's own files are."""

from pathlib import Path

HOME = Path(__file__).resolve().parents[1]
RESOURCES = HOME / "resources"
TRANSLATIONS = RESOURCES / "translations"


def icon(name: str) -> str:
    """Path of an icon."""
    return str(RESOURCES / "icons" / f"{name}.svg")
