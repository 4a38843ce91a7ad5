"""The add-in MichellTruss for Autodesk Fusion: `run` puts its commands into the Solid tab, `stop` takes them away."""

from typing import Any

from . import commands
from .host import events, features


def run(context: Any) -> None:
    """Called by Fusion when the add-in starts."""
    try:
        features.start()
        commands.start()
    except Exception:  # noqa: BLE001 the border to the host: whatever goes wrong is shown, not lost
        events.show_fault()


def stop(context: Any) -> None:
    """Called by Fusion when the add-in stops."""
    try:
        commands.stop()
        features.stop()
        events.forget()
    except Exception:  # noqa: BLE001 see run
        events.show_fault()
