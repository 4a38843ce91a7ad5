"""The records of STEP files: numbers, strings, sharing; and what another reader finds, against the kernel's writer."""

import json
import re
import subprocess
import sys
from pathlib import Path

import cadquery as cq
import numpy as np
import pytest

from michell_cad.cad import build_solid, kept_shape, unite
from michell_cad.cad.kernel_step import solid_text
from michell_cad.cad.step import _face_tags, _write_by_kernel, export_step, forecast_step
from michell_cad.cad.step_text import AP214, AP242, LISTED, StepText, Tag, listed, quoted
from michell_cad.knobs import Knobs
from tests.cad.layouts import grid_truss, sized, star

ORANGE = Tag("it's", (0.902, 0.502, 0.0), "fruit")


def read_as_another_program(path) -> dict:
    reader = Path(__file__).with_name("read_step.py")
    done = subprocess.run([sys.executable, str(reader), str(path)], capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def write(text: StepText, path) -> None:
    path.write_text("".join(text.lines(path.name, AP214)))


def text_of(shape: cq.Workplane, tag: Tag = ORANGE) -> StepText | None:
    solids, faces = [s.wrapped for s in shape.solids().vals()], [f.wrapped for f in shape.faces().vals()]
    names = [f"part {i}" for i in range(len(solids))]
    return solid_text(solids, names, faces, [tag] * len(faces), AP214, lambda _: None)


def test_strings_as_the_standard_writes_them() -> None:
    assert quoted("it's a \\") == "'it''s a \\\\'"
    assert quoted("Bü") == "'B\\X2\\00FC\\X0\\'"
    assert quoted("😀") == "'\\X4\\0001F600\\X0\\'"


def test_equal_records_are_shared_and_lengths_have_thirteen_digits() -> None:
    text = StepText(extent=1234.0)
    assert text.point(1, 2, 3) == text.point(1, 2, 3 + 1e-10) != text.point(1, 2, 3 + 1e-9)
    assert text.length(1 / 3) == "0.333333333"
    assert text.length(-1e-12) == "0."
    assert text.length(1e3) == "1000."
    assert StepText(extent=0.5).length(1 / 3) == "0.333333333333"


def test_long_lists_are_broken() -> None:
    numbers = list(range(1, 2 * LISTED + 2))
    assert listed(numbers).count("\n") == 2
    assert re.findall(r"\d+", listed(numbers)) == [str(n) for n in numbers]
    assert listed(numbers[:LISTED]).count("\n") == 0


@pytest.mark.parametrize("n", [1, 9, 10, 99, 100, 1234])
def test_size_is_that_of_the_records(n) -> None:
    text = StepText(1.0)
    for i in range(n):
        text.add(f"DIRECTION('',({i}.,0.,0.))")
    data = "".join(text.lines("truss.step", AP242)).split("DATA;\n")[1].split("ENDSEC;")[0]
    assert text.size == len(data)


SHAPES = {
    "plate with holes": lambda: (
        cq.Workplane().box(30, 20, 5).faces(">Z").workplane().cskHole(4, 9, 82).edges("|Z").fillet(2)
    ),
    "ball": lambda: cq.Workplane().sphere(7).translate((3, 4, 5)),
    "ring": lambda: cq.Workplane("XZ").center(20, 0).circle(4).revolve(360, (-20, 0), (-20, 1)),
    "loft": lambda: cq.Workplane().ellipse(8, 5).workplane(offset=20).ellipse(4, 6).loft(),
    "wedge": lambda: cq.Workplane().box(20, 20, 20).cut(cq.Workplane().box(9, 9, 40).rotate((0, 0, 0), (1, 1, 0), 30)),
    "two": lambda: cq.Workplane().box(1, 2, 3).union(cq.Workplane().cylinder(5, 1).translate((9, 0, 0))),
}


@pytest.mark.parametrize("name", SHAPES)
def test_common_parts_are_read_again(name, tmp_path) -> None:
    shape = SHAPES[name]()
    text = text_of(shape)
    assert text is not None
    write(text, tmp_path / "part.step")
    found = read_as_another_program(tmp_path / "part.step")
    assert [part["name"] for part in found["parts"]] == [f"part {i}" for i in range(shape.solids().size())]
    assert all(part["valid"] for part in found["parts"])
    assert sum(part["volume"] for part in found["parts"]) == pytest.approx(
        sum(solid.Volume() for solid in shape.solids().vals()), rel=1e-6
    )
    assert found["faces"] == [["it's", [230, 128, 0], []]] * shape.faces().size()


def test_others_are_left_to_the_kernel(tmp_path) -> None:
    part = cq.Workplane().ellipse(6, 4).extrude(4)
    assert text_of(part) is None  # a surface of linear extrusion
    hollow = cq.Workplane().box(9, 9, 9).cut(cq.Workplane().box(3, 3, 3))
    assert text_of(hollow) is None
    bar = build_solid(star([[1, 0, 0]], length=20.0), Knobs(fillet_ratio=0.0))
    united = unite(bar, [kept_shape("plate", part.translate((10, 0, -2)))])
    export_step(united, tmp_path / "truss.step")
    found = read_as_another_program(tmp_path / "truss.step")
    assert found["parts"][0]["valid"]
    assert found["parts"][0]["volume"] == pytest.approx(united.report.volume_mm3, rel=1e-4)
    assert forecast_step(united) == pytest.approx((tmp_path / "truss.step").stat().st_size, rel=0.6)


def test_a_truss_reads_like_the_kernels_own_file_at_half_its_size(tmp_path) -> None:
    solid = build_solid(sized(grid_truss((3, 3, 2), warp=0.2, missing=0.1), 1.2, 0.3), Knobs())
    export_step(solid, tmp_path / "own.step")
    _write_by_kernel(solid, tmp_path / "kernel.step", "kernel.step", "solid", False, AP214)
    own, kernel = (read_as_another_program(tmp_path / f"{name}.step") for name in ("own", "kernel"))
    assert own["faces"] == kernel["faces"]
    assert own["parts"][0].pop("volume") == pytest.approx(kernel["parts"][0].pop("volume"), rel=1e-8)
    assert own["parts"] == kernel["parts"]
    sizes = [(tmp_path / f"{name}.step").stat().st_size for name in ("own", "kernel")]
    assert sizes[0] < 0.65 * sizes[1]


def test_every_record_that_is_named_is_there() -> None:
    solid = build_solid(star(np.eye(3)), Knobs())
    text = solid_text(solid.solids, ["truss"], solid.faces, _face_tags(solid), AP214, lambda _: None)
    assert text is not None
    whole = "".join(text.lines("star.step", AP214))
    records = dict(re.findall(r"^#(\d+)=(.*?);$", whole, re.MULTILINE | re.DOTALL))
    named = {number for record in records.values() for number in re.findall(r"[(,\n]#(\d+)", record)}
    assert named <= set(records)
    unused = {records[number].split("(")[0] for number in set(records) - named}
    assert unused == {
        "SHAPE_DEFINITION_REPRESENTATION", "PRODUCT_RELATED_PRODUCT_CATEGORY", "APPLICATION_PROTOCOL_DEFINITION",
        "MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION", "PRESENTATION_LAYER_ASSIGNMENT",
    }  # fmt: skip
