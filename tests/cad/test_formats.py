"""STL, 3MF, beam lattices, GLB and BREP: read again by other programs; and files that cannot be written."""

import os
import re
import subprocess
import sys
import zipfile

import lib3mf
import numpy as np
import pytest
import trimesh

from michell_cad.cad import kernel
from michell_cad.cad.beam_lattice import export_beam_lattice, sample_beams
from michell_cad.cad.brep import export_brep
from michell_cad.cad.formats import FORMATS, SUFFIXES, ExportOptions, export_solid, file_name, format_of
from michell_cad.cad.glb import export_glb, linear_colour, vertex_normals
from michell_cad.cad.mesh_groups import closed_bodies, coloured_triangles, own_vertices
from michell_cad.cad.solid import TrussSolid, build_solid
from michell_cad.cad.stl import export_stl
from michell_cad.cad.threemf import export_3mf
from michell_cad.errors import InvalidInputError
from michell_cad.knobs import Knobs
from michell_cad.palette import COLOURS, GROUPS, group_colour
from tests.cad.layouts import grid_truss, sized, star

GROUPS_OF_GRID = ["tension", "compression", "third", "nodes"]


@pytest.fixture(scope="module")
def solid() -> TrussSolid:
    return build_solid(sized(grid_truss((3, 3, 2), warp=0.2, missing=0.1), 1.2, 0.3), Knobs())


@pytest.fixture(scope="module")
def folder(solid, tmp_path_factory):
    folder = tmp_path_factory.mktemp("files")
    for name in FORMATS:
        export_solid(solid, folder / file_name("truss", name))
    return folder


def volume_of(vertices: np.ndarray, triangles: np.ndarray) -> float:
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    return float((a * np.cross(b, c)).sum() / 6)


def read_3mf(path):
    model = lib3mf.get_wrapper().CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    reader.ReadFromFile(str(path))
    assert reader.GetWarningCount() == 0
    return model


def mesh_objects(model) -> list:
    iterator, found = model.GetMeshObjects(), []
    while iterator.MoveNext():
        found.append(iterator.GetCurrentMeshObject())
    return found


# --- groups of triangles ---------------------------------------------------------------------------------------------


def test_closed_bodies_have_the_volume_of_the_whole(solid) -> None:
    bodies = closed_bodies(solid)
    assert list(bodies) == GROUPS_OF_GRID
    for triangles in bodies.values():
        body = trimesh.Trimesh(solid.mesh.vertices, triangles, process=False)
        assert body.is_watertight
        assert body.is_winding_consistent
    total = sum(volume_of(solid.mesh.vertices, triangles) for triangles in bodies.values())
    assert total == pytest.approx(solid.mesh.volume, rel=1e-12)


def test_the_tubes_of_a_star_are_its_members() -> None:
    """Three straight tubes, one for each family: cylinders between their circles."""
    one = build_solid(star(np.eye(3)), Knobs())
    reach = one.prepared.sizes.reach.reshape(-1, 2).sum(1)
    bodies = closed_bodies(one)
    for k, name in enumerate(("tension", "compression", "third")):
        assert volume_of(one.mesh.vertices, bodies[name]) == pytest.approx(np.pi * (10 - reach[k]), rel=1e-9)


def test_colours_of_triangles_are_those_of_the_faces(solid) -> None:
    parts = coloured_triangles(solid)
    assert list(parts) == GROUPS_OF_GRID
    assert sum(map(len, parts.values())) == len(solid.mesh.triangles)
    nodes = parts["nodes"]
    X, R = solid.prepared.sized.truss.nodes, solid.prepared.sizes.radius
    away = np.linalg.norm(solid.mesh.vertices[nodes].mean(1)[:, None] - X, axis=2)
    assert ((away < 1.05 * R).any(1)).all()


def test_own_vertices_by_hand() -> None:
    used, local = own_vertices(np.zeros((6, 3)), np.array([[5, 1, 3], [3, 1, 2]]))
    assert used.tolist() == [1, 2, 3, 5]
    assert local.tolist() == [[3, 0, 2], [2, 0, 1]]


# --- formats ---------------------------------------------------------------------------------------------------------


def test_3mf_has_a_closed_named_coloured_object_for_each_family(solid, folder) -> None:
    model = read_3mf(folder / "truss.3mf")
    objects = mesh_objects(model)
    bodies = closed_bodies(solid)
    assert [one.GetName() for one in objects] == GROUPS_OF_GRID
    assert [one.GetTriangleCount() for one in objects] == [len(bodies[name]) for name in GROUPS_OF_GRID]
    assert all(one.IsManifoldAndOriented() for one in objects)
    for one in objects:
        resource, index, has = one.GetObjectLevelProperty()
        assert has
        colour = model.GetBaseMaterialGroupByID(resource).GetDisplayColor(index)
        expected = [round(255 * c) for c in group_colour(one.GetName())]
        assert [colour.Red, colour.Green, colour.Blue, colour.Alpha] == [*expected, 255]
    items = model.GetBuildItems()
    assert items.MoveNext()
    assert items.GetCurrent().GetObjectResource().GetName() == "truss"
    assert not items.MoveNext()


