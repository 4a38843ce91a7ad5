"""The job file: what it means, and one clear message for each mistake."""

import json
from pathlib import Path

import numpy as np
import pytest
from schemas import check_schema
from shapes import box_mesh

from michell_cad.cad import kernel
from michell_cad.delivery import kept_materials
from michell_cad.domain import Part, part_from_tets, read_outline, read_part
from michell_cad.errors import InvalidInputError
from michell_cad.job import (
    Job,
    MaterialSection,
    Setup,
    build_problem,
    choose_material,
    job_schema,
    named_materials,
    parse_job,
    read_job,
)

EXAMPLES = Path(__file__).parents[1] / "examples"
PART = {"part": {"file": "x.step"}}
HELD = {"plane": {"point": [0, 0, 0], "normal": [1, 0, 0]}}
END = {"plane": {"point": [4, 0, 0], "normal": [1, 0, 0]}}


@pytest.fixture(scope="module")
def bar() -> Part:
    """4 x 2 x 2 mm, held and loaded at its ends in what follows."""
    return part_from_tets(box_mesh((8, 4, 4), (4.0, 2.0, 2.0)), "bar")


def setup(**tables) -> Setup:
    return Setup.model_validate({"support": [HELD], "load": [{**END, "force": [0, 0, -10]}], **tables})


def moment(part: Part, force: np.ndarray) -> np.ndarray:
    return np.cross(part.mesh.vertices, force).sum(0)


# --- meaning ---------------------------------------------------------------------------------------------------------


def test_supports_hold_the_chosen_axes(bar):
    problem = build_problem(setup(support=[HELD, {**END, "axes": "yz"}], load=[{**END, "force": [5, 0, 0]}]), bar)
    x = bar.mesh.vertices[:, 0]
    assert (problem.fixed[:, 0] == (x == 0)).all()
    assert (problem.fixed[:, 1] == ((x == 0) | (x == 4))).all()
    assert (problem.fixed[:, 1] == problem.fixed[:, 2]).all()


@pytest.mark.parametrize(
    ("load", "force", "turning"),
    [
        ({**END, "force": [1, 2, -10]}, [1, 2, -10], np.cross([4, 1, 1], [1, 2, -10])),
        ({**END, "pressure": 3.0}, [-12, 0, 0], np.cross([4, 1, 1], [-12, 0, 0])),
        ({**END, "torque": {"moment": 7.0, "axis": [-2, 0, 0]}}, [0, 0, 0], [-7, 0, 0]),
        ({**END, "torque": {"moment": 7.0, "axis": [1, 0, 0], "axis_point": [0, 9, 9]}}, [0, 0, 0], [7, 0, 0]),
    ],
)
def test_loads_have_the_resultants_of_the_file(bar, load, force, turning):
    nodal = build_problem(setup(load=[load]), bar).load_cases[0].force
    assert nodal.sum(0) == pytest.approx(force, abs=1e-9)
    assert moment(bar, nodal) == pytest.approx(turning, abs=1e-9)


def test_self_weight_uses_the_material(bar):
    job = setup(load=[{"self_weight": [0, 0, -1]}], material={"name": "steel S235"})
    nodal = build_problem(job, bar).load_cases[0].force
    assert nodal.sum(0) == pytest.approx([0, 0, -16 * 7.85e-6 * 9.80665])


def test_loads_of_one_case_add_up_and_cases_stay_apart(bar):
    job = setup(
        load=[
            {**END, "force": [0, 0, -10]},
            {**END, "force": [0, 0, -5]},
            {**END, "force": [0, 3, 0], "case": "side"},
        ],
        cases={"combination": "envelope", "weights": {"side": 0.5}},
    )
    problem = build_problem(job, bar)
    assert [(case.name, case.weight) for case in problem.load_cases] == [("main", 1.0), ("side", 0.5)]
    assert problem.load_cases[0].force.sum(0) == pytest.approx([0, 0, -15])
    assert problem.load_cases[1].force.sum(0) == pytest.approx([0, 3, 0])
    assert problem.combination == "envelope"


