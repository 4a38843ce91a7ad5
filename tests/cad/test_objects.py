"""Objects for build123d and CadQuery: the same volume, and booleans with plates of the user's."""

import build123d
import cadquery
import pytest

from michell_cad.cad import build_solid
from michell_cad.knobs import Knobs
from tests.cad.layouts import grid_truss, sized, star


@pytest.fixture(scope="module")
def cross():
    return build_solid(star([[1, 0, 0], [0, 1, 0], [0, 0, 1]], length=12.0), Knobs())


def test_build123d_solid_goes_on_in_booleans(cross) -> None:
    truss = cross.build123d
    assert isinstance(truss, build123d.Solid)
    assert truss.label == "truss"
    assert truss.volume == pytest.approx(cross.report.volume_mm3, rel=1e-3)
    plate = build123d.Pos(0, 0, 6) * build123d.Box(10, 10, 2)
    united, common = truss + plate, truss & plate
    assert united.is_valid
    assert united.volume == pytest.approx(truss.volume + 200 - common.volume, rel=1e-4)
    # The plate meets the member along z only, a cylinder of radius 1.
    assert common.volume == pytest.approx(3.14159 * 2, rel=1e-4)


def test_cadquery_workplane_goes_on_in_booleans(cross) -> None:
    truss = cross.cadquery
    assert isinstance(truss, cadquery.Workplane)
    cut = truss.cut(cadquery.Workplane().box(10, 10, 2).translate((0, 0, 6))).val()
    assert cut.isValid()
    assert cut.Volume() == pytest.approx(cross.report.volume_mm3 - 3.14159 * 2, rel=1e-3)


def test_assembly_has_names_and_colours(cross, tmp_path) -> None:
    assembly = cross.cadquery_assembly
    assembly.export(str(tmp_path / "truss.step"))
    back = cadquery.Assembly.load(str(tmp_path / "truss.step"))
    names = [name for part in back.objects.values() for name in part._subshape_names.values()]
    curves = {curve.name for curve in cross.prepared.sized.truss.curves}
    assert curves <= set(names)


def test_several_pieces_are_a_compound() -> None:
    two = build_solid(sized(grid_truss((2, 2, 2), stride=2), 0.8), Knobs())
    several = two.build123d
    assert len(several.solids()) == two.report.solids
    assert several.volume == pytest.approx(two.report.volume_mm3, rel=1e-3)
