"""The tables of a shell while they grow; `shell` and its neighbours fill them."""

import numpy as np

from michell_cad.cad.fits import FITS, Fitted
from michell_cad.cad.prepared import PreparedTruss
from michell_cad.cad.shell_plan import PcurveForm, Strips

TOLERANCE = 1e-6
"""Tolerance of edges and vertices (relative to the largest radius): rational circles fail at a tenth of it."""

KERNEL_TOLERANCE = 1e-7
"""mm: the kernel takes nearer points for the same one."""

FIT_SAFETY = 2.0
"""Edges take this multiple of the largest deviation that was measured between their curves (relative)."""

TURN = 2 * np.pi


class Table:
    """Rows of several columns, appended in blocks."""

    def __init__(self, **widths: int) -> None:
        self._blocks: dict[str, list[np.ndarray]] = {name: [] for name in widths}
        self._widths = widths
        self.size = 0

    def add(self, n: int, **columns: object) -> np.ndarray:
        """Append n rows; a scalar or a single row is repeated. Returns their numbers."""
        for name, width in self._widths.items():
            shape = (n,) if width == 1 else (n, width)
            self._blocks[name].append(np.broadcast_to(np.asarray(columns[name], float), shape))
        self.size += n
        return np.arange(self.size - n, self.size)

    def __getitem__(self, name: str) -> np.ndarray:
        width = self._widths[name]
        return np.concatenate([np.zeros((0,) if width == 1 else (0, width)), *self._blocks[name]])

    def whole(self, name: str) -> np.ndarray:
        """A column of whole numbers."""
        return self[name].astype(np.int64)


class ShellTables:
    """The tables while they grow."""

    def __init__(self, prepared: PreparedTruss) -> None:
        self.p = prepared
        truss, sizes = prepared.sized.truss, prepared.sizes
        self.node = prepared.node_of_end
        self.d, self.N = prepared.directions, prepared.normals
        self.B = np.cross(self.d, self.N)
        self.X = truss.nodes[self.node]
        self.r, self.f, self.reach, self.creased = sizes.end_radius, sizes.fillet, sizes.reach, sizes.creased
        self.R, self.a = sizes.radius[self.node], prepared.caps
        self.n_e, self.n_m = len(self.node), len(truss.members)
        self.tolerance = max(TOLERANCE * float(self.r.max()), KERNEL_TOLERANCE)
        self.points = Table(x=3)
        self.frames = Table(origin=3, axis=3, zero=3, radii=2)
        self.edges = Table(form=1, curve=1, ranges=2, ends=2, tolerance=1)
        self.faces = Table(form=1, surface=1, reversed_=1, role=1, owner=1, node=1)
        self.coedges = Table(face=1, wire=1, order=1, edge=1, reversed_=1, form=1, pcurve=1)
        self.lines = Table(origin=2, direction=2)
        self.poles: list[list[np.ndarray]] = [[np.zeros((0, len(fit.places), 2))] for fit in FITS]
        self.strips = Strips(np.zeros((0, 3, 1, 3)), np.zeros((0, 1)), np.zeros((0, 1)), 0)
        self.contact = np.zeros(0, int)
        # A plain end has one circle for tube and sphere.
        self.plain = (self.f == 0) & ~self.creased
        self.tube_edge = np.full(self.n_e, -1)
        self.corners: dict[int, np.ndarray] = {}
        self.widened: list[tuple[np.ndarray, np.ndarray]] = []

    def add_edges(self, form, curve, ranges, ends) -> np.ndarray:
        return self.edges.add(len(ends), form=form, curve=curve, ranges=ranges, ends=ends, tolerance=self.tolerance)

    def run_along(self, face, wire, order, edge, reversed_, form, pcurve) -> None:
        n = len(np.atleast_1d(edge))
        self.coedges.add(n, face=face, wire=wire, order=order, edge=edge, reversed_=reversed_, form=form, pcurve=pcurve)

    def run_line(self, face, order, edge, reversed_, origin, direction) -> None:
        """Coedges in wire 0 whose pcurves are lines."""
        n = len(np.atleast_1d(edge))
        lines = self.lines.add(n, origin=origin, direction=direction)
        self.run_along(face, 0, order, edge, reversed_, PcurveForm.LINE, lines)

    def run_fitted(self, face, wire, order, edge, reversed_, fitted: Fitted) -> None:
        """Coedges whose pcurves were fitted."""
        number = np.zeros(len(fitted.fit), int)
        for k, poles in enumerate(fitted.poles):
            number[fitted.fit == k] = sum(map(len, self.poles[k])) + np.arange(len(poles))
            self.poles[k].append(poles)
        self.run_along(face, wire, order, edge, reversed_, PcurveForm.FITTED + fitted.fit, number)

    def widen(self, edge: np.ndarray, deviation: np.ndarray) -> None:
        """Let the tolerance of edges cover the largest distance between their curves, in mm."""
        self.widened.append((edge, FIT_SAFETY * deviation))


class Arcs:
    """Arcs of the circles on the spheres, per end in ascending order of angle, after all cuts."""

    """`piece` numbers the pieces of `Creases`, -1 elsewhere; `cuts` (n_n, 2) are the points where seams end, or -1."""

    def __init__(self, end, ranges, ends, piece, edge, cuts) -> None:
        self.end, self.ranges, self.ends, self.piece, self.edge = end, ranges, ends, piece, edge
        self.cuts = cuts
        self.order = np.lexsort((ranges[:, 0], end))
        self.bounds = np.searchsorted(end[self.order], np.arange(int(end.max()) + 2))

    def of_end(self, e: int) -> np.ndarray:
        return self.order[self.bounds[e] : self.bounds[e + 1]]
