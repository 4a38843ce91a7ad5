"""What the README shows works as shown."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from shapes import box_mesh

import michell_cad as mc
from michell_cad.cad.step import read_step_summary
from michell_cad.cli import app
from michell_cad.job import parse_job

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


def test_the_job_that_it_explains_is_a_job():
    (text,) = blocks("toml")
    job = parse_job(tomllib.loads(text))
    assert job.options.resolution == 24
    assert job.knobs.radius == 1.2
    assert job.load[0].force == (0.0, 0.0, -500.0)


def test_the_python_programs_write_step_files(tmp_path, monkeypatch):
    mesh = box_mesh((6, 3, 3), (0.06, 0.03, 0.03))
    force = np.where(mesh.vertices[:, :1] == 0.06, [[0.0, 0.0, -2.0]], 0.0)
    np.savez(tmp_path / "bar.npz", vertices=mesh.vertices, tets=mesh.tets, fixed=mesh.vertices[:, 0] == 0, force=force)
    (tmp_path / "bar.toml").write_text('[part]\nfile = "bar.npz"\n[options]\nresolution = 5\n')
    program, editing = blocks("python")
    assert len([line for line in program.splitlines() if line]) == 5
    monkeypatch.chdir(tmp_path)
    exec(compile(program.replace("examples/bracket.toml", "bar.toml"), "README.md", "exec"), {})
    (tmp_path / "bracket-truss").mkdir()
    mc.save_design("bracket-truss/design.npz", mc.design_job("bar.toml"), mc.Knobs())
    exec(compile(editing, "README.md", "exec"), {})
    whole, edited = read_step_summary(tmp_path / "truss.step"), read_step_summary(tmp_path / "edited.step")
    for summary in (whole, edited):
        assert summary.solids == 1
        assert summary.valid
    assert edited.volume_mm3 > whole.volume_mm3
    assert len(mc.load_edits("edited.npz")) == 1


def test_its_commands_exist():
    named = set(re.findall(r"`michell-cad (\w+)", README))
    assert named == {command.name or command.callback.__name__ for command in app.registered_commands}


def test_every_file_that_it_names_exists():
    for path in re.findall(r"\(?(examples/[\w./]+\.(?:toml|png|py))", README):
        assert (ROOT / path).is_file(), path
    for path in re.findall(r"\| `([\w/.]+(?:\.py|/))` \|", README):
        assert (ROOT / "michell_cad" / path).exists(), path


@pytest.mark.parametrize("line", blocks("sh"))
def test_its_command_lines_name_what_is_there(line):
    assert "pip install" in line
    for path in re.findall(r"examples/\S+", line):
        assert (ROOT / path).is_file()
