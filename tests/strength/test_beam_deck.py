import re
import shutil
import subprocess

import numpy as np
import pytest
from frames import STEEL, THREE_FRAMES, cube_frame, frame, loading

from michell_cad.errors import InvalidInputError
from michell_cad.strength import build_beam_model, solve_beams
from michell_cad.strength.beam_deck import write_beam_deck

needs_calculix = pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed")

LOAD = loading(8, range(4), {6: (10.0, 2.0, -30.0, 0, 0, 0)}, {5: (0, 0, -7.0, 0, 0, 0)})


def block(text: str, keyword: str) -> np.ndarray:
    """Numbers of the data lines after the first line that starts with a keyword."""
    body = re.search(rf"^\{keyword}.*\n((?:[^*].*\n)+)", text, re.M).group(1)
    return np.array([[float(x) for x in line.split(",")] for line in body.strip().split("\n")])


def test_a_deck_says_what_the_model_says(tmp_path):
    model = build_beam_model(cube_frame(0.2), STEEL, pieces=2)
    write_beam_deck(tmp_path / "frame.inp", model, LOAD, "B32")
    text = (tmp_path / "frame.inp").read_text()
    np.testing.assert_allclose(block(text, "*NODE, ")[:, 1:], model.nodes, rtol=1e-11)
    beams = re.findall(r"^\*ELEMENT, TYPE=B32,.*\n((?:\d.*\n)+)", text, re.M)
    numbers = [[int(x) for x in line.split(",")] for part in beams for line in part.strip().split("\n")]
    found = np.array(sorted(numbers))[:, 1:] - 1
    np.testing.assert_array_equal(found[:, [0, 2]], model.truss.members)
    np.testing.assert_array_equal(found[:, 1], np.arange(8, 21))
    np.testing.assert_array_equal(block(text, "*ELASTIC"), [[210000.0, 0.3]])
    np.testing.assert_array_equal(block(text, "*CLOAD"), [[7, 1, 10], [7, 2, 2], [7, 3, -30]])
    assert text.count("*STEP") == 2
    assert len(block(text, "*BOUNDARY")) == 24
    assert set(re.findall(r"SECTION=CIRC\n(.*)\n", text)) == {"0.2"}


def test_a_taper_gets_the_radius_of_its_flexibility(tmp_path):
    sized = frame([[0, 0, 0], [8, 0, 0]], [(0, 1)], np.array([[1.0, 2.0, 1.0]]))
    write_beam_deck(
        tmp_path / "taper.inp",
        build_beam_model(sized, STEEL, pieces=6),
        loading(2, [0], {1: (0, 1.0, 0, 0, 0, 0)}),
        "B32",
    )
    radii = sorted(float(r) for r in re.findall(r"SECTION=CIRC\n(.*)\n", (tmp_path / "taper.inp").read_text()))
    assert len(radii) == 2
    assert 1 < radii[0] < 1.5 < radii[1] < 2


def displacements(folder, cases: int) -> np.ndarray:
    """What CalculiX finds for the deck `frame.inp`, (n_c, n_n, 3 or 6)."""
    subprocess.run(["ccx", "frame"], cwd=folder, check=True, capture_output=True, timeout=60)
    tables = re.findall(r"displacements.*\n\s*\n((?:\s+\d+.*\n)+)", (folder / "frame.dat").read_text())
    assert len(tables) == cases
    return np.array([[[float(x) for x in row.split()[1:]] for row in t.strip().split("\n")] for t in tables])


@needs_calculix
@pytest.mark.parametrize("name", THREE_FRAMES)
def test_against_beams_of_calculix(name, tmp_path):
    """Displacements and rotations of every node to the seven digits that CalculiX prints."""
    sized, load = THREE_FRAMES[name]
    model = build_beam_model(sized, STEEL, shear_coefficient=np.inf)
    write_beam_deck(tmp_path / "frame.inp", model, load, "U1")
    expected = solve_beams(model, load).displacements
    found = displacements(tmp_path, len(load.names))
    for case in range(len(load.names)):
        for part in (slice(0, 3), slice(3, 6)):
            u = expected[case, :, part]
            np.testing.assert_allclose(found[case, :, part], u, rtol=0, atol=1e-6 * np.abs(u).max())


@needs_calculix
def test_against_expanded_beams_of_calculix(tmp_path):
    """They are expanded into solid elements: 1.4 per cent off with two of them along each bar, 0.5 with four."""
    sized, load = THREE_FRAMES["tower"]
    errors = []
    for pieces in (4, 8):
        model = build_beam_model(sized, STEEL, pieces=pieces)
        write_beam_deck(tmp_path / "frame.inp", model, load)
        expected = solve_beams(model, load).displacements[:, :, :3]
        errors.append(np.abs(displacements(tmp_path, 1) - expected).max() / np.abs(expected).max())
    assert errors[1] < 0.006
    assert errors[1] < errors[0] / 2


def test_an_odd_number_of_pieces_is_refused(tmp_path):
    with pytest.raises(InvalidInputError, match="an even number of pieces; 13 members have an odd one"):
        write_beam_deck(tmp_path / "x.inp", build_beam_model(cube_frame(), STEEL), LOAD)
    assert not (tmp_path / "x.inp").exists()
