"""Meshes and problems that the tests share."""

import numpy as np

from michell_cad.problem import DesignProblem, LoadCase, Material, surface_force
from michell_cad.tet_mesh import TetMesh

ABS = Material("ABS", youngs_modulus=2200.0, poisson_ratio=0.35, density=1.04e-3, yield_strength=48.0)


def box_mesh(cells: tuple[int, int, int], size: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> TetMesh:
    """A box of `cells` cubes, each cut into the six tets of Kuhn along its diagonal."""
    axes = [np.linspace(0, length, n + 1) for n, length in zip(cells, size, strict=True)]
    vertices = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(len(vertices)).reshape([n + 1 for n in cells])
    corner = np.stack([a.ravel() for a in np.meshgrid(*[np.arange(n) for n in cells], indexing="ij")], axis=1)
    tets = []
    for order in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)):
        walk = [corner]
        for axis in order:
            walk.append(walk[-1] + np.eye(3, dtype=int)[axis])
        tets.append(np.stack([number[tuple(step.T)] for step in walk], axis=1))
    return TetMesh(vertices, np.concatenate(tets))


def tube_mesh(cells: tuple[int, int, int], inner: float, outer: float, length: float) -> TetMesh:
    """A tube along z: a box of cells along the radius, around and along the axis, bent until its ends meet."""
    box = box_mesh(cells)
    radius, angle = inner + (outer - inner) * box.vertices[:, 0], 2 * np.pi * box.vertices[:, 1]
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), length * box.vertices[:, 2]], axis=1)
    _, first, inverse = np.unique(np.round(points, 9), axis=0, return_index=True, return_inverse=True)
    return TetMesh(points[first], inverse.ravel()[box.tets])


def joined_boxes(
    shift: tuple[float, float, float],
    cells: tuple[int, int, int] = (4, 2, 2),
    size: tuple[float, float, float] = (8.0, 4.0, 2.0),
) -> TetMesh:
    """A box and the same box moved by `shift`; vertices in the same place are one."""
    box = box_mesh(cells, size)
    points = np.concatenate([box.vertices, box.vertices + np.array(shift)])
    _, first, inverse = np.unique(np.round(points, 9), axis=0, return_index=True, return_inverse=True)
    return TetMesh(points[first], inverse.ravel()[np.concatenate([box.tets, box.tets + len(box.vertices)])])


def cantilever(cells: tuple[int, int, int] = (12, 6, 6), load: float = -100.0) -> DesignProblem:
    """A 80 x 40 x 40 mm bar, clamped at x = 0, pulled in z at x = 80 by a total of `load` newtons."""
    mesh = box_mesh(cells, (80.0, 40.0, 40.0))
    fixed = np.repeat((mesh.vertices[:, 0] == 0)[:, None], 3, axis=1)
    end = np.flatnonzero((mesh.vertices[mesh.boundary_triangles][:, :, 0] == 80).all(1))
    force = surface_force(mesh, end, np.array([0.0, 0.0, load]))
    return DesignProblem(mesh, ABS, fixed, (LoadCase("end", force),))


def tension_bar(load: float = 50.0) -> DesignProblem:
    """A 80 x 20 x 10 mm bar pulled in x, whose end slides on the wall: it may get thinner."""
    mesh = box_mesh((8, 2, 2), (80.0, 20.0, 10.0))
    at_wall = mesh.vertices[:, 0] == 0
    fixed = np.stack([at_wall, mesh.vertices[:, 1] == 0, mesh.vertices[:, 2] == 0], axis=1)
    end = np.flatnonzero((mesh.vertices[mesh.boundary_triangles][:, :, 0] == 80).all(1))
    return DesignProblem(mesh, ABS, fixed, (LoadCase("end", surface_force(mesh, end, np.array([load, 0.0, 0.0]))),))


def turned(problem: DesignProblem, Q: np.ndarray, scale: float = 1.0) -> DesignProblem:
    """The same problem, rotated and scaled, with forces scaled so that the stresses stay the same.

    Only for problems whose held vertices are held in all three axes.
    """
    mesh = TetMesh(scale * problem.mesh.vertices @ Q.T, problem.mesh.tets)
    cases = tuple(LoadCase(c.name, scale**2 * c.force @ Q.T, c.weight) for c in problem.load_cases)
    return DesignProblem(mesh, problem.material, problem.fixed, cases, problem.combination)


