"""Networks traced from the parametrizations of the authors' own runs, against their nodes; and all given problems."""

import json
from pathlib import Path

import numpy as np
import pytest
from networks import check_network
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from michell_cad.curves import NodeKind
from michell_cad.isocurves import trace_isocurves
from michell_cad.tet_mesh import TetMesh
from michell_cad.truss import clean_network, interior_degree_6, keep_curves

LAYOUTS = (
    "bar_tension_beta0.1_rho16",
    "cantilever_beam_beta0.1_rho16",
    "cantilever_beam_beta0.1_rho24",
    "cantilever_beam_beta1_rho24",
    "quadcopter_frame_beta0.1_rho24",
    "simple_bridge_beta0.1_rho32",
)

PROBLEMS = (
    "arched_bridge",
    "bar_tension",
    "bar_torsion",
    "cantilever_beam",
    "chair_rocking",
    "chair_sitting",
    "curved_bridge",
    "helicopter_top_pylon",
    "holey_pillar",
    "jet_engine_bracket",
    "mars_lander_lower_leg",
    "mars_lander_upper_leg",
    "quadcopter_frame",
    "simple_bridge",
)


@pytest.mark.parametrize("name", LAYOUTS)
def test_interior_nodes_are_those_of_the_reference(name: str, data_folder: Path) -> None:
    """Every one of 381 to 1731 interior nodes is found, none is missing and none is extra."""
    layout = np.load(data_folder / "reference" / f"{name}.npz")
    used = np.unique(layout["T"])
    mesh = TetMesh(layout["V"][used], np.searchsorted(used, layout["T"]))
    levels = layout["u"][used] * int(name.split("rho")[1]) + 1
    network = trace_isocurves(mesh, levels)
    check_network(network)
    labels = np.stack([layout[f"pre_{c}"] for c in "UVW"], axis=1)
    theirs = (labels >= 0).all(1) & ~layout["pre_B"]
    mine = network.node_kinds == NodeKind.INTERIOR
    # Compare level and position at once: an error of one level counts as much as the whole part.
    scale = mesh.size
    a = np.concatenate([network.node_levels[mine] * scale, network.nodes[mine]], axis=1)
    b = np.concatenate([labels[theirs] * scale, layout["pre_node"][theirs]], axis=1)
    tolerance = 1e-3 * scale / len(a) ** (1 / 3)  # a thousandth of a cell
    missing = cKDTree(a).query(b)[0] > tolerance
    extra = cKDTree(b).query(a)[0] > tolerance
    assert (int(missing.sum()), int(extra.sum()), len(a)) == (0, 0, len(b))


@pytest.mark.parametrize("name", PROBLEMS)
@pytest.mark.parametrize("folded", [False, True])
def test_every_problem_gives_a_sound_network_and_truss(name: str, folded: bool, data_folder: Path) -> None:
    """A rotated map, and the same with so much noise that a tenth to a third of the tets are inverted."""
    problems = {p["name"]: p for p in json.loads((data_folder / "problems" / "problems.json").read_text())}
    data = np.load(data_folder / "problems" / problems[name]["file"])
    mesh = TetMesh(data["vertices"] * 1000, data["tets"])
    x = mesh.vertices @ Rotation.from_rotvec([0.4, 0.7, -0.2]).as_matrix().T
    spacing = float(np.ptp(x, axis=0).max() / problems[name]["rho"]) * 2
    levels = x / spacing
    if folded:
        levels = levels + np.random.default_rng(1).normal(size=x.shape) * 0.3
    network = trace_isocurves(mesh, levels)
    check_network(network)
    assert interior_degree_6(network) == 1
    truss, report = clean_network(network, spacing)
    assert report.short_members == 0
    assert truss.degrees[truss.node_kinds == NodeKind.INTERIOR].min(initial=2) >= 2
    for stride in (2, 3):
        kept = keep_curves(
            truss, np.array([all(v is None or v % stride == 0 for v in c.isovalues) for c in truss.curves])
        )
        assert kept.degrees.min() >= 1


def test_every_problem_is_listed(data_folder: Path) -> None:
    names = {p["name"] for p in json.loads((data_folder / "problems" / "problems.json").read_text())}
    assert names == set(PROBLEMS)
