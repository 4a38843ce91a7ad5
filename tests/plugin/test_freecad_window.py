"""The workbench in FreeCAD's window, on a screen that nobody sees (Xvfb)."""

import json
from pathlib import Path

import numpy as np
import pytest
from hosts import alike, exercised, find_freecad, freecad_home, need_screen, run_on_screen
from PIL import Image

from michell_cad.knobs import FAMILY_ORDER
from michell_cad.palette import COLOURS

HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def window(tmp_path_factory) -> tuple[dict, np.ndarray]:
    folder = tmp_path_factory.mktemp("window")
    program = find_freecad("freecad")
    need_screen()
    environment = freecad_home(folder) | {"WALK_FOLDER": str(folder)}
    done = run_on_screen([program, str(HERE / "freecad_window.py")], environment)
    exercised("FreeCAD with a window")
    assert (folder / "window.json").is_file(), done.stdout[-2000:] + done.stderr[-2000:]
    found = json.loads((folder / "window.json").read_text())
    assert done.returncode == 0, found.get("error")
    return found, np.asarray(Image.open(folder / "window.png").convert("RGB")).astype(int)


def test_the_workbench_has_its_commands(window):
    assert set(window[0]["commands"]) == {"Michell_New", "Michell_Edit", "Michell_Export", "Michell_SaveJob"}


def test_the_form_takes_picked_faces_and_asks_for_what_is_missing(window):
    found = window[0]
    assert "give: a support, a load" in found["told"][0]
    assert "Select one or more faces" in found["told"][1]
    assert len(found["told"]) == 2
    assert found["lists"] == ["Face1: xyz", "Face2: (0, 0, -500) N (main)"]
    assert found["materials"] > 3


def test_cancel_leaves_the_document(window):
    text, objects = window[0]["cancelled"]
    assert window[0]["computing"] >= 1
    assert "as it was" in text
    assert objects == ["Bar"]


def test_the_truss_takes_the_place_of_the_body_and_its_knob_turns(window):
    found = window[0]
    assert "has not been saved" in found["note"]
    assert found["knobs"]["entasis"] == 0.4
    assert not found["body_shown"]
    assert found["painted"]
    assert found["colours"] >= 4


def test_the_screen_shows_three_families(window):
    pixels = window[1].reshape(-1, 3)
    for name in FAMILY_ORDER:
        assert alike(pixels, COLOURS[name]) > 500, name


def test_the_form_speaks_german(window):
    german = window[0]["german"]
    assert german["buttons"] == ["Fachwerk berechnen", "Abbrechen", "Auftragsdatei speichern..."]
    assert german["title"] == "Michell-Fachwerk"
    assert german["body"] == "Körper: Bar"
    assert german["message"].startswith("Abgebrochen.")
