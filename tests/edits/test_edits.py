"""Edits of the truss: what each does, and what holds after any of them."""

from dataclasses import replace

import numpy as np
import pytest
from designs import coarse_bar, small_bar
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from michell_cad.cad import SolidReport, build_solid
from michell_cad.edits import (
    AddCurve,
    AddStrut,
    Box,
    EditList,
    Entasis,
    Every,
    Family,
    Label,
    Near,
    Radius,
    Remove,
    RemoveOpenEnds,
    Structure,
    Tag,
    Thin,
    Where,
    size_structure,
    tagged_members,
)
from michell_cad.edits.sizing import interpolate_stress
from michell_cad.errors import GeometryKernelError, InvalidInputError
from michell_cad.knobs import Knobs
from michell_cad.pipeline import Design
from michell_cad.truss import CurveKind, open_ends

BAR = small_bar()
R = 0.08 * BAR.truss.spacing
KNOBS = Knobs()


def edited(*edits) -> Structure:
    return EditList(edits).replay(BAR, Knobs())


def test_radius_of_a_selection_in_mm_and_as_a_factor():
    structure = edited(Radius(where=Family("tension"), to=0.7), Radius(where=Box((0, 0, 0), (20, 40, 40)), times=1.5))
    radii = size_structure(structure).radii
    near = Box((0, 0, 0), (20, 40, 40)).members(BAR.truss)
    tension = Family("tension").members(BAR.truss) & ~near
    np.testing.assert_allclose(radii[near], 1.5 * R)
    np.testing.assert_allclose(radii[tension], 0.7)
    np.testing.assert_allclose(radii[~near & ~tension], R)


def test_radius_over_the_length_of_a_straight_curve_by_hand():
    structure = edited(Radius(over="length", values=(1.0, 2.0, 1.0)))
    radii, truss = size_structure(structure).radii, BAR.truss
    curve = next(c for c in truss.curves if not c.closed and c.kind is CurveKind.INTERIOR and len(c.members) > 3)
    run = np.concatenate([[0], np.cumsum(truss.lengths[curve.members])])
    x = run / run[-1]
    first = radii[curve.members, np.where(truss.members[curve.members, 0] == curve.nodes[:-1], 0, 2)]
    mine = truss.curve_of_member[curve.members] == truss.curves.index(curve)
    np.testing.assert_allclose(first[mine], (R * (2 - np.abs(2 * x[:-1] - 1)))[mine])


def test_radius_over_depth_and_stress_grows_with_them():
    deep = size_structure(edited(Radius(over="depth", values=(0.8, 1.2)))).radii
    surface = (BAR.truss.node_kinds[BAR.truss.members] > 0).all(1)
    assert deep[surface].mean() < R < deep.max()
    np.testing.assert_allclose(deep[surface][:, [0, 2]], 0.8 * R, rtol=0.01)
    stress = size_structure(edited(Radius(over="stress", values=(0.5, 1.5)))).radii
    middles = BAR.truss.nodes[BAR.truss.members].mean(1)
    held, free = stress[middles[:, 0] < 20].mean(), stress[middles[:, 0] > 60].mean()
    assert held > 1.2 * free  # the bending moment is largest where the bar is held


def test_entasis_of_a_selection_and_the_smallest_radius():
    structure = EditList((Entasis(where=Family("third"), to=0.5),)).replay(BAR, Knobs(smallest_radius=1.02 * R))
    radii, third = size_structure(structure).radii, Family("third").members(BAR.truss)
    np.testing.assert_allclose(radii[~third], 1.02 * R)
    assert radii[third].max() > 1.3 * R


def test_a_radius_too_large_names_the_curve_and_what_would_do():
    with pytest.raises(InvalidInputError, match=r"too large for a cell edge of .* use at most"):
        size_structure(edited(Radius(where=Family("third"), to=5.0)))


def test_thinning_keeps_the_labels_on_the_stride():
    truss = edited(Thin(where=Family("compression"), every=2)).truss
    for curve in truss.curves:
        if curve.family == "compression":
            assert all(v is None or v % 2 == 0 for v in curve.isovalues)
    whole = [c.name for c in BAR.truss.curves if c.family == "tension"]
    assert [c.name for c in truss.curves if c.family == "tension"] == whole


def test_removing_takes_what_hangs_loose_along_unless_told_otherwise():
    pruned = edited(Remove(where=Where("boundary"))).truss
    assert not len(open_ends(pruned))
    hanging = edited(Remove(where=Where("boundary"), prune=False)).truss
    assert len(open_ends(hanging)) > 20
    shortened = edited(Remove(where=Where("boundary"), prune=False), RemoveOpenEnds()).truss
    np.testing.assert_array_equal(shortened.nodes, pruned.nodes)
    assert [c.name for c in shortened.curves] == [c.name for c in pruned.curves]


