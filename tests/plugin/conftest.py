"""What the tests of add-ins share; the run ends with the hosts that were really exercised."""

from hosts import EXERCISED, HOSTS

collect_ignore_glob = ["freecad_*.py", "cq_editor_*.py"]
"""Scripts for a host: only its own Python can import them."""


def pytest_terminal_summary(terminalreporter):
    """Say which hosts the tests have run."""
    terminalreporter.write_line("hosts really exercised:")
    for host in HOSTS:
        terminalreporter.write_line(f"  {host:26s}{f'yes {EXERCISED[host]}' if host in EXERCISED else 'NO'}".rstrip())
