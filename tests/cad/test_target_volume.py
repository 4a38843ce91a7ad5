import numpy as np
import pytest
from layouts import grid_truss, sized, star

from michell_cad.cad import mesh_truss, prepare_truss, resolve_radius
from michell_cad.cad.target_volume import member_volume, solve_radius
from michell_cad.errors import InvalidInputError
from michell_cad.knobs import Knobs, apply_knobs

GRID = grid_truss()
PART = 30.0 * 20.0 * 20.0


def volume(knobs: Knobs) -> float:
    return mesh_truss(prepare_truss(apply_knobs(GRID, knobs), knobs)).volume


def resolved(knobs: Knobs, density: float = 1e-3) -> Knobs:
    return resolve_radius(knobs, lambda k: apply_knobs(GRID, k), GRID.spacing, PART, density)


def test_members_alone_by_hand():
    assert member_volume(star([(1, 0, 0), (0, 1, 0)], length=10.0, radius=0.5)) == pytest.approx(2 * np.pi * 2.5)
    thick = sized(GRID, 1.0, 0.5)
    assert member_volume(thick) == pytest.approx(np.pi * GRID.lengths.sum() * (2 + 4 * 1.5**2) / 6)


@pytest.mark.parametrize("knobs", [Knobs(volume_fraction=0.06), Knobs(volume_fraction=0.15, entasis=0.3)])
def test_a_volume_fraction_is_met_by_the_direct_mesh(knobs):
    found = resolved(knobs)
    assert found.volume_fraction is None
    assert found.entasis == knobs.entasis
    assert volume(found) == pytest.approx(knobs.volume_fraction * PART, rel=2e-3)


def test_a_mass_is_met_by_the_direct_mesh():
    assert volume(resolved(Knobs(mass=1.0))) * 1e-3 == pytest.approx(1.0, rel=2e-3)


def test_a_stated_radius_stays():
    assert resolved(Knobs(radius=0.4)) == Knobs(radius=0.4)


def test_what_cannot_be_met_says_what_can():
    with pytest.raises(InvalidInputError, match=r"mass = 1000 cannot be met: members of .* give about"):
        resolved(Knobs(mass=1000.0))
    with pytest.raises(InvalidInputError, match="no density"):
        resolved(Knobs(mass=1.0), density=0.0)
    with pytest.raises(InvalidInputError, match="need the solid"):
        apply_knobs(GRID, Knobs(mass=1.0))


def test_the_secant_ends_within_the_tolerance_on_a_power_law_and_gives_up_on_a_jump():
    tries: list[float] = []

    def power(r: float) -> float:
        tries.append(r)
        return 7 * r**1.7

    radius = solve_radius(power, 7 * 0.3**1.7, 0.5)
    assert radius == pytest.approx(0.3, rel=2e-3)
    assert len(tries) <= 4
    assert solve_radius(lambda r: r**2 if r < 1 else 1.5 * r**2, 1.25, 0.5) is None
