"""Parts that come in: volumes and areas of known solids, faces that keep their identity, and what is refused."""

import os
from pathlib import Path

import meshio
import numpy as np
import pytest
import trimesh
from shapes import box_mesh

from michell_cad.domain import (
    default_mesh_size,
    forecast_tets,
    outline_from_tets,
    outline_from_triangles,
    part_from_cad,
    part_from_tets,
    read_outline,
    read_part,
)
from michell_cad.domain.cad_part import outline_from_shape
from michell_cad.domain.refine import refine_surface
from michell_cad.domain.surface_checks import crossing_triangles
from michell_cad.domain.tet_meshing import classify_triangles, mesh_outline, tet_quality, wall_thickness
from michell_cad.errors import InvalidInputError
from michell_cad.tet_mesh import TetMesh

EXAMPLES = Path(__file__).parents[1] / "examples"


def face_areas(part) -> np.ndarray:
    return np.bincount(part.surface.face_numbers, part.surface.areas, len(part.faces))


def holed_plate():
    import cadquery as cq

    return cq.Workplane().box(60, 40, 10).faces(">Z").workplane().rarray(30, 20, 2, 1).hole(12)


@pytest.fixture(scope="module")
def plate():
    return part_from_cad(holed_plate(), mesh_size=4.0)


@pytest.fixture(scope="module")
def cylinder():
    import cadquery as cq

    return part_from_cad(cq.Workplane().circle(10).extrude(30), mesh_size=4.0)


# --- CAD parts -------------------------------------------------------------------------------------------------------


def test_box_is_exact():
    import cadquery as cq

    part = part_from_cad(cq.Workplane().box(40, 20, 20), mesh_size=5.0)
    assert part.mesh.volumes.sum() == pytest.approx(16000, rel=1e-12)
    assert sorted(face_areas(part)) == pytest.approx([400, 400, 800, 800, 800, 800], rel=1e-12)
    for face in part.faces:
        triangles = part.surface.face_numbers == face.number
        assert part.surface.area_vectors[triangles].sum(0) / face.area == pytest.approx(face.direction, abs=1e-12)
    # All of the twelve edges and nothing else is sharp: their total length is 4 (40 + 20 + 20).
    a, b = part.mesh.vertices[part.mesh.feature_edges].transpose(1, 0, 2)
    assert np.linalg.norm(a - b, axis=1).sum() == pytest.approx(320, rel=1e-12)


def test_cylinder_keeps_its_three_faces(cylinder):
    areas = dict(zip([face.kind for face in cylinder.faces], face_areas(cylinder), strict=True))
    assert areas["CYLINDER"] == pytest.approx(2 * np.pi * 10 * 30, rel=0.02)
    assert areas["PLANE"] == pytest.approx(np.pi * 100, rel=0.02)
    assert cylinder.mesh.volumes.sum() == pytest.approx(np.pi * 100 * 30, rel=0.01)
    curved = next(face for face in cylinder.faces if face.kind == "CYLINDER")
    assert curved.radius == pytest.approx(10)
    assert np.abs(curved.direction) == pytest.approx([0, 0, 1])
    on_it = np.unique(cylinder.surface.triangles[cylinder.surface.face_numbers == curved.number])
    assert np.hypot(*cylinder.mesh.vertices[on_it, :2].T) == pytest.approx(10, rel=5e-3)


def test_a_trimmed_cylinder_is_one():
    import cadquery as cq

    holed = cq.Workplane().box(10, 10, 10).faces(">X").hole(4)  # CadQuery leaves a trimmed surface here
    (face,) = (f for f in outline_from_shape(holed).faces if f.kind == "CYLINDER")
    assert face.radius == pytest.approx(2)
    assert np.abs(face.direction) == pytest.approx([0, 0, 1])


def test_plate_with_holes(plate):
    assert plate.mesh.volumes.sum() == pytest.approx(60 * 40 * 10 - 2 * np.pi * 36 * 10, rel=0.01)
    assert face_areas(plate) == pytest.approx([face.area for face in plate.faces], rel=0.03)
    assert sum(face.kind == "CYLINDER" for face in plate.faces) == 2
    top = next(face for face in plate.faces if face.direction is not None and face.direction[2] > 0.5)
    on_top = np.unique(plate.surface.triangles[plate.surface.face_numbers == top.number])
    assert plate.mesh.vertices[on_top, 2] == pytest.approx(5, abs=1e-9)


