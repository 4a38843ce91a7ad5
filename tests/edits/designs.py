"""Designs that the tests of edits share: a small cantilever, another one behind it, and a design turned as a whole."""

from dataclasses import replace
from functools import cache

import numpy as np
from shapes import cantilever

from michell_cad.parametrization import Parametrization
from michell_cad.pipeline import Design, DesignOptions, design
from michell_cad.problem import DesignProblem, LoadCase
from michell_cad.tet_mesh import TetMesh


@cache
def small_bar() -> Design:
    """A bar of 80 x 40 x 40 mm, held at x = 0, with cells of about 14 mm."""
    return design(cantilever((8, 4, 4)), DesignOptions(6))


@cache
def coarse_bar() -> Design:
    """The same bar with cells of about 30 mm: its solid is built in a third of a second."""
    return design(cantilever((4, 2, 2)), DesignOptions(3))


@cache
def bar_behind() -> Design:
    """The same bar from x = 80 to 160 mm with somewhat smaller cells."""
    problem = cantilever((8, 4, 4))
    mesh = TetMesh(problem.mesh.vertices + np.array([80.0, 0, 0]), problem.mesh.tets)
    moved = DesignProblem(mesh, problem.material, problem.fixed, problem.load_cases)
    return design(moved, DesignOptions(6.5))


def turned_design(made: Design, Q: np.ndarray) -> Design:
    """A design rotated as a whole: every position x becomes Q x, with nothing computed again."""
    problem, truss = made.problem, made.truss
    mesh = TetMesh(problem.mesh.vertices @ Q.T, problem.mesh.tets)
    cases = tuple(LoadCase(c.name, c.force @ Q.T, c.weight) for c in problem.load_cases)
    stress = Q @ made.stress_field.stress @ Q.T
    return replace(
        made,
        problem=DesignProblem(mesh, problem.material, problem.fixed, cases, problem.combination),
        stress_field=replace(made.stress_field, stress=stress),
        frame_field=replace(made.frame_field, frames=Q @ made.frame_field.frames),
        parametrization=Parametrization(mesh, made.parametrization.phi),
        truss=replace(truss, nodes=truss.nodes @ Q.T, waypoints=np.asarray(truss.waypoints) @ Q.T),
    )
