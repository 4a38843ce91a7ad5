"""A truss with its solid, and what it takes to turn its knobs: the value that objects of a CAD program share.

It is made from a part (everything is computed, or found again among the stages kept before) or from what is finished
already: a design file, a `Design`, a `Truss`. Copies of an object refer to the same value; nothing is computed again.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, TypeVar

from michell_cad.building import build_united, size_finished
from michell_cad.cad import BuiltSolid, build_solid
from michell_cad.delivery import design_outline
from michell_cad.design_file import DEFAULT_UP, Saved, load_saved, save_design
from michell_cad.domain.cad_part import outline_from_shape
from michell_cad.edits import NO_EDITS, change_knobs
from michell_cad.errors import InvalidInputError
from michell_cad.knobs import Knobs, apply_knobs
from michell_cad.pipeline import Design
from michell_cad.scripting.anchors import Anchor, anchors_of_problem, anchors_of_setup
from michell_cad.scripting.picks import make_setup
from michell_cad.truss import Truss


@dataclass(frozen=True, eq=False)
class Finished:
    """A truss as it was built.

    Parameters
    ----------
    source : what the knobs work on.
    knobs : as asked for.
    anchors : where it is held and loaded.
    solid : BuiltSolid
    """

    source: Saved | Truss
    knobs: Knobs
    anchors: tuple[Anchor, ...]
    solid: BuiltSolid

    def turned(self, changes: Mapping[str, Any]) -> "Finished":
        """The same with some knobs changed: only its solid is built anew.

        Raises
        ------
        InvalidInputError, GeometryKernelError
            For an unknown knob or a value out of its bounds, and as `build_solid`.
        """
        return _build(self.source, change_knobs(self.knobs, changes), self.anchors)

    def save(self, path: str | Path) -> None:
        """Write the design file, for `michell-cad edit`.

        Raises
        ------
        InvalidInputError
            If the truss was given without its design, or the file cannot be written.
        """
        saved = self.source
        if not isinstance(saved, Saved):
            raise InvalidInputError(f"{path}: a truss that was given without its design cannot be saved as one")
        save_design(path, saved.design, self.knobs, saved.edits, saved.up, saved.kept, saved.sizing)

    def __deepcopy__(self, memo: dict[int, Any]) -> "Finished":
        """Itself: nothing in it changes, and the kernel's shapes are large."""
        return self


def design_shape(shape: Any, supports: Any, loads: Any, knobs: Mapping[str, Any], **options: Any) -> Finished:
    """Design and build the truss of a solid of build123d or CadQuery.

    Parameters
    ----------
    shape : one solid, in mm.
    supports, loads, options : see `make_setup`.
    knobs : those that differ from the defaults.

    Raises
    ------
    InvalidInputError, ConvergenceError, GeometryKernelError
        As `deliver_job`.
    """
    outline = outline_from_shape(shape)
    setup = make_setup(outline, supports, loads, **options)
    setup = setup.model_copy(update={"knobs": change_knobs(setup.knobs, knobs)})
    anchors = anchors_of_setup(outline, setup)
    made = design_outline(outline, setup)
    return _build(Saved(made.design, made.knobs, NO_EDITS, made.kept, made.sizing, outline.up), setup.knobs, anchors)


def open_finished(source: str | Path | Design | Truss, knobs: Mapping[str, Any]) -> Finished:
    """Build the truss of a design file, a `Design` or a `Truss`, with some knobs changed.

    Raises
    ------
    InvalidInputError, GeometryKernelError
        As `load_design`, and as `Finished.turned`.
    """
    if isinstance(source, Truss):
        return _build(source, change_knobs(Knobs(), knobs), ())
    saved = Saved(source, Knobs(), NO_EDITS, (), None, DEFAULT_UP) if isinstance(source, Design) else load_saved(source)
    return _build(saved, change_knobs(saved.knobs, knobs), anchors_of_problem(saved.design.problem))


Target = TypeVar("Target", bound=Callable[..., Any])


def shows_knobs(target: Target) -> Target:
    """Let a function or class that takes ``**knobs`` show each of them as the schema has it.

    Its signature names them with type, unit, bounds, default and description, as help and editors show it.
    """
    function: Any = target
    signature = inspect.signature(function.__init__ if inspect.isclass(function) else function)
    own = [p for p in signature.parameters.values() if p.kind is not p.VAR_KEYWORD and p.name != "self"]
    shown = [
        inspect.Parameter(
            name, inspect.Parameter.KEYWORD_ONLY, default=field.default, annotation=Annotated[field.annotation, field]
        )
        for name, field in Knobs.model_fields.items()
    ]
    target.__signature__ = signature.replace(parameters=[*own, *shown])
    return target


def _build(source: Saved | Truss, knobs: Knobs, anchors: tuple[Anchor, ...]) -> Finished:
    if isinstance(source, Truss):
        solid = build_solid(apply_knobs(source, knobs), knobs)
    else:
        structure = source.replay(knobs)
        solid = build_united(structure, size_finished(structure), lambda stage, fraction: None)
    return Finished(source, knobs, anchors, solid)
