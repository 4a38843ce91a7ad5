from dataclasses import replace

import build123d as bd
import numpy as np
import pytest
from designs import bar_behind, small_bar, turned_design
from scipy.spatial.transform import Rotation

from michell_cad.building import build_united, own_members, resolve_knobs, size_finished
from michell_cad.cad import build_solid, kept_shape, mesh_truss, prepare_truss
from michell_cad.design_file import open_structure, save_design
from michell_cad.edits import (
    AddSheet,
    Attach,
    EditList,
    Entasis,
    Family,
    Join,
    Label,
    Radius,
    Remove,
    Structure,
    Tag,
    Where,
    attachment_frames,
    build_sheets,
    selection_from,
    size_structure,
    tagged_members,
)
from michell_cad.edits.joining import join_trusses
from michell_cad.edits.sizing import part_of_member
from michell_cad.errors import InvalidInputError
from michell_cad.knobs import Knobs
from michell_cad.report import count_components
from michell_cad.truss import open_ends

ONE, OTHER = small_bar(), bar_behind()


def test_two_bars_become_one_component_whose_nodes_meet_in_the_common_face():
    truss = join_trusses(ONE.truss, ONE.problem.mesh, OTHER.truss, OTHER.problem.mesh)
    assert count_components(truss) == 1
    assert set(open_ends(truss).tolist()) <= set(open_ends(ONE.truss).tolist())
    x = truss.nodes[truss.members][:, :, 0]
    assert not ((x.min(1) < 79) & (x.max(1) > 81)).any()
    in_face = np.abs(truss.nodes[:, 0] - 80) < 1e-6
    both = in_face & np.isin(np.arange(len(in_face)), truss.members[x.max(1) > 81])
    assert both.sum() > 5
    names = [(c.kind, c.isovalues, c.component) for c in truss.curves]
    assert len(set(names)) == len(names)


def test_nodes_that_meet_already_stay_where_they_are():
    """The sharp edges of both bars end in the corners of the common face, and go on through it unbent."""
    truss = join_trusses(ONE.truss, ONE.problem.mesh, OTHER.truss, OTHER.problem.mesh)
    for y, z in ((0, 0), (0, 40), (40, 0), (40, 40)):
        (corner,) = np.flatnonzero(np.linalg.norm(truss.nodes - [80, y, z], axis=1) < 1e-6)
        ends = truss.nodes[truss.members[(truss.members == corner).any(1)]]
        along = np.linalg.norm(ends[:, :, 1:] - [y, z], axis=2).max(1) < 1e-6
        assert sorted(ends[along].mean(1)[:, 0] > 80) == [False, True]


def test_the_joined_truss_is_one_valid_solid(tmp_path):
    save_design(tmp_path / "other.npz", OTHER, Knobs(every=2))
    structure = EditList((Join(design=str(tmp_path / "other.npz")),)).replay(ONE, Knobs(every=2))
    report = build_solid(size_structure(structure), structure.knobs).report
    assert report.solids == count_components(structure.truss) == 1
    assert report.valid
    assert report.genus == report.expected_genus
    assert structure.whole_mesh.volumes.sum() == pytest.approx(2 * 80 * 40 * 40)


def test_what_either_design_keeps_is_kept(tmp_path):
    """A bolted foot at the far end of the other bar, and a pad where the first one is held."""
    foot = kept_shape("foot", bd.Pos(155, 20, 20) * (bd.Box(10, 40, 40) - bd.Rot(0, 90, 0) * bd.Cylinder(4, 10)))
    pad = kept_shape("pad", bd.Pos(2, 20, 20) * bd.Box(4, 40, 40))
    save_design(tmp_path / "other.npz", OTHER, Knobs(every=4, fillet_ratio=0.0), kept=(foot,))
    edits = EditList((Join(design=str(tmp_path / "other.npz")),))
    save_design(tmp_path / "both.npz", ONE, Knobs(every=4, fillet_ratio=0.0), edits, kept=(pad,))
    structure = open_structure(tmp_path / "both.npz")
    assert [one.name for one in structure.kept] == ["pad"]
    assert [one.name for one in structure.whole_kept] == ["pad", "joined foot"]
    report = build_united(structure, size_finished(structure), lambda stage, fraction: None).report
    assert report.valid
    assert report.solids == 1
    assert report.kept is not None
    assert report.kept.volume_mm3 == pytest.approx(40 * 40 * 14 - np.pi * 16 * 10, rel=1e-6)


