"""Solids of traced reference layouts, where these are at hand."""

import pytest

from michell_cad.cad.mesh import mesh_truss
from michell_cad.cad.prepare import prepare_truss
from michell_cad.cad.solid import build_solid
from michell_cad.knobs import Knobs, apply_knobs
from tests.cad.layouts import reference_truss, sized


@pytest.mark.parametrize("ratio", [0.1, 0.2])
def test_thinned_cantilever(ratio) -> None:
    """Every second curve: long members with waypoints, and boundary nodes of every kind."""
    truss = reference_truss("cantilever_beam_beta0.1_rho16")
    knobs = Knobs(every=2, radius=10 * ratio / 1.3, entasis=0.3)
    report = build_solid(apply_knobs(truss, knobs), knobs).report
    assert report.valid
    assert report.solids == 1
    assert report.genus == report.expected_genus
    assert report.mesh_volume_mm3 == pytest.approx(report.volume_mm3, rel=2e-3)
    assert report.crossings == 0


@pytest.mark.parametrize(
    ("name", "direct"),
    [
        ("cantilever_beam_beta0.1_rho16", 0.8),
    ],
)
def test_dense_layouts_can_be_laid_out(name, direct) -> None:
    truss = reference_truss(name)
    prepared = prepare_truss(sized(truss, 1.0, 0.3), Knobs())
    mesh = mesh_truss(prepared, 12)
    assert mesh.is_watertight
    members, nodes = len(prepared.sized.truss.members), len(prepared.sized.truss.nodes)
    assert 1 - mesh.euler_number / 2 == members - nodes + 1
    assert sum(prepared.fallback_nodes.values()) < (1 - direct) * nodes
    assert members > 0.99 * len(truss.members)
