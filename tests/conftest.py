"""Fixtures for all tests; the run ends with the hosts that were really exercised."""

import os
from pathlib import Path

import pytest
from hosts import EXERCISED, HOSTS


def pytest_sessionfinish(session):
    """A worker of pytest-xdist tells the run as a whole which hosts its tests have run."""
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput["hosts"] = EXERCISED


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node):
    """Hear from a worker that has finished (or died, and tells nothing)."""
    EXERCISED.update(getattr(node, "workeroutput", {}).get("hosts", {}))


def pytest_terminal_summary(terminalreporter):
    """Say which hosts the tests have run."""
    terminalreporter.write_line("hosts really exercised:")
    for host in HOSTS:
        terminalreporter.write_line(f"  {host:26s}{f'yes {EXERCISED[host]}' if host in EXERCISED else 'NO'}".rstrip())


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
