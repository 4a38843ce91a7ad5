from dataclasses import replace

import build123d as bd
import numpy as np
import pytest
from designs import bar_behind, small_bar, turned_design
from scipy.spatial.transform import Rotation

from michell_cad.building import build_united, size_finished
from michell_cad.cad import build_solid, kept_shape
from michell_cad.design_file import open_structure, save_design
from michell_cad.edits import EditList, Join, Remove, Where, size_structure
from michell_cad.edits.joining import join_trusses
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


def test_edits_after_a_join_see_both(tmp_path):
    save_design(tmp_path / "other.npz", OTHER, Knobs(), EditList((Remove(where=Where("boundary"), prune=False),)))
    edits = EditList((Join(design=str(tmp_path / "other.npz")), Remove(where=Where("boundary"))))
    truss = edits.replay(ONE, Knobs()).truss
    assert truss.nodes[:, 0].max() > 100
    assert {str(curve.kind) for curve in truss.curves} == {"interior"}
