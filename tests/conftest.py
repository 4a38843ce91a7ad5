"""Fixtures for all tests."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session", autouse=True)
def no_stage_cache():
    """Nothing that a test computes is found by another one; tests of the cache have folders of their own."""
    os.environ["MICHELL_CAD_CACHE"] = ""


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """The shared data (problems of the paper, reference layouts), which is no part of the project."""
    default = Path(__file__).parents[2] / "shared" / "data"
    folder = Path(os.environ.get("MICHELL_CAD_DATA", default))
    if not folder.is_dir():
        pytest.skip("the shared data is not here; set MICHELL_CAD_DATA to its folder")
    return folder
