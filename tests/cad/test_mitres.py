"""Mitres: the pieces fit together, lie on both tubes, and enclose what an independent boolean encloses."""

import manifold3d
import numpy as np
import pytest

from michell_cad.cad.mesh import mesh_truss
from michell_cad.cad.mitre_cuts import SPHERE
from michell_cad.cad.mitres import corner_angles, cut_mitre
from michell_cad.cad.prepare import prepare_truss
from michell_cad.knobs import Knobs
from tests.cad.layouts import star


def unit(x) -> np.ndarray:
    x = np.asarray(x, float)
    return x / np.linalg.norm(x, axis=-1, keepdims=True)


def normals_of(d: np.ndarray) -> np.ndarray:
    return unit(np.cross(d, [0.3, -0.5, 0.81]))


def test_two_members_meet_in_one_ellipse() -> None:
    half = np.radians(15.0)
    d = np.array([[np.cos(half), np.sin(half), 0], [np.cos(half), -np.sin(half), 0]])
    mitre = cut_mitre(d, normals_of(d), 1.8, 1.0)
    assert mitre is not None
    for k in (0, 1):
        neighbours = {piece.neighbour for piece in mitre.pieces[k]}
        assert neighbours == {SPHERE, 1 - k}
        assert sum(piece.stop - piece.start for piece in mitre.pieces[k]) == pytest.approx(2 * np.pi)
    on_plane = [piece.first for path in mitre.pieces for piece in path if piece.neighbour != SPHERE]
    assert np.abs(mitre.corners[on_plane, 1]).max() < 1e-12


@pytest.mark.parametrize("seed", range(10))
def test_pieces_fit_together(seed) -> None:
    rng = np.random.default_rng(seed)
    d = unit(rng.normal(size=(5, 3)) + [0, 0, 2.0])
    mitre = cut_mitre(d, normals_of(d), 1.7, 1.0)
    if mitre is None:
        return
    between = []
    for e, path in enumerate(mitre.pieces):
        assert path[0].start == 0
        assert path[-1].stop == pytest.approx(2 * np.pi)
        for piece, following in zip(path, [*path[1:], path[0]], strict=True):
            assert piece.last == following.first
            # Every corner is on the tube, and on the sphere where the piece is.
            arm = mitre.corners[piece.first] - (mitre.corners[piece.first] @ d[e]) * d[e]
            assert np.linalg.norm(arm) == pytest.approx(1.0)
            if piece.neighbour == SPHERE:
                assert np.linalg.norm(mitre.corners[piece.first]) == pytest.approx(1.7)
            else:
                between.append((e, piece.neighbour, piece.first, piece.last))
    assert {(j, e, b, a) for e, j, a, b in between} == set(between)


def test_special_position_is_refused() -> None:
    """Four members evenly on a cone: four bisecting planes meet in one line."""
    t = np.arange(4) * np.pi / 2
    d = unit(np.stack([0.3 * np.cos(t), 0.3 * np.sin(t), np.ones(4)], axis=1))
    assert cut_mitre(d, normals_of(d), 1.8, 1.0) is None


def test_corner_angles_are_those_of_the_pieces() -> None:
    d = unit([[1, 0.2, 0], [1, -0.2, 0.1], [1, 0, -0.3]])
    normals = normals_of(d)
    mitre = cut_mitre(d, normals, 1.8, 1.0)
    assert mitre is not None
    for e, found in enumerate(corner_angles(d, normals, 1.8, 1.0)):
        starts = np.array([piece.start for piece in mitre.pieces[e]])
        assert all(np.abs(starts - u).min() < 1e-12 for u in found)


@pytest.mark.parametrize(
    "directions",
    [
        [[1, 0.25, 0], [1, -0.25, 0]],
        [[1, 0.25, 0], [1, -0.25, 0], [1, 0, 0.4]],
        [[1, 0.3, 0], [1, -0.3, 0], [1, 0, 0.5], [-1, 0.1, 0.1]],
    ],
)
def test_volume_against_a_boolean(directions) -> None:
    """The same balls and cylinders united by manifold3d, all as polyhedra of the true volume."""
    d = unit(directions)
    prepared = prepare_truss(star(d, length=12.0), Knobs(fillet_ratio=0.0))
    assert prepared.mitres
    n = 256
    area = np.sqrt(2 * np.pi / n / np.sin(2 * np.pi / n))
    union = manifold3d.Manifold.sphere(1.0, n)
    grow = (4 / 3 * np.pi / union.volume()) ** (1 / 3)
    parts = [
        manifold3d.Manifold.sphere(R * grow, n).translate(x)
        for x, R in zip(prepared.sized.truss.nodes.tolist(), prepared.sizes.radius.tolist(), strict=True)
    ]
    for direction in d:
        x = normals_of(direction[None])[0]
        frame = np.stack([x, np.cross(direction, x), direction, np.zeros(3)], axis=1)
        parts.append(manifold3d.Manifold.cylinder(12.0, area, area, n).transform(frame))
    expected = manifold3d.Manifold.batch_boolean(parts, manifold3d.OpType.Add).volume()
    assert mesh_truss(prepared, 96).volume == pytest.approx(expected, rel=3e-4)
