"""The part of the Fusion add-in that is free of the host, against michell_cad itself."""

import json
from itertools import pairwise

import numpy as np
import pytest
from fusion_layouts import curved_truss, ring_truss, write_layout
from MichellTruss.logic.isosurface import isosurfaces
from MichellTruss.logic.knobs import read_knobs
from MichellTruss.logic.layout import LayoutError, parse_layout, read_layout
from MichellTruss.logic.plan import TooLargeError, make_plan, node_spheres, refuse_too_large
from MichellTruss.logic.selection import apply_knobs, chord_fractions, entasis_weight
from MichellTruss.logic.splines import curve_pieces, is_smooth, joined
from MichellTruss.logic.units import from_host, to_host
from scipy.interpolate import BSpline

from michell_cad.errors import InvalidInputError
from michell_cad.knobs import Knobs
from michell_cad.knobs import apply_knobs as michell_apply_knobs
from michell_cad.splines import fit_splines
from michell_cad.truss import SizedTruss

KNOBS = [
    Knobs(),
    Knobs(entasis=0.4),
    Knobs(radius=0.3, every=2),
    Knobs(every=3, offset=1, entasis=0.5),
    Knobs(family="tension", entasis=0.5),
    Knobs(family=("tension", "third"), every=(2, 1, 3), offset=(1, 0, 0), entasis=-0.3),
]

ROUNDED = 5e-6
"""Positions and the spacing in the file are rounded to 1e-6 mm."""


@pytest.fixture(scope="module")
def layout(tmp_path_factory):
    return read_layout(write_layout(tmp_path_factory.mktemp("fusion") / "truss.json"))


@pytest.mark.parametrize("knobs", KNOBS)
def test_the_same_curves_nodes_and_radii_as_michell_cad(layout, knobs):
    expected = michell_apply_knobs(curved_truss(), knobs)
    chosen = apply_knobs(layout, knobs.model_dump(mode="json"))
    truss = expected.truss
    assert [layout.curves[number].name for number in chosen.curves] == [curve.name for curve in truss.curves]
    compared = 0
    for number, curve in zip(chosen.curves, truss.curves, strict=True):
        stations = chosen.stations[number]
        nodes = np.array([layout.nodes[node] for node, _ in stations])
        np.testing.assert_allclose(nodes, truss.nodes[curve.nodes], atol=ROUNDED)
        for step, member in enumerate(curve.members):
            if truss.curves[truss.curve_of_member[member]] is curve:
                radii = expected.radii[member][:: 1 if truss.members[member, 0] == curve.nodes[step] else -1]
                mine = [chosen.radius_at(weight) for _, weight in (stations[step], stations[step + 1])]
                np.testing.assert_allclose(mine, radii[[0, 2]], atol=ROUNDED)
                compared += 1
    assert compared == len(truss.members)


def test_the_same_knobs_on_a_part_of_the_paper(data_folder, tmp_path):
    """A coarse bar in torsion, whose thinner versions have dissolved nodes."""
    import michell_cad as mc
    from michell_cad.job import Setup

    problem = mc.build_problem(Setup(), mc.read_part(str(data_folder / "problems" / "bar_torsion.npz")))
    truss = mc.design(problem, mc.DesignOptions(resolution=6)).truss
    layout = read_layout(write_layout(tmp_path / "truss.json", sized=michell_apply_knobs(truss, Knobs())))
    for knobs in (Knobs(every=2, entasis=0.4), Knobs(family="compression", entasis=0.4)):
        expected = michell_apply_knobs(truss, knobs)
        chosen = apply_knobs(layout, knobs.model_dump(mode="json"))
        assert [len(chosen.stations[n]) for n in chosen.curves] == [len(c.nodes) for c in expected.truss.curves]
        found = sorted(chosen.radius_at(weight) for stations in chosen.stations.values() for _, weight in stations)
        assert found[-1] == pytest.approx(expected.radii[:, [0, 2]].max(), abs=ROUNDED)
        assert found[0] == pytest.approx(expected.radii[:, [0, 2]].min(), abs=ROUNDED)


@pytest.mark.parametrize("knobs", [{"radius": 1.4, "entasis": 0.5}, {"every": 100, "offset": 50}])
def test_what_michell_cad_refuses_is_refused(layout, knobs):
    with pytest.raises(InvalidInputError) as theirs:
        michell_apply_knobs(curved_truss(), Knobs(**knobs))
    with pytest.raises(LayoutError) as mine:
        apply_knobs(layout, Knobs(**knobs).model_dump(mode="json"))
    assert ("too large" in str(theirs.value)) == ("too large" in str(mine.value))


