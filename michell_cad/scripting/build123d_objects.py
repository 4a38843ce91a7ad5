"""The truss as an object of build123d: in algebra and in builder mode, with joints where it is held and loaded.

    part = Box(80, 40, 40)
    truss = MichellTruss(part, supports="<X", loads=(">X", (0, 0, -500)), resolution=8, entasis=0.3)

It stands where its part stands. Moving or copying it computes nothing; `turned` gives the same truss with other knobs,
for which only the solid is built anew. Stages are kept between runs of a script, as for jobs.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from build123d import (
    Align,
    BasePartObject,
    Color,
    Compound,
    Face,
    Mode,
    Part,
    Plane,
    RigidJoint,
    RotationLike,
    ShapeList,
    Solid,
)

from michell_cad.arrays import require
from michell_cad.cad import SolidReport, SweptReport, kernel
from michell_cad.cad.brep import face_families
from michell_cad.errors import InvalidInputError
from michell_cad.knobs import Knobs
from michell_cad.palette import COLOURS
from michell_cad.pipeline import Design
from michell_cad.scripting.finished import Finished, design_shape, open_finished, shows_knobs
from michell_cad.truss import Truss

Alignment = Align | tuple[Align, Align, Align] | None


class FinishedTruss(BasePartObject):
    """A truss that is finished, with a `RigidJoint` at each place where it is held or loaded, z out of the part.

    The joints are named ``support 1``, ``load 1`` ...; one with several patches, such as four bolt holes, has
    ``support 1.1``, ``support 1.2`` ...

    Parameters
    ----------
    finished : the truss.
    rotation : degrees about x, y and z.
    align : of its bounding box; default: it stands where its part stands.
    mode : how a builder takes it.
    """

    def __init__(
        self,
        finished: Finished,
        rotation: RotationLike = (0, 0, 0),
        align: Alignment = None,
        mode: Mode = Mode.ADD,
    ) -> None:
        solid = kernel.as_build123d(finished.solid.solids)
        for anchor in finished.anchors:
            plane = Plane(tuple(anchor.point), z_dir=tuple(anchor.direction))
            RigidJoint(anchor.name, solid, plane.location)
        super().__init__(solid, rotation, align, mode)
        self.finished = finished

    @property
    def knobs(self) -> Knobs:
        """The knobs as asked for."""
        return self.finished.knobs

    @property
    def report(self) -> SolidReport | SweptReport:
        """Figures of the solid."""
        return self.finished.solid.report

    @property
    def families(self) -> Compound:
        """The faces in labelled and coloured groups: one for each family and one for the nodes, to show or export."""
        names, numbers = face_families(self.finished.solid)
        # The kernel counts the faces of a moved copy in the same order.
        faces = self.faces()
        groups = []
        for k, name in enumerate(names):
            mine = [face for face, number in zip(faces, numbers.tolist(), strict=True) if number == k]
            groups.append(Compound(mine, label=name, color=Color(*COLOURS[name])))
        return Compound(label=self.label, children=groups)

    def faces_of(self, family: str) -> ShapeList[Face]:
        """The faces of a family (or ``node``, ``kept``), where the truss stands.

        Raises
        ------
        InvalidInputError
            If it has none.
        """
        names, numbers = face_families(self.finished.solid)
        require(family in names, f"the truss has no faces of {family!r}; it has {', '.join(names)}")
        of_face = zip(self.faces(), numbers.tolist(), strict=True)
        return ShapeList(face for face, number in of_face if number == names.index(family))

    def turned(self, **knobs: Any) -> "FinishedTruss":
        """The same truss with some knobs changed, in the same place; nothing but its solid is built anew.

        Raises
        ------
        InvalidInputError, GeometryKernelError
            As `Finished.turned`.
        """
        other = FinishedTruss(self.finished.turned(knobs), mode=Mode.PRIVATE)
        other.label, other.material = self.label, self.material
        # The solid was built where its part stood, so that its location now is all that has moved it since.
        return other.locate(self.solids()[0].location)

    def save(self, path: str | Path) -> None:
        """Write the design file, for `michell-cad edit`; see `Finished.save`."""
        self.finished.save(path)


@shows_knobs
class MichellTruss(FinishedTruss):
    """The stress-aligned truss of a part.

    Parameters
    ----------
    part : one solid, mm; in a builder the default is the part that is being built, for ``mode=Mode.REPLACE``.
    supports : what holds it: one place or a list of them. A place is a CadQuery selector (``"<X"``; a tuple of them:
        one after the other), face numbers, or faces of the part; or a table as in a job file.
    loads : what acts on it: one or a list of pairs of a place and a force (N) in all, or tables as in a job file.
    material, resolution, spacing, mesh_size : as in a job file.
    job : further tables of a job file, such as ``{"options": {"layers": "hug"}, "sizing": {"by": "curve"}}``.
    rotation, align, mode : see `FinishedTruss`.
    knobs : those that differ from the defaults; ``help`` and `michell-cad knobs` list them.

    Raises
    ------
    InvalidInputError, ConvergenceError, GeometryKernelError
        As `deliver_job`.
    """

    def __init__(
        self,
        part: Part | Solid | Compound | None = None,
        supports: Any = None,
        loads: Any = None,
        *,
        material: str | None = None,
        resolution: float | None = None,
        spacing: float | None = None,
        mesh_size: float | None = None,
        job: Mapping[str, Any] | None = None,
        rotation: RotationLike = (0, 0, 0),
        align: Alignment = None,
        mode: Mode = Mode.ADD,
        **knobs: Any,
    ) -> None:
        finished = design_shape(
            self._being_built(mode) if part is None else part,
            supports,
            loads,
            knobs,
            material=material,
            resolution=resolution,
            spacing=spacing,
            mesh_size=mesh_size,
            job=job,
        )
        super().__init__(finished, rotation, align, mode)

    def _being_built(self, mode: Mode) -> Part:
        builder = self._get_builder_context()
        part = getattr(builder, "part", None)
        if part is None:
            raise InvalidInputError("MichellTruss: give a part, or use it in a BuildPart that has one already")
        require(
            mode != Mode.ADD,
            "MichellTruss: added to the part that it is made of, the truss would vanish in it: use mode=Mode.REPLACE",
        )
        return part


@shows_knobs
class SavedTruss(FinishedTruss):
    """The truss of a finished design; nothing but its solid is built.

    Parameters
    ----------
    source : a design file, a `Design`, or a `Truss` (which knows no places for joints).
    rotation, align, mode : see `FinishedTruss`.
    knobs : those to be changed.

    Raises
    ------
    InvalidInputError, GeometryKernelError
        As `load_design` and `Finished.turned`.
    """

    def __init__(
        self,
        source: str | Path | Design | Truss,
        *,
        rotation: RotationLike = (0, 0, 0),
        align: Alignment = None,
        mode: Mode = Mode.ADD,
        **knobs: Any,
    ) -> None:
        super().__init__(open_finished(source, knobs), rotation, align, mode)
