"""The script for CQ-editor in CQ-editor itself, on a screen that nobody sees (Xvfb), and in its engine."""

import json
import os
import sys
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from cadquery import Assembly, cqgi
from designs import small_bar
from hosts import ROOT, alike, exercised, need_screen, run_on_screen
from PIL import Image

from michell_cad.building import build_united, size_finished
from michell_cad.design_file import save_design
from michell_cad.edits import NO_EDITS
from michell_cad.knobs import FAMILY_ORDER, Knobs
from michell_cad.palette import COLOURS

HERE = Path(__file__).parent
SCRIPT = (ROOT / "plugin/cq_editor/show_design.py").read_text(encoding="utf-8")

LIMIT = 300
"""Seconds that CQ-editor may take."""

PLAIN = 2e-3
"""Relative difference between the kernel's plain integral over splines and its adaptive one."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("cq_editor")
    save_design(folder / "design.npz", small_bar(), Knobs())
    return folder


@pytest.fixture(scope="module")
def window(folder) -> tuple[dict, np.ndarray]:
    if find_spec("cq_editor") is None:
        pytest.skip('CQ-editor is not installed (pip install ".[test]")')
    need_screen()
    script = folder / "show_design.py"
    script.write_text(SCRIPT.replace("bracket-truss/design.npz", str(folder / "design.npz")))
    environment = os.environ | {"HOME": str(folder), "PYTHONPATH": str(ROOT), "WALK_FOLDER": str(folder)}
    environment["PLUGIN_FOLDER"] = str(ROOT / "plugin/cq_editor")
    done = run_on_screen([sys.executable, str(HERE / "cq_editor_window.py"), str(script)], environment, LIMIT)
    assert (folder / "cq_editor.json").is_file(), done.stdout[-2000:] + done.stderr[-2000:]
    found = json.loads((folder / "cq_editor.json").read_text())
    assert done.returncode == 0, found.get("error")
    exercised("CQ-editor", version("CQ-editor"))
    return found, np.asarray(Image.open(folder / "cq_editor.png").convert("RGB")).astype(int)


def test_the_script_runs_in_the_window_and_runs_again_with_another_knob(window):
    shown, turned = window[0]["shown"], window[0]["turned"]
    assert (shown["said"], turned["said"]) == ("", "")
    assert shown["objects"] == turned["objects"] == ["truss"]
    assert 0.9 * shown["volume"] < turned["volume"] < shown["volume"]


def test_the_screen_shows_three_families(window):
    picture = window[1]
    assert picture.std() > 20
    for name in FAMILY_ORDER:
        assert alike(picture.reshape(-1, 3), COLOURS[name]) > 2000, name


def test_a_missing_design_is_said_in_the_traceback_pane(window):
    assert "InvalidInputError</b>: no design file" in window[0]["missing"]["said"]


def test_the_engine_turns_the_knobs_by_their_constants(folder):
    values = {"design_file": str(folder / "design.npz"), "radius": 0.9, "entasis": 0.3, "every": 2}
    built = cqgi.parse(SCRIPT).build(values)
    assert built.success, built.exception
    (shown,) = built.results
    assert isinstance(shown.shape, Assembly)
    structure = NO_EDITS.replay(small_bar(), Knobs(radius=0.9, entasis=0.3, every=2))
    ours = build_united(structure, size_finished(structure), lambda stage, fraction: None).report.volume_mm3
    assert shown.shape.toCompound().Volume() == pytest.approx(ours, rel=PLAIN)