def test_a_strut_joins_two_nodes_straight():
    nodes, degrees = BAR.truss.nodes, BAR.truss.degrees
    a = int(np.argmin(np.linalg.norm(nodes - [40, 20, 20], axis=1)))
    far = np.linalg.norm(nodes - nodes[a], axis=1)
    b = int(np.argmin(np.where(far > 1.3 * BAR.truss.spacing, far, np.inf)))
    near = [tuple((nodes[i] + 0.1).tolist()) for i in (a, b)]
    truss = edited(AddStrut(between=(near[0], near[1]))).truss
    assert len(truss.members) == len(BAR.truss.members) + 1
    assert truss.members[-1].tolist() == sorted((a, b))
    assert truss.curves[-1].name == "added (*, *, *) #0"
    assert (truss.degrees - degrees).nonzero()[0].tolist() == sorted((a, b))
    through = AddCurve(through=(near[0], tuple(((nodes[a] + nodes[b]) / 2 + 2).tolist()), near[1]), reach=1.0)
    with pytest.raises(InvalidInputError, match=r"joins the nodes .* already"):
        edited(AddStrut(between=(near[0], near[1])), AddCurve(through=(near[0], near[1])))
    with pytest.raises(InvalidInputError, match=r"edit 'add strut': no node .* move the point, or raise reach$"):
        edited(AddStrut(between=(near[0], (500.0, 0.0, 0.0))))
    bent = edited(through).truss
    assert len(np.asarray(bent.waypoints)) == len(np.asarray(BAR.truss.waypoints)) + 1


def test_a_curve_may_end_in_the_open_only_if_asked():
    points = (tuple(BAR.truss.nodes[0].tolist()), (40.0, 20.0, 90.0))
    with pytest.raises(InvalidInputError, match=r"no node lies within .* set loose = true"):
        edited(AddCurve(through=points))
    truss = edited(AddCurve(through=points, loose=True)).truss
    np.testing.assert_array_equal(truss.nodes[-1], points[1])
    assert len(open_ends(truss)) == len(open_ends(BAR.truss)) + 1


def test_the_last_tag_of_a_member_holds():
    structure = edited(Tag(name="steel", where=Label(0, 2, 3)), Tag(name="wood", where=Family("third")))
    tags = tagged_members(structure)
    assert not (tags["steel"] & tags["wood"]).any()
    np.testing.assert_array_equal(tags["wood"], Family("third").members(BAR.truss))


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (Remove(where=Near((999, 0, 0), 1)), "no curve is selected by near"),
        (Radius(where=Near((999, 0, 0), 1), to=1.0), "no member is selected by"),
        (Thin(where=Family("compression"), every=500, offset=250), "keeps none of the"),
        (Remove(), "leaves nothing"),
        (AddStrut(between=((0.0, 0.0, 0.0), (0.1, 0.0, 0.0))), "mean the same node"),
    ],
)
def test_what_cannot_be_done_is_said(edit, message):
    with pytest.raises(InvalidInputError, match=f"edit 1 of 1: .*{message}"):
        edited(edit)


SELECTIONS = st.sampled_from(
    [
        Family("tension"),
        Family("compression", surface=False),
        Family(("third", "feature")),
        Every(2) | Where("boundary"),
        Label(0, 2, 4) & ~Family("feature"),
        Near((40, 20, 20), 15),
        Box((30, -1, -1), (60, 41, 25)),
        ~Where("boundary"),
    ]
)
POINTS = st.tuples(*[st.floats(2, 78), st.floats(2, 38), st.floats(2, 38)])
EDITS = st.one_of(
    st.builds(Remove, where=SELECTIONS),
    st.builds(Thin, where=SELECTIONS, every=st.integers(1, 3), offset=st.integers(0, 2)),
    st.builds(RemoveOpenEnds, where=SELECTIONS),
    st.builds(AddStrut, between=st.tuples(POINTS, POINTS), reach=st.just(20.0)),
    st.builds(Radius, where=SELECTIONS, times=st.floats(0.5, 1.5)),
    st.builds(Entasis, where=SELECTIONS, to=st.floats(-0.2, 0.5)),
    st.builds(Tag, where=SELECTIONS, name=st.just("steel")),
)


def apply_all(edits: list, design: Design = BAR, knobs: Knobs = KNOBS) -> tuple[EditList, Structure]:
    """Those of the edits that can be made one after the other, and what they make."""
    made = EditList()
    structure = Structure.of(design, knobs)
    for edit in edits:
        try:
            structure = edit.apply(structure)
        except InvalidInputError:
            continue
        made = made.then(edit)
    return made, structure


