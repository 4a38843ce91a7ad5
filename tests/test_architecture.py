"""The house stands: imports point one way, the kernel is touched in one file, the package loads at once."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "michell_cad"

NUMERICS = (
    "arrays",
    "closed_mesh",
    "compiled",
    "constant_frames",
    "curves",
    "deviator",
    "elastic_elements",
    "elasticity",
    "errors",
    "frame_field",
    "isocurves",
    "knobs",
    "linear_solver",
    "matching_energy",
    "metrics",
    "minimize",
    "moving_frames",
    "multigrid",
    "parametrization",
    "part_axes",
    "pipeline",
    "problem",
    "profiles",
    "report",
    "rigid_motions",
    "rotations",
    "splines",
    "stage_cache",
    "strength",
    "tet_mesh",
    "truss",
    "warm_up",
)
OUTSIDE = (
    "building",
    "cad",
    "cli",
    "cli_edit",
    "cli_inspect",
    "comparison_table",
    "delivery",
    "delivery_edit",
    "delivery_export",
    "delivery_strength",
    "domain",
    "edits",
    "job",
    "output_section",
    "picture",
    "plugins",
    "profile_source",
    "scripting",
    "selection",
    "sizing_section",
    "worker",
)


def modules() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def imports(file: Path) -> set[str]:
    """All absolute module names that a file imports anywhere, also inside functions."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}: relative import"
            found.add(node.module or "")
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def stage_of(file: Path) -> str:
    return file.relative_to(PACKAGE).parts[0].removesuffix(".py")


def test_numerics_import_neither_cad_nor_files():
    for file in modules():
        if stage_of(file) in NUMERICS:
            used = {name.split(".")[1] for name in imports(file) if name.startswith("michell_cad.")}
            assert not used & set(OUTSIDE), f"{file.name} imports {used & set(OUTSIDE)}"


def test_only_the_kernel_files_touch_the_kernel():
    for file in modules():
        if any(name.split(".")[0] == "OCP" for name in imports(file)):
            assert file.name.startswith("kernel")
            assert file.parent == PACKAGE / "cad"


def test_nothing_imports_plugins():
    for file in modules():
        assert not any(name.split(".")[0] == "plugin" for name in imports(file))


def test_only_scripting_and_the_kernel_files_know_cad_programs_and_nothing_stands_on_scripting():
    for file in modules():
        used = imports(file)
        if stage_of(file) not in ("cad", "domain", "scripting", "selection"):
            assert not {name.split(".")[0] for name in used} & {"build123d", "cadquery"}, file
        if stage_of(file) not in ("scripting", "__init__"):
            assert not any(name.startswith("michell_cad.scripting") for name in used), file


def test_every_module_is_filed():
    known = {
        *NUMERICS,
        *OUTSIDE,
        "__init__",
        "design_file",
        "files",
        "job_values",
        "mistakes",
        "palette",
        "truss_json",
        "materials",
    }
    assert {stage_of(file) for file in modules()} <= known


def test_every_public_name_exists_and_is_listed_once():
    import michell_cad

    assert sorted(set(michell_cad.__all__)) == sorted(michell_cad.__all__)
    assert set(michell_cad.__all__) == set(michell_cad._HOME)
    for name in michell_cad.__all__:
        assert getattr(michell_cad, name).__doc__
    with pytest.raises(AttributeError, match="no attribute"):
        _ = michell_cad.nothing


@pytest.mark.parametrize("statement", ["import michell_cad", "import michell_cad.cli"])
def test_cad_and_solvers_load_when_first_used(statement):
    heavy = "{'cadquery', 'build123d', 'OCP', 'scipy', 'pypardiso', 'vtkmodules', 'pytetwild', 'numpy'}"
    code = f"{statement}\nimport sys\nprint(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
