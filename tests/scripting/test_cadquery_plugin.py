"""The truss in chains of CadQuery: through `invoke`, and as a method once it is registered."""

import inspect

import cadquery as cq
import pytest
from hosts import exercised

import michell_cad
from michell_cad.delivery import design_outline
from michell_cad.domain.cad_part import outline_from_shape
from michell_cad.errors import InvalidInputError
from michell_cad.scripting.cadquery_plugin import METHOD, michell_truss, register, saved_truss
from michell_cad.scripting.picks import make_setup

FEW = {"radius": 1.0, "every": 2}
"""Knobs that leave few curves, to be quick."""


@pytest.fixture(scope="module")
def box() -> cq.Workplane:
    return cq.Workplane().box(80, 40, 40)


@pytest.fixture(scope="module")
def truss(box, bar) -> cq.Workplane:
    made = box.faces("<X").tag("wall").end().invoke(michell_truss(**bar, **FEW))
    exercised("CadQuery", cq.__version__)
    return made


def test_invoke_puts_the_truss_on_the_stack_and_the_chain_goes_on(truss, box, bar):
    (solid,) = truss.vals()
    assert isinstance(solid, cq.Solid)
    assert solid.isValid()
    assert truss.end().val().Volume() == pytest.approx(80 * 40 * 40)
    assert truss.translate((0, 0, 50)).val().Center().z == pytest.approx(solid.Center().z + 50, abs=1e-6)


def test_places_may_be_selectors_faces_or_workplanes(truss, box, bar, no_stage):
    picked = bar | {"supports": box.faces("<X"), "loads": (box.faces(">X").val(), (0, 0, -500))}
    other = box.faces(">Z").workplane().invoke(michell_truss(**picked, **FEW))
    assert other.val().Volume() == pytest.approx(truss.val().Volume(), rel=1e-9)


def test_a_script_that_turns_knobs_computes_no_stage(truss, box, bar, no_stage):
    thin = box.invoke(michell_truss(**bar, radius=0.7, every=2))
    assert thin.val().Volume() < 0.6 * truss.val().Volume()


def test_faces_of_families_are_tagged(truss):
    groups = {name: truss.faces(tag=name).vals() for name in ("tension", "compression", "third", "feature", "node")}
    assert all(groups.values())
    assert sum(map(len, groups.values())) == truss.faces().size()
    assert truss.faces(tag="wall").size() == 1


def test_only_register_touches_cadquery(box, bar, truss, no_stage, monkeypatch):
    monkeypatch.setattr(cq.Workplane, METHOD, None, raising=False)
    monkeypatch.delattr(cq.Workplane, METHOD)
    michell_cad.michell_truss(**bar)
    assert not hasattr(cq.Workplane, METHOD)
    register()
    method = getattr(cq.Workplane, METHOD)
    assert "supports" in method.__doc__
    assert set(inspect.signature(method).parameters) >= {"supports", "loads", "radius", "entasis"}
    made = getattr(box, METHOD)(**bar, **FEW)
    assert made.val().Volume() == pytest.approx(truss.val().Volume(), rel=1e-9)


def test_the_truss_of_a_finished_design_starts_a_chain(truss, box, bar, no_stage):
    outline = outline_from_shape(box)
    made = saved_truss(design_outline(outline, make_setup(outline, **bar)).design, **FEW)
    assert made.val().Volume() == pytest.approx(truss.val().Volume(), rel=1e-9)
    assert made.faces(tag="tension").size() == truss.faces(tag="tension").size()


def test_a_workplane_without_a_solid_is_refused(bar):
    with pytest.raises(InvalidInputError, match="make a solid first"):
        cq.Workplane().rect(1, 2).invoke(michell_truss(**bar))
    with pytest.raises(InvalidInputError, match="matches nothing"):
        cq.Workplane().box(80, 40, 40).invoke(michell_truss(**(bar | {"supports": "%CYLINDER"})))