def test_a_turned_pair_gives_the_turned_truss():
    Q = Rotation.random(random_state=5).as_matrix()
    # The bars are symmetric, so that several pairings cost the same; a little noise leaves one.
    noise = 0.05 * np.random.default_rng(1).normal(size=OTHER.truss.nodes.shape)
    uneven = replace(OTHER, truss=replace(OTHER.truss, nodes=OTHER.truss.nodes + noise))
    a, b = turned_design(ONE, Q), turned_design(uneven, Q)
    turned = join_trusses(a.truss, a.problem.mesh, b.truss, b.problem.mesh)
    straight = join_trusses(ONE.truss, ONE.problem.mesh, uneven.truss, OTHER.problem.mesh)
    np.testing.assert_allclose(turned.nodes, straight.nodes @ Q.T, atol=1e-9)
    np.testing.assert_array_equal(turned.members, straight.members)


def test_parts_that_do_not_touch_are_refused(tmp_path):
    Q = Rotation.from_euler("z", 180, degrees=True).as_matrix()
    save_design(tmp_path / "far.npz", turned_design(OTHER, Q), Knobs())
    with pytest.raises(InvalidInputError, match="the parts have no common face"):
        EditList((Join(design=str(tmp_path / "far.npz")),)).replay(ONE, Knobs())
    with pytest.raises(InvalidInputError, match="no design file"):
        EditList((Join(design=str(tmp_path / "none.npz")),)).replay(ONE, Knobs())


def test_parts_that_overlap_are_refused(tmp_path):
    save_design(tmp_path / "same.npz", ONE, Knobs())
    with pytest.raises(InvalidInputError, match="the parts overlap by 100%"):
        EditList((Join(design=str(tmp_path / "same.npz")),)).replay(ONE, Knobs())


def test_edits_after_a_join_see_both(tmp_path):
    save_design(tmp_path / "other.npz", OTHER, Knobs(), EditList((Remove(where=Where("boundary"), prune=False),)))
    edits = EditList((Join(design=str(tmp_path / "other.npz")), Remove(where=Where("boundary"))))
    truss = edits.replay(ONE, Knobs()).truss
    assert truss.nodes[:, 0].max() > 100
    assert {str(curve.kind) for curve in truss.curves} == {"interior"}


THEIRS = EditList(
    (
        Radius(where=Family("compression"), times=1.25),
        Entasis(where=Family("tension"), to=0.3),
        Radius(where=Family("third"), over="stress", values=(0.6, 1.2)),
        Tag(name="steel", where=Family("tension")),
        AddSheet(coordinate="tension", low=2, high=2, thickness=0.7),
        Attach(part="lamp.step", where=Family("third") & Where("inside"), spacing=10.0),
    )
)


@pytest.fixture(scope="module")
def with_theirs(tmp_path_factory) -> Structure:
    """The first bar with edits on both sides of joining the other, which has knobs and edits of its own."""
    file = tmp_path_factory.mktemp("joined") / "other.npz"
    save_design(file, OTHER, Knobs(radius=1.4, smallest_radius=1.0), THEIRS)
    before = (Radius(where=Family("tension"), times=1.5), Entasis(to=0.1), Tag(name="oak", where=Where("inside")))
    after = (Radius(where=Family("feature"), to=0.9),)
    return EditList((*before, Join(design=str(file)), *after)).replay(ONE, Knobs(radius=1.0))


def test_members_of_either_part_have_the_radii_of_its_own_knobs_and_edits(with_theirs):
    truss, radii = with_theirs.truss, size_structure(with_theirs).radii
    part, far = part_of_member(truss), truss.nodes[truss.members][:, :, 0].max(1) > 81
    np.testing.assert_array_equal(part == 1, far)

    def least(number: int, family: str) -> float:
        return float(radii[(part == number) & Family(family).members(truss)].min())

    assert least(0, "tension") == pytest.approx(1.5)
    assert least(0, "compression") == least(0, "third") == pytest.approx(1.0)
    assert least(1, "compression") == pytest.approx(1.25 * 1.4)
    assert least(1, "tension") == pytest.approx(1.4)
    # Sharp edges by the edit after the join, which is about both; but their file says that nothing is below 1 mm.
    feature = Family("feature").members(truss)
    assert radii[feature & (part == 0)].max() == pytest.approx(0.9 * 1.1, rel=1e-3)
    np.testing.assert_allclose(radii[feature & (part == 1)], 1.0)
    # Entasis 0.1 here, and 0.3 on their tension curves.
    open_tension = [c for c in truss.curves if c.family == "tension" and not c.closed and len(c.members) > 2]
    for number, most in ((0, 1.1 * 1.5), (1, 1.3 * 1.4)):
        members = np.concatenate([c.members for c in open_tension if c.part == number])
        members = members[Family("tension").members(truss)[members]]
        assert radii[members].max() == pytest.approx(most, rel=0.03)


