"""What round and swept trusses have in common once built: solids of the kernel, their mesh and their report."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from michell_cad.arrays import freeze
from michell_cad.cad.assembly import AssemblyPart
from michell_cad.cad.mesh import TrussMesh
from michell_cad.cad.shell_plan import FaceRole
from michell_cad.cad.solid_report import SolidReport, SweptReport
from michell_cad.truss import SizedTruss, Truss


@dataclass(frozen=True, eq=False)
class BuiltSolid(ABC):
    """A built truss.

    Parameters
    ----------
    mesh : watertight triangle mesh of the whole.
    report : SolidReport or SweptReport
    face_role, face_owner : (n_f,) int, what each face is of: `FaceRole`, and number of the node, end or member.
    face_component : (n_f,) int, the solid that has the face.
    solids, faces : handles of the CAD kernel; see `build123d` and `cadquery` for objects to work with.
    """

    mesh: TrussMesh
    report: SolidReport | SweptReport
    face_role: Int[np.ndarray, " n_f"]
    face_owner: Int[np.ndarray, " n_f"]
    face_component: Int[np.ndarray, " n_f"]
    solids: tuple[Any, ...] = field(repr=False)
    faces: tuple[Any, ...] = field(repr=False)

    def __post_init__(self) -> None:
        freeze(self, face_role=np.int64, face_owner=np.int64, face_component=np.int64)

    @property
    @abstractmethod
    def sized(self) -> SizedTruss:
        """The truss as built."""

    @property
    @abstractmethod
    def node_balls(self) -> Float[np.ndarray, " n_n"]:
        """Radii of the balls of the nodes, mm, within which members are as thick as these; 0 where there are none."""

    @property
    @abstractmethod
    def kept_names(self) -> tuple[str, ...]:
        """Names of the kept solids, by owner of their faces."""

    @property
    @abstractmethod
    def assembly(self) -> tuple[AssemblyPart, ...]:
        """One solid for each bar and each node."""

    @cached_property
    def face_curve(self) -> Int[np.ndarray, " n_f"]:
        """The curve of each face's member; -1 for the faces of nodes and of kept solids."""
        return curve_of_part(self.sized.truss, self.face_role, self.face_owner)

    @cached_property
    def build123d(self) -> Any:
        """A build123d Solid, or a Compound if there are several."""
        from michell_cad.cad import kernel

        return kernel.as_build123d(self.solids)

    @cached_property
    def cadquery(self) -> Any:
        """A CadQuery Workplane with the solids on its stack."""
        from michell_cad.cad import kernel

        return kernel.as_cadquery(self.solids)

    @cached_property
    def cadquery_assembly(self) -> Any:
        """A CadQuery Assembly whose faces have the names and colours that STEP files give them."""
        from michell_cad.cad import kernel
        from michell_cad.cad.step import face_tags

        tags = zip(self.faces, self.face_component.tolist(), face_tags(self), strict=True)
        return kernel.as_cadquery_assembly(
            self.solids, [(face, number, name, colour) for face, number, (name, colour, _) in tags]
        )


def curve_of_part(truss: Truss, role: Int[np.ndarray, " n"], owner: Int[np.ndarray, " n"]) -> Int[np.ndarray, " n"]:
    """Number of the curve that faces or triangles belong to, by role and owner; -1 at nodes and on kept solids."""
    none = (role == FaceRole.NODE) | (role == FaceRole.KEPT)
    member = np.where(role == FaceRole.MEMBER, owner, owner // 2)
    return np.where(none, -1, truss.curve_of_member[np.where(none, 0, member)])
