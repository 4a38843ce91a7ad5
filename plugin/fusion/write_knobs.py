"""Write the knob table of michell_cad into the add-in: run this after a change of `michell_cad.knobs.Knobs`."""

import json
from pathlib import Path

from michell_cad.knobs import Knobs

SCHEMA_FILE = Path(__file__).parent / "MichellTruss" / "knobs.json"


def schema_text() -> str:
    """The JSON Schema of the knobs as the add-in ships it."""
    return json.dumps(Knobs.model_json_schema(), indent=1) + "\n"


if __name__ == "__main__":
    SCHEMA_FILE.write_text(schema_text(), encoding="utf-8")
