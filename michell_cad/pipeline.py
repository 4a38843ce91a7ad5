"""The method, stage by stage: Arora et al. 2019, Sections 4.1 to 4.4, and nothing else."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import get_args

import numpy as np
from threadpoolctl import threadpool_limits

from michell_cad.arrays import require
from michell_cad.elasticity import ElasticityOptions, StressField, solve_elasticity
from michell_cad.frame_field import FrameField, FrameFieldOptions, fit_frame_field
from michell_cad.isocurves import CurveNetwork, trace_isocurves
from michell_cad.metrics import Alignment, measure_alignment, name_families
from michell_cad.parametrization import Layers, Parametrization, ParametrizationOptions, parametrize
from michell_cad.problem import DesignProblem
from michell_cad.stage_cache import StageCache
from michell_cad.tet_mesh import TetMesh
from michell_cad.truss import CleaningReport, Truss, TrussOptions, clean_network
from michell_cad.truss.inside import keep_inside
from michell_cad.warm_up import load_compiled_loops

STAGES = ("elasticity", "frames", "parametrization", "isocurves", "truss")
"""Names of the stages, in order, as the progress callback and the report show them."""

DEFAULT_RESOLUTION = 24.0
"""Cells along the longest coordinate when neither resolution nor spacing is given (the paper's usual rho)."""

MOST_CELLS_PER_EDGE = 3.0
"""Finer cells than this many per tet edge show the mesh, not the stress: the isocurves are straight within a tet."""
GOOD_CELLS_PER_EDGE = 1.0


@dataclass(frozen=True)
class DesignOptions:
    """Options of all stages.

    Parameters
    ----------
    resolution : the paper's rho, cells along the coordinate with the longest range.
    spacing : or the median edge of a cell, mm. If neither is given the resolution is `DEFAULT_RESOLUTION`.
    layers : "clear" keeps the layers of cells clear of faces that they would graze; "hug" lays them just inside such
        faces, for which the spacing of each coordinate may change by up to 5 per cent.
    """

    resolution: float | None = None
    spacing: float | None = None
    layers: Layers = "clear"
    elasticity: ElasticityOptions = field(default_factory=ElasticityOptions)
    frames: FrameFieldOptions = field(default_factory=FrameFieldOptions)
    parametrization: ParametrizationOptions = field(default_factory=ParametrizationOptions)
    truss: TrussOptions = field(default_factory=TrussOptions)

    def __post_init__(self) -> None:
        require(
            self.resolution is None or self.spacing is None,
            "options: give either resolution (cells along the longest coordinate) or spacing (mm), not both",
        )
        for name in ("resolution", "spacing"):
            value = getattr(self, name)
            require(
                value is None or (np.isfinite(value) and value > 0), f"options.{name} must be positive, found {value}"
            )
        require(
            self.layers in get_args(Layers), f"options.layers must be one of {get_args(Layers)}, found {self.layers!r}"
        )
        if self.spacing is None and self.resolution is None:
            object.__setattr__(self, "resolution", DEFAULT_RESOLUTION)


@dataclass(frozen=True)
class StageTime:
    """Time that a stage took: by the clock, and of all processors in this process."""

    name: str
    wall_s: float
    cpu_s: float


@dataclass(frozen=True, eq=False)
class Design:
    """Every value of the method, from the problem to the truss, by name."""

    problem: DesignProblem
    options: DesignOptions
    stress_field: StressField
    frame_field: FrameField
    parametrization: Parametrization
    truss: Truss
    network: CurveNetwork
    cleaning: CleaningReport
    alignment: Alignment
    times: tuple[StageTime, ...]


@threadpool_limits.wrap(limits=1, user_api="blas")  # vectors this short only wait for a second thread
def design(
    problem: DesignProblem,
    options: DesignOptions | None = None,
    progress: Callable[[str, float], None] = lambda stage, fraction: None,
    cache: StageCache | None = None,
) -> Design:
    """Design the stress-aligned truss of a part.

    Parameters
    ----------
    problem : DesignProblem
    options : DesignOptions
    progress : called with the name of a stage and the finished fraction of it.
    cache : where results of stages are kept and found again; default: nowhere.

    Raises
    ------
    InvalidInputError
        If the cells are too fine for the mesh.
    ConvergenceError
        If a stage fails to converge.
    """
    options = options or DesignOptions()
    mesh, cache = problem.mesh, cache or StageCache()
    require_fine_enough(mesh, _expected_cell(mesh, options))
    load_compiled_loops()
    times: list[StageTime] = []

    with _stage("elasticity", times, progress) as advance:
        stress_field = cache.keep(
            "elasticity",
            StressField,
            (problem, options.elasticity),
            lambda: solve_elasticity(problem, options.elasticity, advance),
        )
    with _stage("frames", times, progress) as advance:
        frame_field = cache.keep(
            "frames",
            FrameField,
            (mesh, stress_field.stress, options.frames),
            lambda: fit_frame_field(mesh, stress_field, options.frames, advance),
        )
    with _stage("parametrization", times, progress) as advance:
        parametrization = cache.keep(
            "parametrization",
            Parametrization,
            (mesh, stress_field.stress, frame_field.frames, options.parametrization),
            lambda: parametrize(mesh, stress_field, frame_field, options.parametrization, advance),
        )
        levels, spacing = parametrization.levels(options.resolution, options.spacing, options.layers)
        require_fine_enough(mesh, spacing)
        families = name_families(mesh, stress_field.stress, parametrization.tangents)
    with _stage("isocurves", times, progress):
        network = cache.keep(
            "isocurves", CurveNetwork, (mesh, levels, families), lambda: trace_isocurves(mesh, levels, families)
        )
    with _stage("truss", times, progress):
        cleaned = cache.keep(
            "truss",
            CleanedTruss,
            (mesh, levels, families, spacing, options.truss, problem.anchored),
            lambda: _clean(network, spacing, options.truss, problem),
        )

    alignment = measure_alignment(stress_field.stress, frame_field, parametrization, network)
    return Design(
        problem,
        options,
        stress_field,
        frame_field,
        parametrization,
        cleaned.truss,
        network,
        cleaned.report,
        alignment,
        tuple(times),
    )


@dataclass(frozen=True, eq=False)
class CleanedTruss:
    """A truss, and what cleaning did to it."""

    truss: Truss
    report: CleaningReport


def _clean(network: CurveNetwork, spacing: float, options: TrussOptions, problem: DesignProblem) -> CleanedTruss:
    mesh = problem.mesh
    truss, report = clean_network(network, spacing, options, mesh.vertices[problem.anchored])
    return CleanedTruss(keep_inside(truss, mesh), report)


def cells_per_edge(mesh: TetMesh, cell: float) -> float:
    """How many cells (edge in mm) fit on the median edge of the tets."""
    return mesh.median_edge / cell


def require_fine_enough(mesh: TetMesh, cell: float) -> None:
    """Refuse cells of which more than `MOST_CELLS_PER_EDGE` fit on a tet edge."""
    ratio = cells_per_edge(mesh, cell)
    require(
        ratio <= MOST_CELLS_PER_EDGE,
        f"the truss cells (about {cell:.3g} mm) are too fine for the mesh: {ratio:.1f} of them on a tet edge of "
        f"{mesh.median_edge:.3g} mm, at most {MOST_CELLS_PER_EDGE:g} make sense. Set mesh.size = {cell:.3g} or finer, "
        f"or lower options.resolution by a factor of {ratio / MOST_CELLS_PER_EDGE:.1f} (or raise options.spacing)",
    )


def _expected_cell(mesh: TetMesh, options: DesignOptions) -> float:
    """A lower estimate of the cell edge, before anything is computed: a coordinate is at most as long as the part."""
    if options.spacing is not None:
        return options.spacing
    assert options.resolution is not None  # set by DesignOptions
    return float(np.linalg.norm(np.ptp(mesh.vertices, axis=0))) / options.resolution


@contextmanager
def _stage(
    name: str, times: list[StageTime], progress: Callable[[str, float], None]
) -> Iterator[Callable[[float], None]]:
    wall, cpu = time.perf_counter(), time.process_time()
    progress(name, 0.0)
    yield lambda fraction: progress(name, fraction)
    progress(name, 1.0)
    times.append(StageTime(name, time.perf_counter() - wall, time.process_time() - cpu))