def renumbered(problem: DesignProblem, rng: np.random.Generator) -> tuple[DesignProblem, np.ndarray, np.ndarray]:
    """The same problem with vertices and tets in another order; also the new order of vertices and tets."""
    mesh = problem.mesh
    order, tet_order = rng.permutation(len(mesh.vertices)), rng.permutation(len(mesh.tets))
    position = np.argsort(order)
    new = TetMesh(mesh.vertices[order], position[mesh.tets][tet_order])
    cases = tuple(LoadCase(c.name, c.force[order], c.weight) for c in problem.load_cases)
    return DesignProblem(new, problem.material, problem.fixed[order], cases, problem.combination), order, tet_order


def refined(problem: DesignProblem, times: int = 1) -> DesignProblem:
    """The same problem with every tet cut in eight at the middles of its edges, `times` times over.

    The middle of a surface edge is held where both ends are. A vertex keeps a quarter of its force and gives the rest
    in equal parts to the middles of the surface edges towards other vertices of the load (it keeps what it cannot
    give): on a regular surface those are the nodal forces of the same traction; the net force is the same always.
    """
    for _ in range(times):
        problem = _halved(problem)
    return problem


_CORNER_TETS = ((0, 4, 5, 6), (4, 1, 7, 8), (5, 7, 2, 9), (6, 8, 9, 3))
"""Of a tet with corners 0-3 and middles 4-9 of its edges 01, 02, 03, 12, 13, 23; between them an octahedron is left."""
_OCTAHEDRON_CUTS = (((4, 9), (5, 6, 8, 7)), ((5, 8), (4, 6, 9, 7)), ((6, 7), (4, 5, 9, 8)))
"""Its three diagonals, each with the ring of the four other middles around it."""


def _halved(problem: DesignProblem) -> DesignProblem:
    mesh = problem.mesh
    n_v, (i, j) = len(mesh.vertices), mesh.edges.T
    vertices = np.concatenate([mesh.vertices, (mesh.vertices[i] + mesh.vertices[j]) / 2])
    local = np.concatenate([mesh.tets, n_v + mesh.tet_edges], axis=1)
    tets = [local[:, corners] for corners in _CORNER_TETS]
    ends = np.array([pair for pair, _ in _OCTAHEDRON_CUTS])
    diagonals = vertices[local[:, ends[:, 0]]] - vertices[local[:, ends[:, 1]]]
    shortest = np.linalg.norm(diagonals, axis=2).argmin(1)  # the best shapes, also after many rounds
    for number, ((a, b), ring) in enumerate(_OCTAHEDRON_CUTS):
        mine = local[shortest == number]
        tets += [mine[:, (a, b, ring[k], ring[(k + 1) % 4])] for k in range(4)]

    key = mesh.edges @ [n_v, 1]
    outer = np.isin(key, mesh.boundary_edges @ [n_v, 1])[:, None]
    fixed = np.concatenate([problem.fixed, problem.fixed[i] & problem.fixed[j] & outer])
    cases = tuple(LoadCase(c.name, _handed_on(c.force, mesh.edges, outer[:, 0]), c.weight) for c in problem.load_cases)
    return DesignProblem(TetMesh(vertices, np.concatenate(tets)), problem.material, fixed, cases, problem.combination)


def _handed_on(force: np.ndarray, edges: np.ndarray, outer: np.ndarray) -> np.ndarray:
    loaded = (force != 0).any(1)
    i, j = edges.T
    takes = outer & loaded[i] & loaded[j]
    degree = np.bincount(edges[takes].ravel(), minlength=len(force))[:, None]
    middles = np.where(
        takes[:, None], 0.75 * (force[i] / np.maximum(degree[i], 1) + force[j] / np.maximum(degree[j], 1)), 0
    )
    return np.concatenate([np.where(degree > 0, 0.25, 1.0) * force, middles])
