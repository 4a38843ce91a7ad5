"""Where a truss is held and loaded, as places to join other bodies: a point and the direction out of the part.

A support or load that covers several patches of the surface, such as four bolt holes, has a place at each. A patch that
looks one way points along its mean normal; one that looks all around, as a hole does, along its axis, out of the part.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from michell_cad.arrays import freeze
from michell_cad.domain import Outline, Surface
from michell_cad.job import Setup
from michell_cad.problem import DesignProblem
from michell_cad.selection import select_triangles

ONE_WAY = 0.3
"""A patch looks one way if its mean normal is longer than this: a half pipe has 2/pi, a hole 0."""

CENTRED = 1e-6
"""A hole closer than this to the middle of the part, along its axis, is in it (relative to the part's diagonal)."""


@dataclass(frozen=True, eq=False)
class Anchor:
    """A place where the part is held or loaded.

    Parameters
    ----------
    name : ``support 1``, ``load 2``, or ``support 1.3`` for the third patch of a support.
    point : (3,) float, mm, centroid of the patch.
    direction : (3,) float, unit vector out of the part.
    """

    name: str
    point: Float[np.ndarray, " 3"]
    direction: Float[np.ndarray, " 3"]

    def __post_init__(self) -> None:
        freeze(self, point=np.float64, direction=np.float64)


def anchors_of_setup(outline: Outline, setup: Setup) -> tuple[Anchor, ...]:
    """The anchors of a job's supports and loads on its part; exact up to the tessellation of its faces.

    Raises
    ------
    InvalidInputError
        If a region matches nothing.
    """
    named = [(f"support {n}", region) for n, region in enumerate(setup.support, 1)]
    named += [(f"load {n}", region) for n, region in enumerate(setup.load, 1) if region.self_weight is None]
    return _anchors(outline.surface, [(name, select_triangles(outline, region)) for name, region in named])


def anchors_of_problem(problem: DesignProblem) -> tuple[Anchor, ...]:
    """The anchors of a design whose regions are not known any more: patches of held vertices, and of each load case.

    Loads on every vertex (weight) are on no place.
    """
    mesh = problem.mesh
    surface = Surface(mesh.vertices, mesh.boundary_triangles, np.zeros(len(mesh.boundary_triangles), np.int64))
    masks = [("support 1", np.asarray(problem.fixed.any(1)))]
    masks += [(f"load {n}", np.any(case.force != 0, axis=1)) for n, case in enumerate(problem.load_cases, 1)]
    whole = [(name, np.flatnonzero(mask[surface.triangles].all(1))) for name, mask in masks if not mask.all()]
    return _anchors(surface, whole)


def _anchors(surface: Surface, named: Sequence[tuple[str, np.ndarray]]) -> tuple[Anchor, ...]:
    found = []
    for name, triangles in named:
        patches = list(_patches(surface.triangles[triangles]))
        for number, patch in enumerate(patches, 1):
            title = name if len(patches) == 1 else f"{name}.{number}"
            found.append(Anchor(title, *_place(surface, triangles[patch])))
    return tuple(found)


def _patches(triangles: Int[np.ndarray, "k 3"]) -> Iterator[Int[np.ndarray, " n"]]:
    """Rows of the triangles that hang together, by the order of their first triangle."""
    if not len(triangles):
        return
    corners, used = triangles.ravel(), np.repeat(np.arange(len(triangles)), 3)
    joined = coo_matrix((np.ones(len(used)), (used, corners)), shape=(len(triangles), int(corners.max()) + 1)).tocsr()
    count, label = connected_components(joined @ joined.T, directed=False)
    yield from (np.flatnonzero(label == number) for number in range(count))


def _place(surface: Surface, patch: Int[np.ndarray, " n"]) -> tuple[np.ndarray, np.ndarray]:
    """Centroid and outward direction of a patch."""
    areas, vectors = surface.areas[patch], surface.area_vectors[patch]
    point = areas @ surface.centroids[patch] / areas.sum()
    mean = vectors.sum(0) / areas.sum()
    if np.linalg.norm(mean) > ONE_WAY:
        return point, mean / np.linalg.norm(mean)
    # The normals of a hole have no part along its axis: the eigenvector of the smallest eigenvalue of sum(n n' dA).
    axis = np.linalg.eigh(vectors.T @ (vectors / areas[:, None]))[1][:, 0]
    middle = surface.areas @ surface.centroids / surface.areas.sum()
    outward = axis @ (point - middle)
    if abs(outward) <= CENTRED * surface.diagonal:  # in the middle of the part neither way is outward: the positive one
        outward = axis[np.argmax(np.abs(axis))]
    return point, axis * np.sign(outward)
