"""A turned design with the turned edits, of every kind, gives the turned result."""

from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from designs import bar_behind, small_bar, turned_design
from scipy.spatial.transform import Rotation

from michell_cad.closed_mesh import ClosedMesh
from michell_cad.design_file import save_design
from michell_cad.edits import (
    AddCurve,
    AddSheet,
    AddStrut,
    Attach,
    EditList,
    Entasis,
    Family,
    Join,
    Label,
    Near,
    Radius,
    Remove,
    RemoveOpenEnds,
    Snap,
    Structure,
    Tag,
    Thin,
    attachment_frames,
    build_sheets,
    size_structure,
    tagged_members,
)
from michell_cad.edits.edit_list import KINDS
from michell_cad.knobs import Knobs

BAR = small_bar()
SNAPPED = [(41.3, 17.2, 22.9), (20.0, 8.0, 31.0)]


def edits(Q: np.ndarray, other: Path) -> EditList:
    """One edit of each kind at least, turned by Q; `other` is the design that is joined."""

    def turned(*point: float) -> tuple[float, float, float]:
        x, y, z = (Q @ np.array(point)).tolist()
        return x, y, z

    return EditList(
        (
            Snap(points=tuple(turned(*point) for point in SNAPPED)),
            Join(design=str(other), reach=20.0),
            Remove(where=Near(turned(55.0, 11.0, 25.0), 12.0) & Family(("tension", "third"))),
            Thin(where=Family("third", surface=False), every=2),
            RemoveOpenEnds(where=Label(0, 1, 9)),
            AddStrut(between=(turned(20.0, 8.0, 31.0), turned(41.3, 17.2, 22.9)), reach=5.0),
            AddCurve(through=(turned(41.3, 17.2, 22.9), turned(43.0, 19.0, 60.0)), loose=True),
            Radius(over="stress", values=(0.7, 1.3)),
            Radius(where=Near(turned(31.0, 24.0, 13.0), 20.0), over="depth", values=(0.7, 1.3)),
            Radius(where=Family("feature"), over="length", values=(0.8, 1.0, 1.2)),
            Entasis(where=Family("compression"), to=0.3),
            Tag(name="oak", where=Family("tension") & ~Near(turned(0.0, 0.0, 0.0), 30.0)),
            AddSheet(coordinate="compression", low=2, high=3, thickness=0.6),
            Attach(part="lamp.step", where=Family("tension"), spacing=9.0, up=turned(0.2, 0.3, 1.0)),
        )
    )


def replayed(Q: np.ndarray, folder: Path) -> Structure:
    save_design(folder / "behind.npz", turned_design(bar_behind(), Q), Knobs())
    return edits(Q, folder / "behind.npz").replay(turned_design(BAR, Q), Knobs())


@pytest.fixture(scope="module")
def unturned(tmp_path_factory) -> Structure:
    return replayed(np.eye(3), tmp_path_factory.mktemp("unturned"))


def test_every_kind_of_edit_is_turned():
    assert {type(edit) for edit in edits(np.eye(3), Path("x")).edits} == set(get_args(KINDS))


@pytest.mark.parametrize("seed", [0, 1])
def test_a_turned_design_with_turned_edits_gives_the_turned_result(seed, unturned, tmp_path):
    Q = Rotation.random(random_state=seed).as_matrix()
    turned = replayed(Q, tmp_path)
    np.testing.assert_allclose(turned.truss.nodes, unturned.truss.nodes @ Q.T, atol=1e-6)
    np.testing.assert_array_equal(turned.truss.members, unturned.truss.members)
    assert [c.name for c in turned.truss.curves] == [c.name for c in unturned.truss.curves]
    np.testing.assert_allclose(size_structure(turned).radii, size_structure(unturned).radii, rtol=1e-6)
    for name, mask in tagged_members(unturned).items():
        np.testing.assert_array_equal(tagged_members(turned)[name], mask)
    (attach,), (as_it_was,) = turned.of_kind(Attach), unturned.of_kind(Attach)
    found, expected = attachment_frames(turned, attach), attachment_frames(unturned, as_it_was)
    assert len(expected.origins) > 20
    np.testing.assert_allclose(found.origins, expected.origins @ Q.T, atol=1e-6)
    np.testing.assert_allclose(found.axes, Q @ expected.axes, atol=1e-6)
    plates, plates_as_they_were = build_sheets(turned), build_sheets(unturned)
    for plate, was in zip(plates, plates_as_they_were, strict=True):
        # Plates are simplified, by other triangles where the part's faces are not along the axes.
        assert plate.volume == pytest.approx(was.volume, rel=1e-3)
        np.testing.assert_allclose(centroid(plate), Q @ centroid(was), atol=0.03)


def centroid(plate: ClosedMesh) -> np.ndarray:
    """Centre of mass of a closed mesh: of the tets between its triangles and the origin."""
    a, b, c = plate.vertices[plate.triangles].transpose(1, 0, 2)
    six = np.einsum("td,td->t", a, np.cross(b, c))
    return six @ (a + b + c) / 4 / six.sum()