def test_radii_that_no_knob_gives_stand_until_a_size_is_changed(tmp_path):
    plain = michell_apply_knobs(curved_truss(), Knobs())
    radii = plain.radii * np.linspace(1, 2, len(plain.radii))[:, None]
    layout = read_layout(write_layout(tmp_path / "truss.json", sized=SizedTruss(plain.truss, radii)))
    values = dict(layout.knobs)
    chosen = apply_knobs(layout, values | {"family": "tension"})
    assert chosen.radius is None
    drawn = [section.radius for tube in make_plan(layout, chosen).tubes for section in tube.sections]
    mine = radii[[m for n in chosen.curves for m in curved_truss().curves[n].members]]
    assert min(drawn) == pytest.approx(mine.min() / 10, rel=0.02)
    assert max(drawn) == pytest.approx(mine.max() / 10, rel=0.02)
    assert apply_knobs(layout, values | {"radius": 0.4}).radius == 0.4


def test_members_of_one_radius_each_are_swept_one_by_one(tmp_path):
    plain = michell_apply_knobs(curved_truss(), Knobs())
    each = np.linspace(0.3, 0.9, len(plain.radii))
    sized = SizedTruss(plain.truss, np.repeat(each[:, None], 3, axis=1))
    layout = read_layout(write_layout(tmp_path / "truss.json", sized=sized))
    tubes = make_plan(layout, apply_knobs(layout, layout.knobs)).tubes
    assert all(tube.is_sweep for tube in tubes)
    np.testing.assert_allclose(sorted(tube.sections[0].radius for tube in tubes), each / 10, atol=ROUNDED / 10)


def test_volume_and_mass_are_left_to_michell_cad(layout):
    with pytest.raises(LayoutError, match="needs the united solid"):
        apply_knobs(layout, dict(layout.knobs) | {"volume_fraction": 0.1})
    thick = dict(layout.knobs) | {"radius": 0.3, "smallest_radius": 0.7}
    assert apply_knobs(layout, thick).radius_at(0.0) == 0.7


def test_smooth_pieces_are_the_splines_of_the_file(layout):
    """Without the knots that are not needed the curve is the same, at the same parameters."""
    splines, checked = fit_splines(curved_truss()), 0
    assert len(splines.lengths) == len(layout.members)
    for curve in layout.curves:
        pieces = curve_pieces(layout, curve)
        if curve.closed or not all(map(is_smooth, pieces, pieces[1:])):
            continue
        whole, given = joined(pieces), curve.spline
        parameters = np.linspace(0, given.knots[-1], 101)
        expected = BSpline(given.knots, np.array(given.points), 3)(parameters)
        np.testing.assert_allclose(BSpline(whole.knots, np.array(whole.points), 3)(parameters), expected, atol=2e-5)
        assert len(whole.points) == 2 * len(pieces) + 2
        lengths = [sum(piece.length for piece in pieces if piece.step == step) for step in range(len(curve.members))]
        np.testing.assert_allclose(lengths, splines.lengths[list(curve.members)], rtol=1e-6)
        checked += 1
    assert checked > 50


def test_the_plan_covers_every_member_once_in_centimetres(layout):
    chosen = apply_knobs(layout, Knobs(radius=0.5, entasis=0.4).model_dump(mode="json"))
    plan = make_plan(layout, chosen)
    lengths = fit_splines(curved_truss()).lengths
    drawn = 0.0
    for tube in plan.tubes:
        fine = BSpline(tube.knots, np.array(tube.points), 3)(np.linspace(0, tube.knots[-1], 400))
        drawn += np.linalg.norm(np.diff(fine, axis=0), axis=1).sum()
        first, last = tube.sections[0], tube.sections[-1]
        assert (first.at, last.at) == (0, pytest.approx(1))
        np.testing.assert_allclose([first.centre, last.centre], [fine[0], fine[-1]], atol=1e-9)
        for section in tube.sections:
            assert section.weight is not None
            assert section.radius == pytest.approx(0.05 * (1 + 0.4 * section.weight))
    assert drawn == pytest.approx(lengths.sum() / 10, rel=1e-4)
    assert set(plan.families) == {"tension", "compression", "third", "feature"}
    whole = [tube for tube in plan.tubes if "part" not in tube.name and len(tube.sections) % 2]
    assert max(section.radius for tube in whole for section in tube.sections) == pytest.approx(0.07, rel=0.01)


def test_a_closed_curve(tmp_path):
    """Alone it is one closed tube; shared with another curve it is the arc that is left, across its first node."""
    sized = michell_apply_knobs(ring_truss(), Knobs())
    layout = read_layout(write_layout(tmp_path / "truss.json", sized=sized))
    (ring,) = make_plan(layout, apply_knobs(layout, Knobs(family="third").model_dump(mode="json"))).tubes
    assert ring.closed
    assert ring.points[0] == pytest.approx(ring.points[-1])
    round_ = BSpline(ring.knots, np.array(ring.points), 3)(np.linspace(0, ring.knots[-1], 200))
    np.testing.assert_allclose(np.linalg.norm(round_, axis=1), 1.0, rtol=0.01)
    arc, part = make_plan(layout, apply_knobs(layout, Knobs().model_dump(mode="json"))).tubes
    assert (arc.closed, part.closed) == (False, False)
    assert (arc.family, part.family) == ("third", "tension")
    np.testing.assert_allclose([arc.points[0], arc.points[-1]], ring_truss().nodes[[5, 3]] / 10, atol=1e-6)
    at_node = 0.5 + 0.1 * np.sin(np.arange(8) * np.pi / 8)
    ends = at_node[ring_truss().members]
    thick = SizedTruss(ring_truss(), np.stack([ends[:, 0], np.full(8, 0.7), ends[:, 1]], axis=1))
    layout = read_layout(write_layout(tmp_path / "thick.json", sized=thick))
    (ring,) = make_plan(layout, apply_knobs(layout, dict(layout.knobs) | {"family": "third"})).tubes
    assert ring.closed
    # michell_cad leaves three of its eight nodes, and a section stands between each two.
    thinner = michell_apply_knobs(ring_truss(), Knobs(family="third")).truss
    assert len(ring.sections) == 2 * len(thinner.nodes) == 6
    assert ring.sections[-1].at < 1