def test_mesh_is_one_sound_solid(plate):
    assert plate.mesh.component_of_vertex.max() == 0
    assert (plate.mesh.volumes > 0).all()
    assert tet_quality(plate.mesh.vertices, plate.mesh.tets).min() > 0.05
    # A plate with two holes is a surface of genus 2: V - E + F = -2, each edge with two triangles.
    V, F, E = len(plate.mesh.boundary_vertices), len(plate.surface.triangles), len(plate.mesh.boundary_edges)
    assert V - E + F == -2
    assert 2 * E == 3 * F
    assert plate.mesh.median_edge == pytest.approx(4.0, rel=0.35)


def test_triangles_belong_to_the_face_that_points_their_way():
    """The mesh of a thin plate, lifted so far that its underside is nearer to the plate's upper side."""
    plate = trimesh.creation.box((10, 10, 0.2))
    surface = outline_from_triangles(plate.vertices, plate.faces).surface
    mesh = box_mesh((5, 5, 1), (10.0, 10.0, 0.2))
    lifted = TetMesh(mesh.vertices + [-5, -5, 0.05], mesh.tets)
    labels = classify_triangles(lifted, surface)
    up = lifted.boundary_area_vectors[:, 2]
    for sign in (-1, 1):
        face = surface.face_numbers[np.argmax(sign * surface.area_vectors[:, 2])]
        assert (labels[sign * up > 1] == face).all()


def test_mesher_leaves_nothing_behind(tmp_path, monkeypatch, capfd):
    import cadquery as cq

    monkeypatch.chdir(tmp_path)
    part_from_cad(cq.Workplane().box(20, 20, 20), mesh_size=8.0)
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_build123d_and_files_give_the_same_part(tmp_path):
    import build123d as bd

    solid = bd.Solid.make_box(30, 20, 10)
    bd.export_step(solid, str(tmp_path / "box.step"))
    bd.export_brep(solid, str(tmp_path / "box.brep"))
    from michell_cad.domain.cad_part import outline_from_shape

    outlines = [outline_from_shape(solid), read_outline(tmp_path / "box.step"), read_outline(tmp_path / "box.brep")]
    for outline in [*outlines, outline_from_shape(bd.Part(solid.wrapped))]:
        assert outline.volume == pytest.approx(6000)
        assert sorted(face.area for face in outline.faces) == pytest.approx([200, 200, 300, 300, 600, 600])
        assert outline.surface.volume == pytest.approx(6000)


def test_units_of_cad_files(tmp_path):
    import cadquery as cq

    box = cq.Workplane().box(2, 3, 4)
    cq.exporters.export(box, str(tmp_path / "mm.step"))
    cq.exporters.export(box, str(tmp_path / "inch.step"), unit="INCH")
    box.val().exportBrep(str(tmp_path / "box.brep"))
    assert read_outline(tmp_path / "mm.step").volume == pytest.approx(24)
    assert read_outline(tmp_path / "mm.step", "cm").volume == pytest.approx(24e3)
    inch = read_outline(tmp_path / "inch.step").volume
    assert read_outline(tmp_path / "inch.step", "mm").volume == pytest.approx(inch)
    assert read_outline(tmp_path / "inch.step", "in").volume == pytest.approx(inch)
    assert read_outline(tmp_path / "box.brep", "in").volume == pytest.approx(24 * 25.4**3)


def test_bracket_of_the_examples():
    outline = read_outline(EXAMPLES / "bracket.step")
    assert outline.volume == pytest.approx(95167, rel=1e-4)
    assert len(outline.faces) == 18
    assert sum(face.kind == "CYLINDER" and face.radius == pytest.approx(4.5) for face in outline.faces) == 4


