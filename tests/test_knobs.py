import numpy as np
import pytest
from pydantic import ValidationError
from shapes import box_mesh

from michell_cad.errors import InvalidInputError
from michell_cad.isocurves import trace_isocurves
from michell_cad.knobs import Knobs, apply_knobs, describe_knob, entasis_weights
from michell_cad.profiles import named_profile
from michell_cad.truss import CurveKind, Truss, build_truss, member_radius


@pytest.fixture(scope="module")
def grid() -> Truss:
    """A straight grid of 6 x 6 x 6 mm cells in a box; tension along x, compression along y, third along z."""
    mesh = box_mesh((6, 5, 4), (36.0, 30.0, 24.0))
    network = trace_isocurves(mesh, mesh.vertices / 6 + 0.5, ("tension", "compression", "third"))
    return build_truss(network, 6.0)


def test_all_of_the_truss_with_the_default_radius(grid):
    sized = apply_knobs(grid, Knobs())
    assert sized.truss is grid
    np.testing.assert_allclose(sized.radii, 0.48)


def test_one_family_keeps_the_sharp_edges(grid):
    sized = apply_knobs(grid, Knobs(family="tension"))
    assert {c.family for c in sized.truss.curves} == {"tension", "feature"}
    for curve in sized.truss.curves:
        if curve.family == "tension":
            steps = np.diff(sized.truss.nodes[curve.nodes], axis=0)
            np.testing.assert_allclose(steps[:, 1:], 0, atol=1e-3)


def test_every_second_curve(grid):
    sized = apply_knobs(grid, Knobs(every=2, offset=1))
    for curve in sized.truss.curves:
        assert all(v is None or v % 2 == 1 for v in curve.isovalues)
    mixed = apply_knobs(grid, Knobs(every=(2, 1, 1)))
    count = {
        f: sum(c.family == f and c.kind is CurveKind.INTERIOR for c in mixed.truss.curves) for f in ("tension", "third")
    }
    whole = {f: sum(c.family == f and c.kind is CurveKind.INTERIOR for c in grid.curves) for f in ("tension", "third")}
    assert count["third"] == whole["third"]
    assert count["tension"] < whole["tension"] / 2


def test_entasis_is_largest_in_the_middle_of_each_curve(grid):
    sized = apply_knobs(grid, Knobs(radius=0.5, entasis=0.4))
    for curve in sized.truss.curves:
        ends = sized.radii[curve.members]
        assert ends.max() <= 0.5 * 1.4 + 1e-12
        assert ends.min() >= 0.5
        if curve.closed or len(curve.members) < 2:
            continue
        mine = grid.curve_of_member[curve.members] == grid.curves.index(curve)
        if mine.all():
            first = sized.radii[curve.members[0]]
            start = 0 if grid.members[curve.members[0], 0] == curve.nodes[0] else 2
            assert first[start] == pytest.approx(0.5)
    weights = entasis_weights(grid)
    assert weights.min() >= 0
    assert weights.max() <= 1


def test_member_radius_meets_its_three_values_with_flat_ends():
    radii = np.array([1.0, 1.5, 1.2])
    np.testing.assert_allclose(member_radius(radii, np.array([0.0, 0.5, 1.0])), radii)
    h = 1e-6
    for end in (0.0, 1.0):
        slope = (member_radius(radii, np.array([end + h])) - member_radius(radii, np.array([end - h]))) / (2 * h)
        assert abs(slope[0]) < 1e-4


def test_a_radius_too_large_for_the_cells_says_what_would_do(grid):
    with pytest.raises(InvalidInputError, match=r"knobs\.radius = 2 mm.*at most 1\.5 mm"):
        apply_knobs(grid, Knobs(radius=2.0))
    with pytest.raises(InvalidInputError, match="at most 1 mm"):
        apply_knobs(grid, Knobs(radius=1.4, entasis=0.5))


def test_nothing_left_is_refused(grid):
    with pytest.raises(InvalidInputError, match="no curve is left"):
        apply_knobs(grid, Knobs(every=100, offset=50))


@pytest.mark.parametrize(
    "values",
    [
        {"family": "sideways"},
        {"family": ()},
        {"radius": 0},
        {"entasis": 9},
        {"every": 0},
        {"every": (1, 2)},
        {"width": 3},
        {"profile": "rectangle"},
        {"profile": 3},
        {"profile": [1, 2]},
        {"profile": [[0, 0], [1, 1], [1, 0], [0, 1]]},
        {"profile_aspect": 0},
        {"node_form": "cube"},
    ],
)
def test_bad_knobs_are_refused(values):
    with pytest.raises(ValidationError):
        Knobs(**values)


def test_a_bad_profile_says_what_would_work():
    with pytest.raises(ValidationError, match=r"unknown profile 'rectangle'.*a square with profile_aspect"):
        Knobs.model_validate({"profile": "rectangle"})
    with pytest.raises(ValidationError, match="in the order 1, 3, 2, 4"):
        Knobs.model_validate({"profile": [[0, 0], [1, 1], [1, 0], [0, 1]]})


@pytest.mark.parametrize(
    ("values", "swept"),
    [({}, False), ({"profile": "square"}, True), ({"profile_aspect": 1.2}, True), ({"node_form": "hull"}, True)],
)
def test_only_plain_round_members_are_not_swept(values, swept):
    assert Knobs(**values).swept is swept


def test_the_profile_survives_as_json():
    own = Knobs.model_validate({"profile": [[0, 0], [3, 0], [0, 2, -1, 1.5, -1, 0.5]], "profile_aspect": 2})
    again = Knobs.model_validate_json(own.model_dump_json())
    assert again == own
    assert again.shape.pieces == pytest.approx(own.shape.pieces)
    assert Knobs(profile="hexagon").shape.reach == pytest.approx(named_profile("hexagon").reach)


def test_one_line_says_what_the_schema_knows():
    assert describe_knob("radius") == "Radius of the members; default: 0.08 of the cell edge. [mm; above 0]"
    assert describe_knob("entasis").endswith("of each curve. [from -0.5 to 2]")
    assert describe_knob("family").endswith("[all, tension, compression, third]")
