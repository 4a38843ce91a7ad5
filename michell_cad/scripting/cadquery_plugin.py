"""The truss in CadQuery: a function for `Workplane.invoke`, and a method of `Workplane` once `register` is called.

    from michell_cad.scripting.cadquery_plugin import michell_truss, register

    held = {"supports": "<X", "loads": (">X", (0, 0, -500)), "resolution": 8}
    truss = cq.Workplane().box(80, 40, 40).invoke(michell_truss(**held, entasis=0.3))

    register()
    truss = cq.Workplane().box(80, 40, 40).michellTruss(**held, entasis=0.3)

The solids of the truss are on the stack of the result, the faces of each family are tagged with its name
(``truss.faces(tag="tension")``), and its chain goes on from the part (``truss.end()``). Stages are kept between runs,
so that a script that only turns knobs does not compute the design again.
"""

from collections.abc import Callable, Mapping
from copy import copy
from pathlib import Path
from typing import Any

import cadquery as cq

from michell_cad.cad.brep import face_families
from michell_cad.errors import InvalidInputError
from michell_cad.pipeline import Design
from michell_cad.scripting.finished import Finished, design_shape, open_finished, shows_knobs
from michell_cad.truss import Truss

METHOD = "michellTruss"
"""Name of the method, in the spelling of CadQuery."""


@shows_knobs
def michell_truss(
    supports: Any = None,
    loads: Any = None,
    *,
    material: str | None = None,
    resolution: float | None = None,
    spacing: float | None = None,
    mesh_size: float | None = None,
    job: Mapping[str, Any] | None = None,
    **knobs: Any,
) -> Callable[[cq.Workplane], cq.Workplane]:
    """The step from a Workplane with one solid to one with its truss, for `Workplane.invoke`.

    Parameters
    ----------
    supports : what holds the solid: one place or a list of them. A place is a selector (``"<X"``; a tuple of them: one
        after the other), face numbers, faces, or a Workplane with faces; or a table as in a job file.
    loads : what acts on it: one or a list of pairs of a place and a force (N) in all, or tables as in a job file.
    material, resolution, spacing, mesh_size : as in a job file.
    job : further tables of a job file.
    knobs : those that differ from the defaults; ``help`` and `michell-cad knobs` list them.

    Raises
    ------
    InvalidInputError, ConvergenceError, GeometryKernelError
        When it is invoked: as `deliver_job`, and if the Workplane has no solid.
    """

    options = {
        "material": material,
        "resolution": resolution,
        "spacing": spacing,
        "mesh_size": mesh_size,
        "job": job,
    }
    # A lambda, since `invoke` counts the parameters in the code of what it gets, which decorators hide.
    return lambda workplane: _replace_solid(workplane, supports, loads, knobs, options)


@shows_knobs
def saved_truss(source: str | Path | Design | Truss, **knobs: Any) -> cq.Workplane:
    """A Workplane with the truss of a design file, a `Design` or a `Truss`; nothing but its solid is built.

    Parameters
    ----------
    source : the design.
    knobs : those to be changed.

    Raises
    ------
    InvalidInputError, GeometryKernelError
        As `load_design` and `build_solid`.
    """
    return _on_stack(cq.Workplane(), open_finished(source, knobs))


def register() -> None:
    """Give `Workplane` the method `michellTruss`, with the parameters of `michell_truss`; as CadQuery's plug-ins do."""

    @shows_knobs
    def method(self: cq.Workplane, supports: Any = None, loads: Any = None, **options: Any) -> cq.Workplane:
        return self.invoke(michell_truss(supports, loads, **options))

    method.__name__, method.__doc__ = METHOD, michell_truss.__doc__
    setattr(cq.Workplane, METHOD, method)


def _replace_solid(
    workplane: cq.Workplane, supports: Any, loads: Any, knobs: Mapping[str, Any], options: Mapping[str, Any]
) -> cq.Workplane:
    """The truss of the solid of a chain."""
    try:
        solid = workplane.findSolid()
    except ValueError as error:
        raise InvalidInputError("michell_truss: make a solid first; the Workplane has none") from error
    return _on_stack(workplane, design_shape(solid, supports, loads, knobs, **options))


def _on_stack(workplane: cq.Workplane, finished: Finished) -> cq.Workplane:
    """The solids as the next step of a chain, and the faces of each family under its tag."""
    solids = [cq.Solid(solid) for solid in finished.solid.solids]
    result = workplane.newObject(solids)
    # Tags belong to a whole chain: of its own, as another truss of the same part has the same tags.
    result.ctx = copy(result.ctx)
    result.ctx.tags = dict(result.ctx.tags)
    names, numbers = face_families(finished.solid)
    faces = [face for solid in solids for face in solid.Faces()]
    for k, name in enumerate(names):
        result.newObject([face for face, n in zip(faces, numbers.tolist(), strict=True) if n == k]).tag(name)
    return result