def test_a_problem_file_brings_its_own_supports_and_loads(tmp_path):
    mesh = box_mesh((8, 4, 4), (0.004, 0.002, 0.002))
    force = np.zeros((len(mesh.vertices), 3))
    force[np.argmin(np.abs(mesh.vertices - [0.002, 0.001, 0.002]).sum(1))] = [0, 0, -1]
    np.savez(tmp_path / "p.npz", vertices=mesh.vertices, tets=mesh.tets, fixed=mesh.vertices[:, 0] == 0, force=force)
    part = read_part(tmp_path / "p.npz")
    own = build_problem(Setup(), part)
    assert (own.fixed.all(1) == (mesh.vertices[:, 0] == 0)).all()
    assert own.load_cases[0].force.sum(0) == pytest.approx([0, 0, -1])
    # The tables of a job replace the file's, each kind as a whole; coordinates are in the file's metres.
    end = {"plane": {"point": [0.004, 0, 0], "normal": [1, 0, 0]}}
    loaded = build_problem(Setup.model_validate({"load": [{**end, "force": [0, 7, 0]}]}), part)
    assert loaded.load_cases[0].force.sum(0) == pytest.approx([0, 7, 0])
    assert (loaded.fixed == own.fixed).all()
    turned = build_problem(Setup.model_validate({"support": [end]}), part)
    assert (turned.fixed.all(1) == (mesh.vertices[:, 0] == 0.004)).all()


def test_no_support_and_no_load(bar):
    with pytest.raises(InvalidInputError, match=r"no support.*\[\[support\]\]"):
        build_problem(setup(support=[]), bar)
    with pytest.raises(InvalidInputError, match=r"no load.*\[\[load\]\]"):
        build_problem(setup(load=[]), bar)
    with pytest.raises(InvalidInputError, match="it can move along y"):
        build_problem(setup(support=[{"box": [[0, 0, 0], [4, 2, 0]], "axes": "z"}, {**HELD, "axes": "x"}]), bar)


def test_messages_name_the_table(bar):
    nothing = {"box": [[9, 9, 9], [10, 10, 10]]}
    with pytest.raises(InvalidInputError, match=r"^\[\[support\]\] 2: bar: box = .*matches nothing"):
        build_problem(setup(support=[HELD, nothing]), bar)
    with pytest.raises(InvalidInputError, match=r"^\[\[load\]\] 1: bar: box = .*matches nothing"):
        build_problem(setup(load=[{**nothing, "force": [0, 0, 1]}]), bar)


# --- materials -------------------------------------------------------------------------------------------------------


def test_materials_are_plausible_and_cited():
    for material in named_materials().values():
        assert 1e3 <= material.youngs_modulus <= 3e5
        assert 2e-4 <= material.density <= 9e-3
        assert material.yield_strength < material.youngs_modulus / 20
        assert len(material.source) > 20
    assert named_materials()["ABS"].yield_strength == 48


def test_choice_of_material():
    assert choose_material(MaterialSection()).name == "ABS"
    assert choose_material(MaterialSection(name="abs")).density == pytest.approx(1.04e-3)
    stiff = choose_material(MaterialSection(name="PLA", youngs_modulus=5000, density=2.0))
    assert (stiff.youngs_modulus, stiff.density, stiff.yield_strength) == (5000, pytest.approx(2e-3), 45)
    own = {"youngs_modulus": 1e3, "poisson_ratio": 0.3, "density": 1.5, "yield_strength": 20}
    assert choose_material(MaterialSection(name="goo", **own)).density == pytest.approx(1.5e-3)
    with pytest.raises(InvalidInputError, match=r"'PLS'.*did you mean 'PLA'"):
        choose_material(MaterialSection(name="PLS"))
    with pytest.raises(InvalidInputError, match="density, yield_strength missing"):
        choose_material(MaterialSection(youngs_modulus=1e3, poisson_ratio=0.3))


# --- reading ---------------------------------------------------------------------------------------------------------