def test_their_stress_is_that_of_their_own_part(with_theirs, tmp_path):
    """Members that the join leaves where they are have exactly the radii that they have in their own file."""
    alone = THEIRS.replay(OTHER, Knobs(radius=1.4, smallest_radius=1.0))
    third = Family("third").members(alone.truss)
    places = [tuple(x) for x in ends(alone.truss)[third].tolist()]
    as_alone = dict(zip(places, size_structure(alone).radii[third].min(1), strict=True))
    truss, radii = with_theirs.truss, size_structure(with_theirs).radii
    mine = (part_of_member(truss) == 1) & Family("third").members(truss)
    here = dict(zip([tuple(x) for x in ends(truss)[mine].tolist()], radii[mine].min(1), strict=True))
    both = here.keys() & as_alone.keys()
    assert len(both) > 20
    np.testing.assert_allclose([here[place] for place in both], [as_alone[place] for place in both], rtol=1e-9)


def ends(truss) -> np.ndarray:
    return np.sort(truss.nodes[truss.members], axis=1).reshape(-1, 6).round(9)


def test_their_tags_sheets_and_attachments_come_along(with_theirs):
    truss, part = with_theirs.truss, part_of_member(with_theirs.truss)
    tags = tagged_members(with_theirs)
    np.testing.assert_array_equal(tags["steel"], Family("tension").members(truss) & (part == 1))
    np.testing.assert_array_equal(tags["oak"], Where("inside").members(truss) & (part == 0))
    (plate,) = build_sheets(with_theirs)
    (alone,) = build_sheets(THEIRS.replay(OTHER, Knobs()))
    np.testing.assert_array_equal(plate.vertices, alone.vertices)
    (attach,) = with_theirs.of_kind(Attach)
    assert attachment_frames(with_theirs, attach).origins[:, 0].min() > 79


def test_a_part_can_be_selected_and_labels_of_families_are_those_of_each_part(with_theirs):
    truss = with_theirs.truss
    theirs = selection_from({"part": 1})
    assert selection_from(theirs.plain()) == theirs
    np.testing.assert_array_equal(theirs.members(truss), part_of_member(truss) == 1)
    with pytest.raises(InvalidInputError, match="part must be whole"):
        selection_from({"part": "first"})
    # As if families of the other part ran along other coordinates.
    axes = {0: 1, 1: 2, 2: 0, -1: -1}
    curves = tuple(
        c if c.part == 0 else replace(c, axis=axes[c.axis], isovalues=tuple(c.isovalues[k] for k in (2, 0, 1)))
        for c in truss.curves
    )
    np.testing.assert_array_equal(
        Label("tension", 2, 4).curves(replace(truss, curves=curves)), Label("tension", 2, 4).curves(truss)
    )


def test_three_parts_in_a_chain_keep_apart(tmp_path):
    """The third is joined to the second and these to the first: numbers of parts move up, and so do edits of them."""
    third = turned_design(ONE, np.eye(3))
    mesh = third.problem.mesh
    moved = replace(mesh, vertices=mesh.vertices + [160.0, 0, 0])
    third = replace(
        third,
        problem=replace(third.problem, mesh=moved),
        parametrization=replace(third.parametrization, mesh=moved),
        truss=replace(third.truss, nodes=third.truss.nodes + [160.0, 0, 0]),
    )
    save_design(tmp_path / "third.npz", third, Knobs(radius=0.7))
    edits = EditList((Join(design=str(tmp_path / "third.npz")), Radius(where=selection_from({"part": 1}), times=1.1)))
    save_design(tmp_path / "second.npz", OTHER, Knobs(radius=0.8), edits)
    structure = EditList((Join(design=str(tmp_path / "second.npz")),)).replay(ONE, Knobs(radius=0.9))
    radii, part = size_structure(structure).radii, part_of_member(structure.truss)
    assert [radii[part == number].max() for number in range(3)] == pytest.approx([0.9, 0.8, 0.77])
    assert count_components(structure.truss) == 1
    assert structure.whole_mesh.volumes.sum() == pytest.approx(3 * 80 * 40 * 40)


def test_either_part_has_the_volume_that_its_own_knobs_ask_for(tmp_path):
    save_design(tmp_path / "other.npz", OTHER, Knobs(volume_fraction=0.09, every=2, node_ratio=2.0))
    edits = EditList((Join(design=str(tmp_path / "other.npz")),))
    structure = edits.replay(ONE, Knobs(volume_fraction=0.06, every=2))
    sizing = size_finished(structure)
    for number, fraction in enumerate((0.06, 0.09)):
        own = own_members(sizing.sized, number)
        assert mesh_truss(prepare_truss(own, sizing.knobs)).volume == pytest.approx(fraction * 128e3, rel=0.01)
    assert any("another node_ratio" in note for note in sizing.notes)
    assert any("about its own members" in note for note in sizing.notes)
    resolved = resolve_knobs(structure)
    assert resolved.knobs.radius == sizing.knobs.radius
    assert resolved.joined[0].knobs.node_ratio == 2.0


def test_a_sheet_of_no_part_is_refused():
    with pytest.raises(InvalidInputError, match="there is no part 1: the 1 count from 0"):
        EditList((AddSheet(coordinate=0, low=1, high=3, thickness=0.5, part=1),)).replay(ONE, Knobs())
