from typing import Any

import cadquery as cq
import pytest

from michell_cad import delivery
from michell_cad.delivery import design_options
from michell_cad.domain import read_outline
from michell_cad.errors import InvalidInputError
from michell_cad.job import parse_job
from michell_cad.parametrization import ParametrizationOptions
from michell_cad.pipeline import DesignOptions


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ({}, DesignOptions()),
        ({"spacing": 5.0, "layers": "hug"}, DesignOptions(spacing=5.0, layers="hug")),
        (
            {"resolution": 9, "spacing_bounds": [0.5, 2.0], "spacing_weight": 1.0, "follow_stress": False},
            DesignOptions(9.0, parametrization=ParametrizationOptions(1.0, False, (0.5, 2.0))),
        ),
    ],
)
def test_every_option_of_a_job_reaches_its_stage(table: dict[str, Any], expected: DesignOptions):
    assert design_options(parse_job({"part": {"file": "x.npz"}, "options": table})) == expected


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"support": [{"faces": ["%CYLINDRE"]}]}, r"\[\[support\]\] 1: .*'%CYLINDRE' is not a CadQuery selector"),
        ({"load": [{"faces": 6, "force": [0, 0, -1]}]}, r"\[\[load\]\] 1: .*there is no face 6"),
        ({"material": {"name": "ABSS"}}, "unknown material 'ABSS'"),
        ({"keep": [{"faces": ">X", "depth": 100.0}]}, "keep"),
    ],
)
def test_mistakes_about_faces_are_found_before_the_part_is_meshed(tmp_path, monkeypatch, change, message):
    cq.exporters.export(cq.Workplane().box(40, 10, 10), str(tmp_path / "bar.step"))
    table = {"part": {"file": "bar.step"}, "support": [{"faces": "<X"}], "load": [{"faces": ">X", "force": [0, 0, -1]}]}
    monkeypatch.setattr(delivery, "mesh_outline", None)
    outline = read_outline(tmp_path / "bar.step")
    with pytest.raises(InvalidInputError, match=message):
        delivery.design_outline(outline, parse_job(table | change))
