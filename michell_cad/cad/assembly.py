"""The parts of the truss as an assembly: one solid for each bar and for each node, see `bars` and `node_bodies`."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from michell_cad.cad.bars import plan_bars
from michell_cad.cad.node_bodies import plan_nodes
from michell_cad.cad.prepared import PreparedTruss
from michell_cad.errors import GeometryKernelError
from michell_cad.palette import GROUPS, NODES


@dataclass(frozen=True)
class AssemblyPart:
    """A closed solid of an assembly.

    Parameters
    ----------
    group : the family of its curve, or `palette.NODES`.
    name : the name of its curve, with a number if that has several bars; or `node` and its number.
    solid : handle of the CAD kernel.
    """

    group: str
    name: str
    solid: Any = field(repr=False)


def build_assembly(prepared: PreparedTruss) -> tuple[AssemblyPart, ...]:
    """The bars and nodes of a truss as closed solids, ordered by group.

    Raises
    ------
    GeometryKernelError
        If the kernel finds one of them invalid; names it.
    """
    from michell_cad.cad import kernel

    curves = prepared.sized.truss.curves
    bars, owners = plan_bars(prepared)
    seen: Counter[int] = Counter()
    parts = []
    for solid, c in zip(kernel.make_solids(bars)[0], owners.tolist(), strict=True):
        seen[c] += 1
        name = curves[c].name if seen[c] == 1 else f"{curves[c].name} part {seen[c]}"
        parts.append(AssemblyPart(curves[c].family, name, solid))
    bodies, nodes = plan_nodes(prepared)
    for solid, i in zip(kernel.make_solids(bodies)[0], nodes.tolist(), strict=True):
        parts.append(AssemblyPart(NODES, f"node {i}", solid))
    for part in parts:
        if not kernel.is_valid(part.solid):
            raise GeometryKernelError(
                f"{part.name} does not come out as a valid solid of its own: write the truss as one solid, "
                "or use a smaller radius"
            )
    return tuple(sorted(parts, key=lambda part: GROUPS.index(part.group)))
