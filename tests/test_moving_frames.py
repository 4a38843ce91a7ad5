"""Rotation-minimising frames against the torsion of known curves."""

import numpy as np
import pytest

from michell_cad.moving_frames import transport_normals, turn_minimally
from michell_cad.rotations import rotation_matrix


def unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def helix(a: float, b: float, turns: float, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points, tangents and Frenet normals of a helix of radius a and pitch 2 pi b."""
    u = np.linspace(0, 2 * np.pi * turns, n)
    points = np.stack([a * np.cos(u), a * np.sin(u), b * u], axis=1)
    tangents = unit(np.stack([-a * np.sin(u), a * np.cos(u), np.full(n, b)], axis=1))
    return points, tangents, -np.stack([np.cos(u), np.sin(u), np.zeros(n)], axis=1)


def carry(points: np.ndarray, tangents: np.ndarray, first: np.ndarray) -> np.ndarray:
    return transport_normals(points, tangents, tangents, np.array([0, len(points)]), first[None])


def twist_error(n: int) -> float:
    """Between the frame and Frenet's, turned by the integral of the torsion b / (a^2 + b^2), after one turn."""
    a, b = 3.0, 2.0
    points, tangents, frenet = helix(a, b, 1.0, n)
    normals = carry(points, tangents, frenet[0])
    angle = 2 * np.pi * b / np.hypot(a, b)
    expected = np.cos(angle) * frenet[-1] - np.sin(angle) * np.cross(tangents[-1], frenet[-1])
    return float(np.arccos(np.clip(normals[-1] @ expected, -1, 1)))


def test_on_a_helix_the_frame_lags_behind_frenets_by_the_torsion() -> None:
    """And the error falls with the fourth power of the step."""
    coarse, fine = twist_error(17), twist_error(33)
    assert coarse < 2e-4
    assert fine < coarse / 12


def test_on_a_plane_curve_nothing_turns() -> None:
    u = np.linspace(0, 3, 20)
    points = np.stack([u, np.sin(2 * u), np.zeros(20)], axis=1)
    tangents = unit(np.stack([np.ones(20), 2 * np.cos(2 * u), np.zeros(20)], axis=1))
    up = np.array([0.0, 0.0, 1.0])
    assert carry(points, tangents, up) == pytest.approx(np.tile(up, (20, 1)), abs=1e-14)
    across = np.cross(up, tangents)
    assert carry(points, tangents, across[0]) == pytest.approx(across, abs=1e-12)


def test_many_curves_at_once_are_each_alone() -> None:
    one, two = helix(1.0, 1.0, 0.5, 9), helix(2.0, -1.0, 0.3, 5)
    both = [np.concatenate(pair) for pair in zip(one, two, strict=True)]
    normals = transport_normals(both[0], both[1], both[1], np.array([0, 9, 14]), np.stack([one[2][0], two[2][0]]))
    assert normals[:9] == pytest.approx(carry(one[0], one[1], one[2][0]))
    assert normals[9:] == pytest.approx(carry(two[0], two[1], two[2][0]))


def test_frames_turn_with_the_curve() -> None:
    R = rotation_matrix(np.array([0.3, -1.1, 0.7]))
    points, tangents, frenet = helix(2.0, 1.0, 0.8, 12)
    assert carry(points @ R.T, tangents @ R.T, R @ frenet[0]) == pytest.approx(carry(points, tangents, frenet[0]) @ R.T)


def test_at_a_kink_the_frame_turns_by_the_smallest_rotation() -> None:
    before, behind = np.array([[1.0, 0, 0]]), np.array([[0.0, 1, 0]])
    assert turn_minimally(before, behind, np.array([[0.0, 0, 1]])) == pytest.approx(np.array([[0, 0, 1]]))
    assert turn_minimally(before, behind, np.array([[0.0, 1, 0]])) == pytest.approx(np.array([[-1, 0, 0]]))
