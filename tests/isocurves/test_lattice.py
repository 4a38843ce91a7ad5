"""The predicates against rational arithmetic with an explicit tiny shift, which has no ties."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest

from michell_cad.errors import InvalidInputError
from michell_cad.isocurves import lattice
from michell_cad.isocurves.edge_crossings import cross_edges
from michell_cad.isocurves.lattice import PAIRS, USUAL_CROSSINGS, GridLevels, cross_faces, round_levels

SHIFT = (Fraction(1, 10**20), Fraction(1, 10**40), Fraction(1, 10**60))


def random_grid(rng: np.random.Generator, n: int, shift: int) -> GridLevels:
    """Odd levels within two cells of zero, on so coarse a grid that ties abound."""
    reach = 1 << shift
    return GridLevels(2 * rng.integers(-reach, reach, (n, 3)) + 1, shift)


def shifted(grid: GridLevels, vertex: int) -> list[Fraction]:
    """Levels of a vertex in cells, lowered by the shift."""
    return [Fraction(int(v), grid.cell) - e for v, e in zip(grid.values[vertex], SHIFT, strict=True)]


def below(x: Fraction) -> int:
    return x.numerator // x.denominator


@pytest.mark.parametrize("shift", [1, 2, 3])
def test_face_crossings_equal_those_of_rational_arithmetic(shift: int) -> None:
    rng = np.random.default_rng(shift)
    grid = random_grid(rng, 60, shift)
    faces = np.sort(np.stack([rng.permutation(60)[:3] for _ in range(80)]), axis=1)
    vertices = rng.normal(size=(60, 3))
    found = cross_faces(vertices, faces, grid)
    table = {
        (int(f), int(p), int(a), int(b)): (int(c), point, level)
        for f, p, a, b, c, point, level in zip(
            found.face, found.pair, found.a, found.b, found.floor, found.points, found.level, strict=True
        )
    }
    expected = {}
    for f, face in enumerate(faces):
        corners = [shifted(grid, int(v)) for v in face]
        for pair, (i, j) in enumerate(PAIRS):
            k = 2 - pair
            for a, b in product(range(-3, 4), repeat=2):
                x = [(c[i] - a, c[j] - b) for c in corners]
                w = [x[(e + 1) % 3][0] * x[(e + 2) % 3][1] - x[(e + 2) % 3][0] * x[(e + 1) % 3][1] for e in range(3)]
                if all(v > 0 for v in w) or all(v < 0 for v in w):
                    third = sum(v * c[k] for v, c in zip(w, corners, strict=True)) / sum(w)
                    point = np.array([float(v / sum(w)) for v in w]) @ vertices[face]
                    expected[f, pair, a, b] = below(third), point, float(third)
    assert len(expected) > 100
    assert table.keys() == expected.keys()
    for key, (floor, point, level) in expected.items():
        assert table[key][0] == floor
        np.testing.assert_allclose(table[key][1], point, atol=1e-12)
        assert table[key][2] == pytest.approx(level, abs=1e-12)


@pytest.mark.parametrize("shift", [1, 2, 3])
def test_edge_crossings_equal_those_of_rational_arithmetic(shift: int) -> None:
    rng = np.random.default_rng(10 + shift)
    grid = random_grid(rng, 60, shift)
    edges = np.sort(np.stack([rng.permutation(60)[:2] for _ in range(150)]), axis=1)
    found = cross_edges(edges, grid)
    n = 0
    for e, (u, v) in enumerate(edges.tolist()):
        p, q = shifted(grid, u), shifted(grid, v)
        crossings = []
        for axis in range(3):
            low, high = sorted((p[axis], q[axis]))
            for value in range(below(low) + 1, below(high) + 1):
                t = (value - p[axis]) / (q[axis] - p[axis])
                at = [x + t * (y - x) for x, y in zip(p, q, strict=True)]
                number = found.first[e, axis] + value - below(low) - 1
                assert (found.edge[number], found.axis[number], found.value[number]) == (e, axis, value)
                assert found.fraction[number] == pytest.approx(float(t), abs=1e-12)
                others = [k for k in range(3) if k != axis]
                assert [int(found.floors[number, k]) for k in others] == [below(at[k]) for k in others]
                crossings.append((t, number))
                n += 1
        numbers = np.array([number for _, number in sorted(crossings)], int)
        order = np.lexsort((found.tie[numbers], found.fraction[numbers]))
        assert (order == np.arange(len(order))).all()
    assert n == len(found.edge) > 300


def test_levels_are_rounded_to_odd_grid_steps_and_noise_does_not_move_them() -> None:
    tets = np.array([[0, 1, 2, 3]])
    levels = np.array([[0, 0, 0], [3, 0, 0.25], [0, 3, -1], [1, 1, 1]], float)
    grid = round_levels(levels, tets)
    assert grid.shift == 18  # three cells in the tet: 2^20 steps hold four
    assert (grid.values % 2 == 1).all()
    np.testing.assert_allclose(grid.values / grid.cell, levels, atol=1.5 / grid.cell)
    noisy = round_levels(levels + 1e-9 * np.random.default_rng(0).normal(size=levels.shape), tets)
    assert (noisy.values == grid.values).all()
    assert (grid.floors == np.floor(levels + 1e-7)).all()


def test_largest_tet_does_not_overflow() -> None:
    """The widest image that is accepted: products of 2^20 grid steps in three directions."""
    wide = 255.9
    levels = np.array([[0, 0, 0], [wide, 0, 1], [0, wide, 2], [0.3, 0.4, wide]])
    grid = round_levels(levels, np.array([[0, 1, 2, 3]]))
    found = cross_faces(np.eye(4, 3), np.array([[1, 2, 3]]), grid)
    assert len(found.face) > 1000 * USUAL_CROSSINGS  # so that the room for them has doubled many times
    corners = [shifted(grid, v) for v in (1, 2, 3)]
    for n in range(0, len(found.face), 997):
        i, j = PAIRS[found.pair[n]]
        k = 2 - found.pair[n]
        x = [(c[i] - int(found.a[n]), c[j] - int(found.b[n])) for c in corners]
        w = [x[(e + 1) % 3][0] * x[(e + 2) % 3][1] - x[(e + 2) % 3][0] * x[(e + 1) % 3][1] for e in range(3)]
        assert found.floor[n] == below(sum(v * c[k] for v, c in zip(w, corners, strict=True)) / sum(w))


def test_more_crossings_than_memory_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lattice, "MAX_CROSSINGS", 64)
    levels = np.array([[0, 0, 0], [20.5, 0, 1], [0, 20.5, 2], [0.3, 0.4, 20]])
    with pytest.raises(InvalidInputError, match="cross the 1 faces of the mesh more than 64 times"):
        cross_faces(np.eye(4, 3), np.array([[1, 2, 3]]), round_levels(levels, np.array([[0, 1, 2, 3]])))


@pytest.mark.parametrize(
    ("levels", "message"),
    [
        ([[0, 0, 0], [np.nan, 0, 0], [0, 1, 0], [0, 0, 1]], "vertex 1"),
        ([[0, 0, 0], [1, 0, 0], [0, np.inf, 0], [0, 0, 1]], "vertex 2"),
        ([[0, 0, 0], [300, 0, 0], [0, 1, 0], [0, 0, 1]], "tet 0 spans 300"),
    ],
)
def test_wild_levels_are_refused(levels: list, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        round_levels(np.array(levels, float), np.array([[0, 1, 2, 3]]))
