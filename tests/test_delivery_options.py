from typing import Any

import pytest

from michell_cad.delivery import design_options
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
