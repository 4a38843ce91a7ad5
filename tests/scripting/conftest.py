"""What the tests of scripts share: a loaded bar, whose stages are computed once."""

from collections.abc import Iterator

import pytest

BAR = {"supports": "<X", "loads": (">X", (0, 0, -500)), "resolution": 4, "mesh_size": 10.0}
"""A bar of 80 x 40 x 40 mm about the origin: held on the left, pulled down on the right, with large cells."""


@pytest.fixture(scope="session")
def stage_folder(tmp_path_factory) -> str:
    return str(tmp_path_factory.mktemp("stages"))


@pytest.fixture(autouse=True, scope="module")
def kept_stages(stage_folder) -> Iterator[None]:
    """Both programs find the stages of the bar again, as scripts of a designer do."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MICHELL_CAD_CACHE", stage_folder)
        yield


@pytest.fixture(scope="session")
def bar() -> dict:
    return dict(BAR)


@pytest.fixture
def no_stage(monkeypatch) -> None:
    """Let every numerical stage fail, so that a test shows that none is run."""

    def fail(*values, **named):
        raise AssertionError("a stage was computed again")

    for name in ("solve_elasticity", "fit_frame_field", "parametrize", "trace_isocurves", "clean_network"):
        monkeypatch.setattr(f"michell_cad.pipeline.{name}", fail)
