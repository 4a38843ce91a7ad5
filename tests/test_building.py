"""From an edited structure to its radii and its solid; designs whose radii suit their loads can be edited like any."""

from collections.abc import Iterator
from dataclasses import replace

import pytest
from designs import small_bar

from michell_cad.building import Sizing, build_united, joining_notes, size_finished
from michell_cad.edits import Edit, EditList, Entasis, Family, Radius, Structure, Tag
from michell_cad.errors import InvalidInputError
from michell_cad.knobs import Knobs, entasis_weights
from michell_cad.strength import StrengthenOptions

BAR = small_bar()
KNOBS = Knobs(radius=0.9)


def sized(*edits: Edit) -> Sizing:
    structure = EditList(edits).replay(BAR, KNOBS)
    return size_finished(replace(structure, sizing=StrengthenOptions(size_by="curve")))


@pytest.fixture(scope="module", autouse=True)
def one_round() -> Iterator[None]:
    """What edits do to sized radii does not depend on how often sizing and building took turns."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("michell_cad.strength.sized_for_loads.ROUNDS", 1)
        yield


@pytest.fixture(scope="module")
def plain() -> Sizing:
    return sized()


def test_radii_for_the_loads_are_the_base_of_edits(plain):
    """Edits have no part in what the loads get: elsewhere the radii are the same, and where they act as they say."""
    made = sized(Radius(where=Family("tension"), times=1.2), Entasis(where=Family("compression"), to=0.3))
    assert made.sized.truss.nodes == pytest.approx(plain.sized.truss.nodes)
    truss, before, after = made.sized.truss, plain.sized.radii, made.sized.radii
    tension, compression = Family("tension").members(truss), Family("compression").members(truss)
    assert after[tension] == pytest.approx(1.2 * before[tension])
    bulge = 1 + 0.3 * entasis_weights(truss)[compression]
    assert bulge.max() > 1.25
    assert after[compression] == pytest.approx(before[compression] * bulge)
    rest = ~(tension | compression)
    assert after[rest] == pytest.approx(before[rest])
    changed = int((after != before).any(1).sum())
    assert changed > 20
    assert len(made.notes) == len(plain.notes) + 1
    assert f"radii of {changed} members after these were sized for the loads" in made.notes[-1]


def test_the_last_edit_holds_and_millimetres_are_millimetres(plain):
    made = sized(Radius(where=Family("third"), times=1.1), Radius(where=Family("third"), to=0.8))
    third = Family("third").members(made.sized.truss)
    assert (made.sized.radii[third] == 0.8).all()
    assert made.report is not None
    assert plain.report is not None
    assert made.report.failure_factor == plain.report.failure_factor


def test_other_edits_leave_the_radii_for_the_loads(plain):
    made = sized(Tag(name="oak", where=Family("third")))
    assert made.notes == plain.notes
    assert (made.sized.radii == plain.sized.radii).all()


def test_an_edited_design_for_its_loads_is_one_valid_solid():
    structure = EditList((Radius(where=Family("compression"), times=1.15),)).replay(BAR, KNOBS)
    structure = replace(structure, sizing=StrengthenOptions(size_by="family"))
    report = build_united(structure, size_finished(structure), lambda stage, fraction: None).report
    assert report.valid
    assert report.solids == 1


def test_an_edit_that_selects_nothing_or_too_much_says_so():
    with pytest.raises(InvalidInputError, match="too large for a cell edge"):
        sized(Radius(where=Family("third"), times=9.0))


def test_loads_of_joined_trusses_are_not_known():
    alone = replace(Structure.of(BAR, KNOBS), sizing=StrengthenOptions(size_by="curve"))
    structure = replace(alone, joined=alone.pieces)
    with pytest.raises(InvalidInputError, match="one part only"):
        size_finished(structure)


def test_a_joined_design_sized_for_its_loads_is_noted():
    alone = Structure.of(BAR, KNOBS)
    theirs = replace(alone, sizing=StrengthenOptions(size_by="curve")).pieces
    (note,) = joining_notes(replace(alone, joined=theirs))
    assert "were sized for its loads; here those of its knobs hold" in note
    (note,) = joining_notes(replace(alone, joined=(replace(alone.pieces[0], density=7.8e-3),)))
    assert "another density" in note
    assert joining_notes(alone) == ()