# --- surfaces --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", ["stl", "obj", "3mf"])
def test_surface_files(tmp_path, suffix):
    trimesh.creation.box((10, 20, 30)).export(tmp_path / f"box.{suffix}")
    outline = read_outline(tmp_path / f"box.{suffix}")
    assert outline.volume == pytest.approx(6000)
    assert sorted(face.area for face in outline.faces) == pytest.approx([200, 200, 300, 300, 600, 600])
    assert all(face.kind == "PLANE" for face in outline.faces)


def test_surface_units_and_mesh(tmp_path):
    trimesh.creation.box((1, 2, 2)).export(tmp_path / "box.stl")
    part = read_part(tmp_path / "box.stl", units="cm", mesh_size=5.0)
    assert part.mesh.volumes.sum() == pytest.approx(4000, rel=1e-9)
    assert face_areas(part) == pytest.approx([face.area for face in part.faces], rel=1e-9)


def test_cavity_counts_as_empty():
    shell = trimesh.util.concatenate([trimesh.creation.box((10, 10, 10)), trimesh.creation.box((4, 4, 4))])
    assert outline_from_triangles(shell.vertices, shell.faces).volume == pytest.approx(1000 - 64)


def test_orientation_of_the_file_does_not_matter():
    box = trimesh.creation.box((10, 10, 10))
    mixed = box.faces.copy()
    mixed[::2] = mixed[::2, ::-1]
    for faces in (box.faces[:, ::-1], mixed):
        assert outline_from_triangles(box.vertices, faces).volume == pytest.approx(1000)


def test_crossing_triangles_are_found_pair_by_pair():
    """Against every pair, one by one, for random triangles."""
    rng = np.random.default_rng(7)
    corners = 0.6 * rng.random((60, 1, 3)) + 0.5 * rng.random((60, 3, 3))
    V, F = corners.reshape(-1, 3), np.arange(180).reshape(-1, 3)

    def pierces(p, q, a, b, c):
        volume = lambda i, j, k, m: np.linalg.det([j - i, k - i, m - i])  # noqa: E731
        if volume(a, b, c, p) * volume(a, b, c, q) >= 0:
            return False
        signs = [volume(p, q, a, b) > 0, volume(p, q, b, c) > 0, volume(p, q, c, a) > 0]
        return all(signs) or not any(signs)

    expected = set()
    for i in range(60):
        for j in range(i + 1, 60):
            A, B = V[F[i]], V[F[j]]
            if any(pierces(X[k], X[(k + 1) % 3], *Y) for X, Y in ((A, B), (B, A)) for k in range(3)):
                expected.add((i, j))
    assert len(expected) > 20
    assert {tuple(pair) for pair in crossing_triangles(V, F).tolist()} == expected


def test_wall_thickness_of_a_plate():
    plate = trimesh.creation.box((100, 80, 3))
    assert wall_thickness(outline_from_triangles(plate.vertices, plate.faces).surface) == pytest.approx(3)


def test_default_mesh_size_lies_between_its_bounds():
    for extents in ((100, 100, 100), (100, 5, 5), (100, 80, 1)):
        box = trimesh.creation.box(extents)
        outline = outline_from_triangles(box.vertices, box.faces)
        assert 17_900 <= forecast_tets(outline.volume, default_mesh_size(outline)) <= 60_100


