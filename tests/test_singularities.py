"""Lemon, monstar and star: the chart has no singular line, so its families swap along seams and follow elsewhere.

The fields are those of `examples/paper/singularities.py`, whose classification is checked here.
"""

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from networks import check_network
from PIL import Image

from michell_cad.isocurves.trace import trace_isocurves
from michell_cad.metrics import shear_residual
from michell_cad.palette import COLOURS
from michell_cad.parametrization import ParametrizationOptions, count_double_wound_edges

NAMES = ("lemon", "monstar", "star")
CELLS = (16, 16, 1)


def load_example() -> ModuleType:
    file = Path(__file__).parents[1] / "examples" / "paper" / "singularities.py"
    spec = importlib.util.spec_from_file_location("singularities", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


EXAMPLE = load_example()


def principal_angle(stress: np.ndarray) -> np.ndarray:
    """Angle of the larger in-plane principal stress, defined up to pi."""
    return 0.5 * np.arctan2(2 * stress[:, 0, 1], stress[:, 0, 0] - stress[:, 1, 1])


@pytest.mark.parametrize(("name", "index", "rays"), [("lemon", 0.5, 1), ("monstar", 0.5, 3), ("star", -0.5, 3)])
def test_the_fields_have_the_singularities_they_are_named_after(name, index, rays):
    """Turns of the principal directions around the point, and rays from it along which they point to it.

    Delmarcelle and Hesselink 1994: with t = tan(angle of a ray), d t^3 + (c + 2 b) t^2 + (2 a - d) t - c = 0; the
    index is the sign of a d - b c over two. One ray and +1/2: lemon; three and +1/2: monstar; three and -1/2: star.
    """
    (a, b), (c, d) = EXAMPLE.FIELDS[name]
    assert 0.5 * np.sign(a * d - b * c) == index
    roots = np.roots([d, c + 2 * b, 2 * a - d, -c])
    assert (np.abs(roots.imag) < 1e-9).sum() == rays
    turn = 0.05 + np.linspace(0, 2 * np.pi, 2001)
    around = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    doubled = np.unwrap(2 * principal_angle(EXAMPLE.stress_at(name, around)))
    assert (doubled[-1] - doubled[0]) / (4 * np.pi) == pytest.approx(index)
    # A ray is a line through the point: it counts once, where the larger principal direction lies along it.
    along = np.sin(principal_angle(EXAMPLE.stress_at(name, around)) - turn)
    crossings = (np.sign(along[1:]) != np.sign(along[:-1])) & (np.abs(along[1:] - along[:-1]) < 0.1)
    assert crossings.sum() == rays


@pytest.fixture(scope="module", params=[False, True], ids=["equation 11", "following"])
def layouts(request) -> tuple[bool, dict]:
    mesh, options = EXAMPLE.plate_mesh(CELLS), ParametrizationOptions(0.1, request.param)
    return request.param, {name: EXAMPLE.follow_field(name, mesh, options) for name in NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_the_curves_are_sound(layouts, name):
    """No inverted tet, no doubly wound edge; degree 6; curves close or end on the boundary, at any resolution."""
    layout = layouts[1][name]
    p = layout.parametrization
    assert p.determinants.min() > 0
    assert count_double_wound_edges(p.mesh, p.phi) == 0
    check_network(layout.network)
    for resolution in (5.0, 33.0):
        check_network(trace_isocurves(p.mesh, p.levels(resolution)[0]))


@pytest.mark.parametrize("name", NAMES)
def test_the_curves_follow_the_stress_but_for_the_seams(layouts, name):
    """Away from the singular line 90 % of the plate has curves within 10 degrees of the principal directions.

    A chart cannot do without seams: once around the singular line the principal directions turn by half a turn, the
    curves by none, so that somewhere on every circle they are far apart.
    """
    following, results = layouts
    layout = results[name]
    mesh, tangents = layout.parametrization.mesh, layout.parametrization.tangents
    in_plane = [k for k in range(3) if np.abs(tangents[:, 2, k]).mean() < 0.5]
    assert len(in_plane) == 2
    assert np.abs(tangents[:, 2, in_plane]).max() < 0.2  # the third family stands on the plate
    angle = np.arctan2(tangents[:, 1, in_plane], tangents[:, 0, in_plane])
    relative = angle - principal_angle(layout.stress)[:, None]
    off = np.degrees(np.abs((relative + np.pi / 4) % (np.pi / 2) - np.pi / 4).max(1))
    radius = np.hypot(*mesh.centroids[:, :2].T)
    ring = (radius > 0.6) & (radius < 0.8)
    assert off[ring].max() > 15
    if following:
        assert np.mean(off[radius > 0.4] < 10) > 0.9
        assert shear_residual(mesh, layout.stress, tangents) < 0.1


def test_the_pictures(layouts, tmp_path, monkeypatch):
    monkeypatch.setattr(EXAMPLE, "PANEL", 120)
    monkeypatch.setattr(EXAMPLE, "CELLS", CELLS)
    EXAMPLE.draw("star", layouts[1]["star"], tmp_path / "star.png")
    picture = np.asarray(Image.open(tmp_path / "star.png")).astype(float) / 255
    right = picture[EXAMPLE.HEAD : EXAMPLE.HEAD + 120, -EXAMPLE.GAP - 120 : -EXAMPLE.GAP]
    for family in ("tension", "third"):
        assert (np.abs(right - COLOURS[family]).max(2) < 0.12).sum() > 50