@settings(max_examples=15, deadline=None)
@given(st.lists(EDITS, min_size=1, max_size=6))
def test_any_edits_leave_a_truss_without_new_open_ends(edits):
    made, structure = apply_all(edits)
    truss = structure.truss
    before = {tuple(x) for x in BAR.truss.nodes[open_ends(BAR.truss)].tolist()}
    assert {tuple(x) for x in truss.nodes[open_ends(truss)].tolist()} <= before
    used = np.concatenate([np.unique(curve.members) for curve in truss.curves])
    assert set(used.tolist()) == set(range(len(truss.members)))
    assert truss.degrees.sum() == 2 * len(truss.members)
    assert truss.degrees.min() >= 1
    names = [(curve.kind, curve.isovalues, curve.component) for curve in truss.curves]
    assert len(set(names)) == len(names)
    # The plain form replays to the same, to the bit.
    again = EditList.of(made.plain()).replay(BAR, Knobs())
    np.testing.assert_array_equal(again.truss.nodes, truss.nodes)
    np.testing.assert_array_equal(again.truss.members, truss.members)
    assert [c.name for c in again.truss.curves] == [c.name for c in truss.curves]
    undone = made.undone(len(made)).replay(BAR, Knobs())
    assert undone.truss is BAR.truss


@settings(max_examples=6, deadline=None)
@given(st.lists(EDITS, min_size=1, max_size=6), st.floats(0.5, 4.0))
def test_after_any_edits_the_solid_is_valid_or_the_curves_that_stop_it_are_named(edits, radius):
    _, structure = apply_all(edits, coarse_bar(), Knobs(radius=radius))
    truss, result = structure.truss, report_or_message(structure)
    if isinstance(result, str):
        # A radius too large for the cells, or a selection of which later edits leave nothing, or no room.
        assert "is selected by" in result or any(curve.name in result for curve in truss.curves)
        return
    assert result.valid
    assert result.genus == result.expected_genus
    if not result.merged_members and not result.fallback_nodes:
        graph = coo_matrix((np.ones(len(truss.members)), truss.members.T), shape=(len(truss.nodes),) * 2)
        assert result.solids == connected_components(graph)[0]


def report_or_message(structure: Structure) -> SolidReport | str:
    """The report of a structure's solid, or why there is none."""
    try:
        return build_solid(size_structure(structure), structure.knobs).report
    except (InvalidInputError, GeometryKernelError) as error:
        return str(error)


def test_an_edited_truss_is_still_one_valid_solid():
    nodes = BAR.truss.nodes
    ends = [tuple(nodes[np.argmin(np.linalg.norm(nodes - x, axis=1))].tolist()) for x in ([35, 15, 15], [50, 25, 30])]
    edits = (
        Thin(where=Family("third"), every=2),
        Remove(where=Near((40, 20, 40), 8) & Family("compression")),
        AddStrut(between=(ends[0], ends[1])),
        Radius(where=Family("tension"), times=1.3),
        Entasis(where=Family("compression"), to=0.4),
    )
    structure = EditList(edits).replay(BAR, Knobs(radius=0.7))
    report = build_solid(size_structure(structure), structure.knobs).report
    assert report.valid
    assert report.genus == report.expected_genus


@pytest.mark.parametrize("times", [0.1, 0.01])
def test_members_far_thinner_than_their_neighbours_have_a_mesh(times):
    """Their tubes flare from the thick ends of merged nodes."""
    structure = EditList((Radius(where=Family("tension"), times=times),)).replay(coarse_bar(), Knobs(radius=1.0))
    report = build_solid(size_structure(structure), structure.knobs).report
    assert report.valid
    assert report.mesh_volume_mm3 == pytest.approx(report.volume_mm3, rel=1e-3)


def test_the_stress_between_centroids_is_continuous_and_exact_where_it_is_constant():
    fields = Structure.of(BAR, Knobs()).fields
    centroids = fields.mesh.centroids
    np.testing.assert_allclose(interpolate_stress(fields, centroids[:50]), fields.stress[:50], rtol=1e-6, atol=1e-6)
    same = replace(fields, stress=np.broadcast_to(np.diag([3.0, 2.0, 1.0]), fields.stress.shape))
    points = np.random.default_rng(0).uniform((0, 0, 0), (80, 40, 40), (40, 3))
    np.testing.assert_allclose(interpolate_stress(same, points), np.tile(np.diag([3.0, 2.0, 1.0]), (40, 1, 1)))
    line = np.linspace((10, 13, 17), (12, 13, 17), 4000)
    steps = np.abs(np.diff(interpolate_stress(fields, line), axis=0)).max()
    assert steps < 0.01 * np.ptp(interpolate_stress(fields, line), axis=0).max()