def test_refined_surface_is_the_same_surface():
    box = trimesh.creation.box((10, 20, 30))
    surface = outline_from_triangles(box.vertices, box.faces).surface
    fine = refine_surface(surface, 2.0)
    corners = fine.vertices[fine.triangles]
    assert np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max() <= 2.0
    assert fine.volume == pytest.approx(6000)
    by_face = np.bincount(fine.face_numbers, fine.areas)
    assert by_face == pytest.approx(np.bincount(surface.face_numbers, surface.areas))
    edges = np.sort(fine.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()


# --- tet files -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("suffix", "kind"), [("mesh", None), ("msh", "gmsh22"), ("msh", "ansys"), ("vtu", None)])
def test_tet_files(tmp_path, suffix, kind):
    mesh = box_mesh((3, 2, 2), (3.0, 2.0, 2.0))
    points = np.concatenate([mesh.vertices, [[9.0, 9.0, 9.0]]])  # no tet uses the last one
    cells = [("tetra", mesh.tets), ("triangle", mesh.boundary_triangles)]
    meshio.Mesh(points, cells).write(tmp_path / f"box.{suffix}", kind)
    part = read_part(tmp_path / f"box.{suffix}", units="cm")
    assert part.mesh.volumes.sum() == pytest.approx(12e3)
    assert len(part.mesh.vertices) == len(mesh.vertices)
    assert sorted(face_areas(part)) == pytest.approx([400, 400, 600, 600, 600, 600])


def test_npz_problem_is_in_metres(tmp_path):
    mesh = box_mesh((2, 2, 2), (0.02, 0.01, 0.01))
    fixed, force = mesh.vertices[:, 0] == 0, np.zeros((len(mesh.vertices), 3))
    force[-1] = [0, 0, -5]
    np.savez(tmp_path / "p.npz", vertices=mesh.vertices, tets=mesh.tets.astype(np.int32), fixed=fixed, force=force)
    part = read_part(tmp_path / "p.npz")
    assert part.mesh.volumes.sum() == pytest.approx(2000)
    assert part.fixed.sum() == 9
    assert part.force.sum(0) == pytest.approx([0, 0, -5])
    assert part.unit_mm == 1000
    assert read_part(tmp_path / "p.npz", units="mm").mesh.volumes.sum() == pytest.approx(2e-6)


def test_quadcopter_of_the_shared_data(data_folder):
    part = read_part(data_folder / "problems" / "quadcopter_frame.npz")
    assert len(part.mesh.tets) == 32826
    assert np.ptp(part.mesh.vertices, axis=0) == pytest.approx([150.001, 78.81, 150.001])
    assert part.force.sum(0) == pytest.approx([0, -100, 0])


def test_a_given_mesh_keeps_its_tets():
    mesh = box_mesh((2, 2, 2))
    part = part_from_tets(mesh)
    assert (part.mesh.tets == mesh.tets).all()
    assert len(part.faces) == 6
    assert mesh_outline(outline_from_tets(mesh), mesh_size=123.0).mesh.tets.shape == mesh.tets.shape


# --- what is refused -------------------------------------------------------------------------------------------------


def refused(path: Path, *words: str, **options) -> None:
    with pytest.raises(InvalidInputError) as caught:
        read_part(path, **options)
    message = str(caught.value)
    assert path.name in message or "mesh" in message
    for word in words:
        assert word in message, message


def test_missing_unknown_and_unreadable_files(tmp_path):
    refused(tmp_path / "none.step", "does not exist")
    (tmp_path / "folder.stl").mkdir()
    refused(tmp_path / "folder.stl", "folder")
    (tmp_path / "part.docx").write_text("x")
    refused(tmp_path / "part.docx", "unknown kind", ".step")
    (tmp_path / "secret.stl").write_text("solid")
    (tmp_path / "secret.stl").chmod(0)
    if not os.access(tmp_path / "secret.stl", os.R_OK):
        refused(tmp_path / "secret.stl", "cannot be read")


@pytest.mark.parametrize("suffix", ["step", "stp", "brep", "stl", "obj", "3mf", "mesh", "msh", "vtu", "npz"])
@pytest.mark.parametrize("content", [b"", b"This is a letter to my aunt.\n" * 20, bytes(range(256)) * 8])
def test_files_that_are_not_what_their_name_says(tmp_path, suffix, content):
    path = tmp_path / f"part.{suffix}"
    path.write_bytes(content)
    refused(path)


def test_files_cut_short(tmp_path):
    import cadquery as cq

    cq.exporters.export(cq.Workplane().box(1, 1, 1), str(tmp_path / "box.step"))
    trimesh.creation.icosphere(2).export(tmp_path / "ball.stl")
    box = box_mesh((2, 2, 2))
    np.savez(tmp_path / "p.npz", vertices=box.vertices, tets=box.tets)
    for name in ("box.step", "ball.stl", "p.npz"):
        data = (tmp_path / name).read_bytes()
        (tmp_path / name).write_bytes(data[: len(data) // 2])
        refused(tmp_path / name)


def test_several_solids_and_none(tmp_path):
    import cadquery as cq

    two = cq.Workplane().box(1, 1, 1).add(cq.Workplane().box(1, 1, 1).translate((5, 0, 0)))
    cq.exporters.export(cq.Workplane(cq.Compound.makeCompound(two.vals())), str(tmp_path / "two.step"))
    refused(tmp_path / "two.step", "one solid", "found 2")
    cq.exporters.export(cq.Workplane(cq.Face.makePlane(2, 2)), str(tmp_path / "sheet.step"))
    refused(tmp_path / "sheet.step", "no solid")
    with pytest.raises(InvalidInputError, match="CadQuery Workplane"):
        part_from_cad("a string")


def test_open_crossing_and_separate_surfaces(tmp_path):
    box = trimesh.creation.box((10, 10, 10))
    trimesh.Trimesh(box.vertices, box.faces[:-1], process=False).export(tmp_path / "open.stl")
    refused(tmp_path / "open.stl", "not closed", "3 edges")
    shifted = trimesh.creation.box((10, 10, 10), transform=trimesh.transformations.translation_matrix((5, 3, 2)))
    trimesh.util.concatenate([box, shifted]).export(tmp_path / "crossing.stl")
    refused(tmp_path / "crossing.stl", "crosses itself")
    far = trimesh.creation.box((1, 1, 1), transform=trimesh.transformations.translation_matrix((50, 0, 0)))
    trimesh.util.concatenate([box, far]).export(tmp_path / "apart.stl")
    refused(tmp_path / "apart.stl", "2 separate")


def test_not_a_number(tmp_path):
    mesh = box_mesh((2, 2, 2))
    vertices = mesh.vertices.copy()
    vertices[3, 1] = np.nan
    np.savez(tmp_path / "p.npz", vertices=vertices, tets=mesh.tets)
    refused(tmp_path / "p.npz", "finite")
    force = np.zeros((27, 3))
    force[0] = np.inf
    np.savez(tmp_path / "q.npz", vertices=mesh.vertices, tets=mesh.tets, force=force)
    refused(tmp_path / "q.npz", "forces", "finite")
    box = trimesh.creation.box((1, 1, 1))
    box.vertices[0, 0] = np.nan
    box.export(tmp_path / "box.stl")
    refused(tmp_path / "box.stl", "finite")


def test_bad_arrays_of_a_problem(tmp_path):
    mesh = box_mesh((1, 1, 1))
    good = {"vertices": mesh.vertices, "tets": mesh.tets}
    for name, bad, word in [
        ("a", {"vertices": mesh.vertices}, "tets"),
        ("b", {**good, "fixed": np.zeros(3, bool)}, "fixed"),
        ("c", {**good, "force": np.zeros((3, 3))}, "force"),
        ("d", {**good, "tets": mesh.tets + 1}, "indices"),
        ("e", {**good, "tets": np.repeat(mesh.tets[:1, :1], 4, axis=1)}, "volume"),
        ("f", {**good, "tets": np.concatenate([mesh.tets, mesh.tets, mesh.tets])}, "two tets"),
    ]:
        np.savez(tmp_path / f"{name}.npz", **bad)
        refused(tmp_path / f"{name}.npz", word)


def test_tet_file_without_tets(tmp_path):
    box = trimesh.creation.box((1, 1, 1))
    meshio.Mesh(box.vertices, [("triangle", box.faces)]).write(tmp_path / "skin.vtu")
    refused(tmp_path / "skin.vtu", "no tets", "triangle")


@pytest.mark.parametrize(("size", "word"), [(0.0, "above 0"), (-1.0, "above 0"), (500.0, "at most"), (0.01, "tets")])
def test_mesh_sizes_that_cannot_be(tmp_path, size, word):
    trimesh.creation.box((10, 10, 10)).export(tmp_path / "box.stl")
    refused(tmp_path / "box.stl", "[mesh] size", word, mesh_size=size)


def test_unknown_unit(tmp_path):
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "box.stl")
    with pytest.raises(InvalidInputError, match="units"):
        read_part(tmp_path / "box.stl", units="furlong")