def test_keep_tables_keep_material_of_the_part():
    part = read_outline(EXAMPLES / "bracket.step")
    job = parse_job({**PART, "keep": [{"faces": ["%CYLINDER", "<Z"], "depth": 4.0}]})
    (kept,) = kept_materials(job, part)
    # Four holes of radius 4.5 in a plate of 14 mm.
    assert sum(map(kernel.volume, kept.solids)) == pytest.approx(4 * np.pi * (8.5**2 - 4.5**2) * 14, rel=1e-6)
    assert kept.name == "keep 1"


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"faces": ">Z", "depth": 0.0}, "depth: .*greater than 0"),
        ({"faces": ">Z"}, "depth: is missing"),
        ({"depth": 1.0}, "say where"),
        ({"faces": ">Z", "deph": 1.0, "depth": 1.0}, "did you mean depth"),
    ],
)
def test_bad_keep_tables(table, message):
    with pytest.raises(InvalidInputError, match=r"\[\[keep\]\] 1.*" + message):
        parse_job({**PART, "keep": [table]})


def test_meshes_have_no_material_to_keep(bar):
    job = parse_job({**PART, "keep": [{**HELD, "depth": 1.0}]})
    with pytest.raises(InvalidInputError, match="keep 1: bar is a mesh without CAD faces"):
        kept_materials(job, bar)


@pytest.mark.parametrize("name", ["bracket", "cantilever", "quadcopter"])
def test_examples_are_good_jobs(name):
    job = read_job(EXAMPLES / f"{name}.toml")
    assert Path(job.part.file).parent.resolve() != Path.cwd() or EXAMPLES == Path.cwd()
    if name != "quadcopter":
        assert Path(job.part.file).is_file()


def test_defaults_and_python_values():
    job = Job.model_validate(PART)
    assert job.options.spacing_weight == 0.1
    assert job.options.resolution is None
    assert job.knobs.family == "all"
    assert job.part.units is None


def test_schema_describes_every_key_and_accepts_the_examples():
    schema = job_schema()
    json.dumps(schema)
    assert schema["required"] == ["part"]
    assert schema["additionalProperties"] is False
    assert set(schema["properties"]) == set(Job.model_fields)
    import tomllib

    for name in ("bracket", "cantilever", "quadcopter"):
        check_schema(tomllib.loads((EXAMPLES / f"{name}.toml").read_text()), schema, schema["$defs"])
    for wrong in ({}, {"part": {"file": 3}}, {**PART, "optoins": {}}, {**PART, "mesh": {"size": -1}}):
        with pytest.raises(AssertionError):
            check_schema(wrong, schema, schema["$defs"])


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        ({"optoins": {}}, "[optoins]: unknown key; did you mean options?"),
        ({"options": {"resolutoin": 24}}, "[options] resolutoin: unknown key; did you mean resolution?"),
        ({"knobs": {"radios": 1}}, "[knobs] radios: unknown key; did you mean radius?"),
        ({"support": [{"face": ">Z"}]}, "[[support]] 1: face: unknown key; did you mean faces?"),
        (
            {"load": [{**END, "force": [1, 1, 1]}, {**END, "force": [0, "a", 1]}]},
            "[[load]] 2: force[2]: expected a number",
        ),
        ({"load": [{**END, "force": [0, 1]}]}, "[[load]] 1: force: has too few entries"),
        ({"load": [{**END, "force": [0, 1, 2, 3]}]}, "[[load]] 1: force: expected at most 3 entries, found"),
        ({"load": [{**END, "force": [0, 0, 0]}]}, "[[load]] 1: force is zero"),
        ({"load": [{**END, "force": [0, 0, float("nan")]}]}, "[[load]] 1: force[3]: expected a finite number"),
        ({"load": [{**END, "torque": {"moment": 0, "axis": [1, 0, 0]}}]}, "torque is zero"),
        ({"load": [{**END, "torque": {"moment": 1}}]}, "[[load]] 1: torque.axis: is missing"),
        ({"load": [{**END, "force": [0, 0, 1], "pressure": 1}]}, "exactly one of force, pressure"),
        ({"load": [{"force": [0, 0, 1]}]}, "say where"),
        ({"load": [{**END, "self_weight": [0, 0, -1]}]}, "takes no region"),
        ({"load": {**END, "force": [0, 0, 1]}}, "[load]: write [[load]]"),
        ({"support": [{"axes": "x"}]}, "[[support]] 1: say where"),
        ({"support": [{**HELD, "axes": "xw"}]}, "[[support]] 1: axes: expected letters of xyz"),
        ({"support": [{"faces": 2.5}]}, "[[support]] 1: faces: expected selector strings"),
        ({"support": [{**HELD, "faces": ">Z"}]}, "give one of faces, box"),
        ({"mesh": {"size": 0}}, "[mesh] size: expected greater than 0, found 0"),
        ({"options": {"resolution": 24, "spacing": 3.0}}, "[options]: give resolution or spacing, not both"),
        ({"options": {"resolution": "24"}}, "[options] resolution: expected a number, found '24'"),
        ({"options": {"spacing_weight": 0}}, "[options] spacing_weight"),
        ({"options": {"spacing_bounds": [1.5, 2]}}, "[options] spacing_bounds[1]: expected less than 1, found 1.5"),
        ({"options": {"spacing_bounds": 2}}, "[options] spacing_bounds: expected an array, found 2"),
        ({"options": {"layers": "tight"}}, "[options] layers: expected 'clear' or 'hug', found 'tight'"),
        ({"knobs": {"family": "tensoin"}}, "[knobs] family: expected 'all' or 'tension'"),
        ({"knobs": {"radius": -1}}, "[knobs] radius: expected greater than 0, found -1"),
        ({"part": {"file": "x", "units": "km"}}, "[part] units: expected 'mm', 'cm', 'm' or 'in', found 'km'"),
        ({"part": "x.step"}, "[part]: expected a table"),
        ({"cases": {"weights": {"wind": 1}}}, "no load has the case 'wind'"),
        ({"output": {"preview": 1}}, "[output] preview: expected true or false"),
        ({"output": {"formats": ["step", "iges"]}}, "'3mf-beams', 'glb' or 'brep', found 'iges'"),
        ({"output": {"formats": ["stl", "stl"]}}, "[output] formats: expected every format at most once"),
        ({"output": {"step_form": "parts"}}, "[output] step_form: expected 'solid' or 'assembly', found 'parts'"),
        ({"knobs": {"profile": "rectangle"}}, "[knobs] profile: unknown profile 'rectangle'"),
        ({"output": {"step_schema": "AP203"}}, "[output] step_schema: expected 'AP214' or 'AP242', found 'AP203'"),
    ],
)
def test_mistakes(tables, words):
    with pytest.raises(InvalidInputError) as caught:
        parse_job({**PART, **tables}, "job.toml")
    assert str(caught.value).startswith("job.toml: ")
    assert words in str(caught.value)


