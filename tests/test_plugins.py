"""Add-ins go where their hosts look and come away again; what is not ours is left alone."""

import json
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from michell_cad.errors import InvalidInputError
from michell_cad.plugins import HOSTS, RECORD, install_plugin, plugin_folder, remove_plugin

ROOT = Path(__file__).parents[1]


def run(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "michell_cad.cli", "plugin", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_the_command_installs_and_removes(tmp_path):
    done = run("install", "freecad", "--into", tmp_path / "Mod")
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "Mod" / "MichellCAD"
    assert json.loads((folder / RECORD).read_text())["python"] == sys.executable
    assert {"package.xml", "Init.py", "InitGui.py", "michell_workbench"} <= {file.name for file in folder.iterdir()}
    assert [file.name for file in folder.parent.iterdir()] == ["MichellCAD"]
    done = run("remove", "freecad", "--into", tmp_path / "Mod")
    assert done.returncode == 0, done.stderr
    assert not folder.exists()
    again = run("remove", "freecad", "--into", tmp_path / "Mod")
    assert again.returncode == 2
    assert "no add-in is installed there" in again.stderr


def test_an_older_copy_is_replaced_as_a_whole(tmp_path):
    folder = install_plugin("freecad", tmp_path)
    (folder / "old.py").write_text("")
    assert install_plugin("freecad", tmp_path) == folder
    assert not (folder / "old.py").exists()


def test_a_folder_of_somebody_else_is_left_alone(tmp_path):
    own = tmp_path / "MichellCAD" / "own.py"
    own.parent.mkdir()
    own.write_text("")
    for act in (install_plugin, remove_plugin):
        with pytest.raises(InvalidInputError, match="not put there by michell-cad"):
            act("freecad", tmp_path)
    assert own.exists()


def test_a_place_that_cannot_be_written_is_one_message(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidInputError, match="--into"):
        install_plugin("freecad", tmp_path / "file")


@pytest.mark.parametrize(
    ("host", "platform", "variables", "folder"),
    [
        ("freecad", "linux", {"HOME": "/h"}, "/h/.local/share/FreeCAD/Mod/MichellCAD"),
        ("freecad", "linux", {"HOME": "/h", "XDG_DATA_HOME": "/data"}, "/data/FreeCAD/Mod/MichellCAD"),
        ("freecad", "darwin", {"HOME": "/h"}, "/h/Library/Application Support/FreeCAD/Mod/MichellCAD"),
        ("freecad", "win32", {"APPDATA": "/roaming"}, "/roaming/FreeCAD/Mod/MichellCAD"),
        ("fusion", "win32", {"APPDATA": "/r"}, "/r/Autodesk/Autodesk Fusion 360/API/AddIns/MichellTruss"),
    ],
)
def test_hosts_look_there(monkeypatch, host, platform, variables, folder):
    monkeypatch.delenv("XDG_DATA_HOME", raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(sys, "platform", platform)
    assert plugin_folder(host) == Path(folder)


def test_fusion_has_no_place_on_linux(monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "platform", "linux")
    with pytest.raises(InvalidInputError, match="does not run on this system"):
        plugin_folder("fusion")
    assert plugin_folder("fusion", tmp_path) == tmp_path / "MichellTruss"


def test_the_hosts_of_the_command_are_the_known_ones():
    from michell_cad.cli import PluginHost

    assert {host.value for host in PluginHost} == set(HOSTS)


def test_the_manifest_of_the_workbench_names_what_is_there():
    folder = ROOT / "plugin" / "freecad"
    space = {"p": "https://wiki.freecad.org/Package_Metadata"}
    manifest = ET.parse(folder / "package.xml").getroot()
    (bench,) = manifest.findall("p:content/p:workbench", space)
    assert (folder / str(bench.findtext("p:icon", namespaces=space))).is_file()
    assert f"class {bench.findtext('p:classname', namespaces=space)}(" in (folder / "InitGui.py").read_text()
    assert manifest.findtext("p:license", namespaces=space) == "MIT"
    for icon in (folder / "resources" / "icons").iterdir():
        assert ET.parse(icon).getroot().tag.endswith("svg")
