"""Interfaces that stay solid, from the job to the edited design."""

from pathlib import Path

import cadquery as cq
import pytest

from michell_cad.cad import read_step_summary
from michell_cad.delivery import deliver_job
from michell_cad.delivery_edit import deliver_edit

JOB = """
[part]
file = "arm.step"
[mesh]
size = 5.0
[[support]]
faces = "%CYLINDER"
[[load]]
faces = ">X"
force = [0.0, 0.0, -100.0]
[options]
resolution = 5
[[keep]]
faces = "%CYLINDER"
depth = 3.0
[knobs]
every = 2
radius = 0.8
[output]
formats = ["step"]
preview = false
"""


def test_a_bolt_hole_is_kept_in_the_design_and_in_its_edits(tmp_path: Path) -> None:
    arm = cq.Workplane().box(60, 20, 20).faces(">Z").workplane().center(-18, 0).hole(8)
    cq.exporters.export(arm, str(tmp_path / "arm.step"))
    (tmp_path / "job.toml").write_text(JOB)
    report = deliver_job(tmp_path / "job.toml", tmp_path / "first")
    kept = report["solid"]["kept"]
    assert list(kept["names"]) == ["keep 1"]
    edited = deliver_edit(tmp_path / "first", tmp_path / "second", {"radius": 0.6})
    again = edited["solid"]["kept"]
    assert again["volume_mm3"] == pytest.approx(kept["volume_mm3"], rel=1e-6)
    for name, one in (("first", report), ("second", edited)):
        read = read_step_summary(tmp_path / name / "truss.step")
        assert read.valid
        assert read.solids == one["solid"]["solids"]
        assert read.volume_mm3 == pytest.approx(one["solid"]["mesh_volume_mm3"], rel=2e-3)
    assert edited["solid"]["volume_mm3"] < report["solid"]["volume_mm3"]
