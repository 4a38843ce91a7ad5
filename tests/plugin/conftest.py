"""What the tests of add-ins share."""

collect_ignore_glob = ["freecad_*.py", "cq_editor_*.py"]
"""Scripts for a host: only its own Python can import them."""