def test_several_mistakes_are_all_named():
    with pytest.raises(InvalidInputError) as caught:
        parse_job({"mesh": {"sise": 1}, "support": [{}]}, "job.toml")
    assert len(str(caught.value).splitlines()) == 3


def test_job_files_that_cannot_be_read(tmp_path):
    def refused(match: str) -> None:
        with pytest.raises(InvalidInputError, match=match):
            read_job(tmp_path / "job.toml")

    refused("does not exist")
    (tmp_path / "job.toml").write_text("[part]\nfile = 'x.step'\n[mesh]\nsize = = 3\n")
    refused("line 4")
    (tmp_path / "job.toml").write_bytes(b"\xff\xfe\x00\x81")
    refused("UTF-8")
    (tmp_path / "job.toml").write_text("")
    refused(r"\[part\]: is missing")
    (tmp_path / "job.toml").write_text("[part]\nfile = 'sub/x.step'\n")
    assert read_job(tmp_path / "job.toml").part.file == str(tmp_path / "sub" / "x.step")
    (tmp_path / "job.toml").write_text("[part]\nfile = 'x.step'\n[knobs]\nprofile = 'none.dxf'\n")
    refused(r"job\.toml: \[knobs\] profile: .*none\.dxf: there is no such file")


def test_a_profile_file_is_relative_to_the_job(tmp_path):
    svg = '<svg xmlns="http://www.w3.org/2000/svg"><path d="M 0 0 L 6 0 L 6 2 L 0 2 Z"/></svg>'
    (tmp_path / "flat.svg").write_text(svg)
    (tmp_path / "job.toml").write_text("[part]\nfile = 'x.step'\n[knobs]\nprofile = 'flat.svg'\n")
    assert len(read_job(tmp_path / "job.toml").knobs.profile) == 4