def test_3mf_read_by_trimesh_is_watertight_and_complete(solid, folder) -> None:
    parts = trimesh.load(folder / "truss.3mf").geometry.values()
    assert all(part.is_watertight for part in parts)
    assert sum(part.volume for part in parts) == pytest.approx(solid.mesh.volume, rel=1e-5)


def test_beams_have_radii_and_sets_for_families_and_curves(solid, folder) -> None:
    (one,) = mesh_objects(read_3mf(folder / "truss.beams.3mf"))
    read, lattice, truss = one.BeamLattice(), sample_beams(solid.prepared), solid.prepared.sized.truss
    assert read.GetBeamCount() == len(lattice.beams)
    beams = [read.GetBeam(k) for k in range(read.GetBeamCount())]
    assert [list(beam.Indices) for beam in beams] == lattice.beams.tolist()
    assert np.array([list(beam.Radii) for beam in beams]) == pytest.approx(lattice.radii, rel=1e-6)
    assert {mode for beam in beams for mode in beam.CapModes} == {int(lib3mf.Lib3MF.BeamLatticeCapMode.Sphere)}
    vertices = np.array([list(vertex.Coordinates) for vertex in one.GetVertices()])
    assert vertices == pytest.approx(lattice.vertices, abs=1e-5)
    sets = [read.GetBeamSet(k) for k in range(read.GetBeamSetCount())]
    found = {part.GetName(): sorted(part.GetReferences()) for part in sets}
    curve = truss.curve_of_member[lattice.member]
    for c, label in enumerate(truss.curves):
        assert found.pop(label.name) == np.flatnonzero(curve == c).tolist()
    for family, references in found.items():
        assert references == [k for k, c in enumerate(curve.tolist()) if truss.curves[c].family == family]
    assert set(found) == {label.family for label in truss.curves}


def test_beams_run_from_node_to_node_along_their_members(solid) -> None:
    lattice, truss = sample_beams(solid.prepared), solid.prepared.sized.truss
    a, b = lattice.vertices[lattice.beams].transpose(1, 0, 2)
    length = np.bincount(lattice.member, np.linalg.norm(b - a, axis=1))
    assert (length >= truss.lengths * (1 - 1e-9)).all()
    assert (length <= truss.lengths * 1.1).all()
    for m, (start, stop) in enumerate(truss.nodes[truss.members]):
        own = np.flatnonzero(lattice.member == m)
        assert np.allclose([a[own[0]], b[own[-1]]], [start, stop])
        assert (lattice.beams[own[1:], 0] == lattice.beams[own[:-1], 1]).all()
        assert lattice.radii[own].max() == pytest.approx(solid.prepared.sized.radii[m].max(), rel=1e-6)


def test_a_straight_constant_member_is_one_beam() -> None:
    one = build_solid(star(np.eye(3)), Knobs())
    lattice = sample_beams(one.prepared)
    assert len(lattice.beams) == 3
    assert (lattice.radii == 1.0).all()


def test_glb_is_in_metres_with_y_up_and_coloured(solid, folder) -> None:
    scene = trimesh.load(folder / "truss.glb")
    assert list(scene.geometry) == GROUPS_OF_GRID
    assert set(scene.graph.nodes_geometry) == set(GROUPS_OF_GRID)
    parts = list(scene.geometry.values())
    assert [len(part.faces) for part in parts] == [len(part) for part in coloured_triangles(solid).values()]
    for name, part in scene.geometry.items():
        expected = [round(255 * c) for c in linear_colour(group_colour(name))]
        assert np.abs(part.visual.material.baseColorFactor[:3].astype(int) - expected).max() <= 1
    low, high = solid.mesh.vertices.min(0) / 1e3, solid.mesh.vertices.max(0) / 1e3
    assert scene.bounds[0] == pytest.approx([low[0], low[2], -high[1]], rel=1e-6, abs=1e-9)
    assert scene.bounds[1] == pytest.approx([high[0], high[2], -low[1]], rel=1e-6, abs=1e-9)
    total = sum(volume_of(part.vertices, part.faces) for part in parts)
    assert total == pytest.approx(solid.mesh.volume / 1e9, rel=1e-5)


def test_glb_of_all_parts_is_closed(solid, folder) -> None:
    """Parts have the same points along their common edges, to the last bit."""
    parts = list(trimesh.load(folder / "truss.glb", process=False).geometry.values())
    corners = np.concatenate([part.triangles.reshape(-1, 3) for part in parts])
    _, number = np.unique(corners, axis=0, return_inverse=True)
    t = number.reshape(-1, 3)
    edges = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    assert (np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)[1] == 2).all()


def test_normals_point_out_of_the_tubes(solid) -> None:
    normals = vertex_normals(solid.mesh)
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1, rel=1e-9)
    a, b, c = solid.mesh.vertices[solid.mesh.triangles].transpose(1, 0, 2)
    faces = np.cross(b - a, c - a)
    faces /= np.linalg.norm(faces, axis=1, keepdims=True)
    assert np.einsum("td,tkd->tk", faces, normals[solid.mesh.triangles]).min() > 0


