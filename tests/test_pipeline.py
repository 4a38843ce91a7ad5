import dataclasses

import numpy as np
import pytest
from shapes import box_mesh, cantilever

from michell_cad.errors import InvalidInputError
from michell_cad.parametrization import ParametrizationOptions
from michell_cad.pipeline import STAGES, Design, DesignOptions, design
from michell_cad.problem import DesignProblem, LoadCase
from michell_cad.report import report_design
from michell_cad.truss import CurveKind, NodeKind


@pytest.fixture(scope="module")
def bar() -> Design:
    return design(cantilever((16, 8, 8)), DesignOptions(resolution=12))


def test_the_stages_run_in_order_and_report_their_progress():
    seen: list[tuple[str, float]] = []
    result = design(cantilever((6, 3, 3)), DesignOptions(resolution=5), lambda stage, f: seen.append((stage, f)))
    assert tuple(dict.fromkeys(stage for stage, _ in seen)) == STAGES
    assert [t.name for t in result.times] == list(STAGES)
    for stage in STAGES:
        fractions = [f for s, f in seen if s == stage]
        assert fractions == sorted(fractions)
        assert fractions[0] == 0
        assert fractions[-1] == 1


def test_every_curve_is_labelled_and_closed_or_ends_on_the_boundary(bar):
    for curves, kinds in ((bar.network.curves, bar.network.node_kinds), (bar.truss.curves, bar.truss.node_kinds)):
        labels = {(c.kind, c.isovalues, c.component) for c in curves}
        assert len(labels) == len(curves)
        for curve in curves:
            assert curve.closed or (kinds[[curve.nodes[0], curve.nodes[-1]]] != NodeKind.INTERIOR).all()
            assert (
                sum(v is not None for v in curve.isovalues) == {"interior": 2, "boundary": 1, "feature": 0}[curve.kind]
            )


def test_members_of_a_cantilever_follow_the_bending_stress(bar):
    """Near the top and bottom faces, away from the ends, members run along the bar or across it."""
    truss = bar.truss
    middle = truss.nodes[truss.members].mean(1)
    direction = np.diff(truss.nodes[truss.members], axis=1)[:, 0] / truss.lengths[:, None]
    near = (np.abs(middle[:, 2] - 20) > 14) & (np.abs(middle[:, 0] - 40) < 25)
    along = np.abs(direction[near, 0])
    assert near.sum() > 50
    assert np.mean((along > 0.95) | (along < 0.3)) > 0.8
    # The load pulls down: tension runs along the top, compression along the bottom.
    for family, side in (("tension", 1), ("compression", -1)):
        nodes = np.concatenate([c.nodes for c in truss.curves if c.family == family and c.kind is CurveKind.INTERIOR])
        x = truss.nodes[nodes]
        assert side * (x[np.abs(x[:, 0] - 30) < 20, 2].mean() - 20) > -2


def test_report_figures_agree_with_the_design(bar):
    report = report_design(bar, bar.truss)
    assert set(report["cpu_s"]) == set(STAGES)
    assert report["parametrization"] == {
        "inverted_tets": 0,
        "double_wound_edges": 0,
        "outside_spacing_bounds": None,
        "min_det_over_median": report["parametrization"]["min_det_over_median"],
    }
    assert 0 < report["parametrization"]["min_det_over_median"] <= 1
    truss = report["truss"]
    assert truss["interior_degree_6"] == 1.0
    assert truss["duplicate_members"] == 0
    assert truss["components"] == 1
    assert truss["shortest_member_mm"] > 0
    assert set(truss["valence"]["before"]["interior"]) == {"6"}
    assert sum(truss["valence"]["after"]["interior"].values()) == (bar.truss.node_kinds == NodeKind.INTERIOR).sum()
    assert sum(truss["curves_per_family"].values()) == len(bar.truss.curves)
    a = report["alignment"]
    assert a["curve_shear_residual"] < 0.3
    assert a["angle_deg"][0] == pytest.approx(90, abs=2)


def test_the_report_says_how_much_is_outside_of_the_spacing_bounds(bar):
    tight = ParametrizationOptions(spacing_bounds=(0.999, 1.001))
    options = dataclasses.replace(bar.options, parametrization=tight)
    report = report_design(dataclasses.replace(bar, options=options), bar.truss)
    assert 0.9 < report["parametrization"]["outside_spacing_bounds"] <= 1


def test_the_answer_is_the_same_every_time():
    one, two = (design(cantilever((6, 3, 3)), DesignOptions(spacing=15.0)).truss for _ in range(2))
    np.testing.assert_array_equal(one.nodes, two.nodes)
    np.testing.assert_array_equal(one.members, two.members)
    assert [c.name for c in one.curves] == [c.name for c in two.curves]


def test_cells_too_fine_for_the_mesh_are_refused_with_a_mesh_size():
    with pytest.raises(InvalidInputError, match=r"too fine.*mesh\.size"):
        design(cantilever((6, 3, 3)), DesignOptions(resolution=200))


@pytest.mark.parametrize("options", [{"resolution": -1}, {"spacing": 0}, {"resolution": 3, "spacing": 1}])
def test_bad_options_are_refused(options):
    with pytest.raises(InvalidInputError, match=r"resolution|spacing"):
        DesignOptions(**options)


def test_unknown_layers_are_refused():
    options = DesignOptions()
    object.__setattr__(options, "layers", "tight")  # the checker of types would refuse it sooner
    with pytest.raises(InvalidInputError, match="layers must be one of"):
        options.__post_init__()


def test_one_tet_gives_a_truss_or_a_clear_refusal():
    mesh = box_mesh((1, 1, 1), (10.0, 10.0, 10.0))
    fixed = np.repeat((mesh.vertices[:, 2] == 0)[:, None], 3, axis=1)
    force = np.where(mesh.vertices[:, 2:] == 10, [[1.0, 0, -2.0]], 0)
    material = cantilever((2, 1, 1)).material
    truss = design(DesignProblem(mesh, material, fixed, (LoadCase("a", force),)), DesignOptions(resolution=2)).truss
    assert len(truss.members)