def test_constant_radius_is_swept_and_nodes_are_spheres(layout):
    chosen = apply_knobs(layout, Knobs(radius=0.5, node_ratio=2.0).model_dump(mode="json"))
    plan = make_plan(layout, chosen)
    assert all(tube.is_sweep and tube.sections[0].radius == pytest.approx(0.05) for tube in plan.tubes)
    assert len(plan.spheres) == len(curved_truss().nodes)
    assert {round(sphere.radius, 9) for sphere in plan.spheres} == {0.1}
    np.testing.assert_allclose([sphere.centre for sphere in plan.spheres], curved_truss().nodes / 10, atol=1e-6)
    thinner = apply_knobs(layout, Knobs(family="tension").model_dump(mode="json"))
    assert len(node_spheres(layout, thinner)) < len(plan.spheres)


def test_entasis_weight_and_chords_by_hand(layout):
    assert [entasis_weight(x) for x in (0, 0.25, 0.5, 1)] == [0, 0.5625, 1, 0]
    curve = next(number for number, one in enumerate(layout.curves) if len(one.nodes) > 3)
    fractions = chord_fractions(layout, layout.curves[curve].nodes, curve)
    assert fractions[0] == 0
    assert fractions[-1] == 1
    assert all(a < b for a, b in pairwise(fractions))


def test_units_of_the_knobs():
    assert to_host(3.0, "mm") == pytest.approx(0.3)
    assert from_host(0.3, "mm") == pytest.approx(3.0)
    assert to_host(5.0, "g") == pytest.approx(0.005)
    assert to_host(5.0, "1") == 5.0
    with pytest.raises(LayoutError, match="furlong"):
        to_host(1.0, "furlong")


def test_isosurfaces_hold_the_curves_with_their_value(layout):
    surfaces = isosurfaces(layout)
    assert {surface.family for surface in surfaces} == {"tension", "compression", "third"}
    for surface in surfaces:
        held = [curve for curve in layout.curves if surface.holds(curve)]
        assert held
        assert surface.family not in {curve.family for curve in held if curve.kind == "interior"}


def test_a_truss_too_large_offers_the_step(layout):
    chosen = apply_knobs(layout, Knobs(entasis=0.4).model_dump(mode="json"))
    plan = make_plan(layout, chosen)
    refuse_too_large(make_plan(layout, apply_knobs(layout, {"family": "tension"})))
    many = type(plan)(plan.tubes * 20, ())
    with pytest.raises(TooLargeError, match=r"bodies and about .* timeline entries.*STEP"):
        refuse_too_large(many)


def _damaged(text: str, **changes) -> str:
    return json.dumps(json.loads(text) | changes)


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda text: _damaged(text, version=2), "newer michell_cad.*version 2.*up to version 1"),
        (lambda text: _damaged(text, version="next"), "newer michell_cad"),
        (lambda text: _damaged(text, format="something.else"), "not a truss layout"),
        (lambda text: "[1, 2]", "not a truss layout"),
        (lambda text: text[: len(text) // 2], "damaged"),
        (lambda text: _damaged(text, units={"length": "inch"}), "millimetres only"),
        (lambda text: _damaged(text, spacing=0), "incomplete or damaged.*spacing"),
        (lambda text: _damaged(text, nodes=[]), "incomplete or damaged"),
        (lambda text: _damaged(text, members=[]), "incomplete or damaged"),
        (lambda text: _damaged(text, curves=None), "incomplete or damaged"),
        (lambda text: json.dumps({k: v for k, v in json.loads(text).items() if k != "curves"}), "curves"),
        (lambda text: text.replace('"radii":[', '"radii":[-', 1), "radius is not positive"),
        (lambda text: text.replace('"degree":3', '"degree":2', 1), "not made of cubic pieces"),
    ],
)
def test_a_bad_layout_is_refused_in_words(layout, spoil, says):
    with pytest.raises(LayoutError, match=f"(?s)truss.json.*{says}"):
        parse_layout(spoil(layout.text), "truss.json")


def test_a_layout_that_is_not_there(tmp_path):
    with pytest.raises(LayoutError, match=r"nothing\.json cannot be read.*michell-cad wrote"):
        read_layout(tmp_path / "nothing.json")


def test_every_knob_of_the_file_is_known(layout):
    assert set(layout.knobs) == {knob.name for knob in read_knobs()}