def test_white_and_black_are_what_they_are() -> None:
    assert linear_colour((0.0, 1.0, 0.5)) == pytest.approx([0.0, 1.0, 0.21404114], abs=1e-8)


def test_stl_round_trip(solid, folder) -> None:
    back = trimesh.load(folder / "truss.stl")
    assert back.is_watertight
    assert back.volume == pytest.approx(solid.mesh.volume, rel=1e-5)
    assert len(back.faces) == len(solid.mesh.triangles)


@pytest.mark.parametrize("binary", [False, True])
def test_brep_round_trip(solid, tmp_path, binary) -> None:
    import cadquery as cq

    export_brep(solid, tmp_path / "truss.brep", binary)
    content = (tmp_path / "truss.brep").read_bytes()
    assert (b"\0" in content) is binary
    read = cq.Shape.importBin if binary else cq.Shape.importBrep
    shape = read(str(tmp_path / "truss.brep"))
    assert shape.isValid()
    assert len(shape.Solids()) == 1
    assert kernel.volume(shape.wrapped) == pytest.approx(solid.report.volume_mm3, rel=1e-9)


@pytest.mark.parametrize("name", [name for name in FORMATS if name != "step"])
def test_the_same_truss_gives_the_same_bytes(solid, folder, tmp_path, name) -> None:
    file = file_name("truss", name)
    export_solid(solid, tmp_path / file)
    assert (tmp_path / file).read_bytes() == (folder / file).read_bytes()


def test_names_are_escaped(solid, folder) -> None:
    """The model is well-formed XML; its numbers are plain."""
    with zipfile.ZipFile(folder / "truss.3mf") as archive:
        assert archive.testzip() is None
        text = archive.read("3D/3dmodel.model").decode()
    assert not re.search(r'="(nan|inf|-inf)"', text)


# --- names of files, and bad input -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "expected"),
    [("a.STEP", "step"), ("a.stp", "step"), ("a.b.3mf", "3mf"), ("a.beams.3mf", "3mf-beams"), ("a.brp", "brep")],
)
def test_names_tell_formats(name, expected) -> None:
    assert format_of(name) == expected


def test_every_format_has_a_name_of_its_own(folder) -> None:
    assert set(SUFFIXES) == set(FORMATS)
    assert {format_of(file) for file in folder.iterdir()} == set(FORMATS)
    assert set(COLOURS) == {"node", *GROUPS} - {"nodes"}


def test_unknown_names_and_options_are_refused(solid, tmp_path) -> None:
    for name in ("truss.iges", "truss"):
        with pytest.raises(InvalidInputError, match=r"no format has the extension .*known are .*\.glb"):
            export_solid(solid, tmp_path / name)
    for export in (export_stl, export_3mf, export_beam_lattice, export_glb, export_brep):
        with pytest.raises(InvalidInputError, match=r"expected a file name that ends in \."):
            export(solid, tmp_path / "truss.txt")
    with pytest.raises(InvalidInputError, match="step_form must be one of solid, assembly"):
        ExportOptions(step_form="parts")
    with pytest.raises(InvalidInputError, match="AP214, AP242"):
        ExportOptions(step_schema="AP203")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", FORMATS)
def test_a_folder_that_is_not_there_or_not_writable_is_refused(solid, tmp_path, name) -> None:
    file = file_name("truss", name)
    places = [tmp_path / "no" / file, *([] if os.geteuid() else ["/proc/" + file])]
    for place in places:
        with pytest.raises(InvalidInputError, match=r"truss\S* cannot be written \(.*choose another folder"):
            export_solid(solid, place)


FULL_DISK = """
import resource, signal, sys
from pathlib import Path
import numpy as np
from michell_cad.cad import FORMATS, build_solid, export_solid, file_name
from michell_cad.errors import InvalidInputError
from michell_cad.knobs import Knobs
from tests.cad.layouts import star

solid, folder = build_solid(star(np.eye(3)), Knobs()), Path(sys.argv[1])
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (500, 500))
for name in FORMATS:
    (folder / file_name("truss", name)).write_text("old")
    try:
        export_solid(solid, folder / file_name("truss", name))
    except InvalidInputError as error:
        sys.stdout.write(f"{name}: {error}\\n")
"""


def test_a_disk_that_is_full_leaves_the_old_files(tmp_path) -> None:
    """No file may grow beyond 500 bytes: the system refuses to write on, as it does on a full disk."""
    # -B: what is imported after the limit would leave bytecode cut short, over which every later import stumbles.
    command = [sys.executable, "-B", "-c", FULL_DISK, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    lines = [line for line in done.stdout.splitlines() if "cannot be written (" in line]
    assert [line.split(":")[0] for line in lines] == list(FORMATS)
    assert {file.name for file in tmp_path.iterdir()} == {file_name("truss", name) for name in FORMATS}
    assert all(file.read_text() == "old" for file in tmp_path.iterdir())
