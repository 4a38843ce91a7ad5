"""A z-buffer in NumPy: tubes, balls and triangles, drawn pixel by pixel without any graphics library.

Source: textbook rasterisation (Foley et al., Computer Graphics, 1990: scan conversion and z-buffer), vectorised over
all pixels of many shapes at once. Tubes and balls are exact under a camera without perspective: a pixel's depth and
normal come from the cylinder or ball itself, not from triangles.

All coordinates here are pixels, x right, y down, depth towards the viewer; normals are (right, up, towards the viewer).
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, Int

FRAGMENTS_AT_ONCE = 1_500_000
"""Pixels of shapes that are worked on together: large enough for NumPy, small enough for the cache and memory."""

STEEPEST = 0.25
"""Cosine below which a tube that points at the viewer counts as this steep; its end balls cover it anyway."""

SEAM = 0.01
"""Overlap of neighbouring triangles, pixels: above the rounding of single precision, far below what is seen."""


@dataclass(eq=False)
class Canvas:
    """Buffers of one picture: what is nearest to the viewer at each pixel. Drawing changes them in place.

    Parameters
    ----------
    width, height : pixels.
    """

    width: int
    height: int
    depth: np.ndarray = field(init=False)
    normal: np.ndarray = field(init=False)
    tag: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        n = self.width * self.height
        self.depth = np.full(n, -np.inf, np.float32)
        self.normal = np.zeros((n, 3), np.float32)
        self.tag = np.full(n, -1, np.int32)

    def image(self, buffer: np.ndarray) -> np.ndarray:
        """A buffer with rows and columns."""
        return buffer.reshape(self.height, self.width, *buffer.shape[1:])

    # --- shapes -------------------------------------------------------------------------------------------------

    def draw_tubes(
        self,
        start: Float[np.ndarray, "n 3"],
        end: Float[np.ndarray, "n 3"],
        start_radius: Float[np.ndarray, " n"],
        end_radius: Float[np.ndarray, " n"],
        tags: Int[np.ndarray, " n"],
    ) -> None:
        """Draw straight tubes with open ends; close them by balls."""
        start, end, start_radius, end_radius = (
            np.asarray(a, np.float32) for a in (start, end, start_radius, end_radius)
        )
        d = end - start
        length = np.hypot(d[:, 0], d[:, 1])
        keep = length > 1e-3
        start, d, length, tags = start[keep], d[keep], length[keep], tags[keep]
        r0, r1 = start_radius[keep], end_radius[keep]
        # Scan along the axis in which the tube is longer on the screen: by columns the flat ones, by rows the steep.
        steep = np.abs(d[:, 1]) > np.abs(d[:, 0])
        for rows in (False, True):
            chosen = np.flatnonzero(steep == rows)
            # Nearest first, so that most of what is hidden is dropped before it is shaded.
            chosen = chosen[np.argsort(-(start[chosen, 2] + d[chosen, 2] / 2), kind="stable")]
            cost = (length[chosen] + 2) * (3 * np.maximum(r0, r1)[chosen] + 2)
            for part in _batches(cost):
                k = chosen[part]
                self._scan_tubes(start[k], d[k], length[k], r0[k], r1[k], tags[k], rows)

    def _scan_tubes(self, start, d, length, r0, r1, tags, rows: bool) -> None:
        major, minor = (1, 0) if rows else (0, 1)
        radius = np.maximum(r0, r1)
        ux, uy = d[:, 0] / length, d[:, 1] / length
        overhang = radius * np.abs(np.where(rows, ux, uy)) + 0.5
        low = np.minimum(start[:, major], start[:, major] + d[:, major]) - overhang
        high = np.maximum(start[:, major], start[:, major] + d[:, major]) + overhang
        limit = self.height if rows else self.width
        shape, along = _ranges(low, high, limit)
        slope = d[shape, minor] / d[shape, major]
        middle = start[shape, minor] + slope * (along - start[shape, major])
        half = radius[shape] * np.sqrt(1 + slope**2)
        line, across = _ranges(middle - half, middle + half, self.width if rows else self.height)
        shape, along = shape[line], along[line]
        x, y = (across, along) if rows else (along, across)
        dx, dy = x - start[shape, 0], y - start[shape, 1]
        t = (dx * ux[shape] + dy * uy[shape]) / length[shape]
        w = dx * uy[shape] - dy * ux[shape]
        r = r0[shape] + (r1 - r0)[shape] * t.clip(0, 1)
        slack = 0.5 / length[shape]
        inside = (t >= -slack) & (t <= 1 + slack) & (np.abs(w) < r)
        shape, t, w, r, x, y = shape[inside], t[inside], w[inside], r[inside], x[inside], y[inside]
        tilt = d[:, 2] / length
        cosine = np.maximum(1 / np.sqrt(1 + tilt**2), np.float32(STEEPEST))
        bulge = np.sqrt(r * r - w * w)
        z = start[shape, 2] + t * d[shape, 2] + bulge / cosine[shape]
        pixel, near = self._nearer(x, y, z)
        shape, w, bulge = shape[near], w[near] / r[near], bulge[near] / r[near]
        cosine = cosine[shape]
        sine = -np.sign(tilt[shape]) * np.sqrt(1 - cosine**2)
        # Normal = across * w + outward * bulge; on the screen y points down, in normals up.
        normal = np.stack([uy[shape] * w + ux[shape] * sine * bulge, ux[shape] * w - uy[shape] * sine * bulge], axis=1)
        normal = np.column_stack([normal, cosine * bulge])
        self._put(pixel, normal, tags[shape])

    def draw_balls(
        self, centres: Float[np.ndarray, "n 3"], radii: Float[np.ndarray, " n"], tags: Int[np.ndarray, " n"]
    ) -> None:
        """Draw balls."""
        centres, radii = np.asarray(centres, np.float32), np.asarray(radii, np.float32)
        order = np.argsort(-centres[:, 2], kind="stable")
        for part in _batches((2 * radii[order] + 2) ** 2):
            k = order[part]
            c, r = centres[k], radii[k]
            shape, x = _ranges(c[:, 0] - r, c[:, 0] + r, self.width)
            half = np.sqrt(np.maximum(r[shape] ** 2 - (x - c[shape, 0]) ** 2, 0))
            line, y = _ranges(c[shape, 1] - half, c[shape, 1] + half, self.height)
            shape, x = shape[line], x[line]
            dx, dy = (x - c[shape, 0]) / r[shape], (y - c[shape, 1]) / r[shape]
            bulge = np.sqrt(np.maximum(1 - dx * dx - dy * dy, 0))
            z = c[shape, 2] + bulge * r[shape]
            pixel, near = self._nearer(x, y, z)
            self._put(pixel, np.stack([dx, -dy, bulge], axis=1)[near], tags[k][shape[near]])

    def draw_triangles(
        self, corners: Float[np.ndarray, "n 3 3"], normals: Float[np.ndarray, "n 3 3"], tags: Int[np.ndarray, " n"]
    ) -> None:
        """Draw triangles with a normal at each corner, interpolated in between."""
        corners, normals = np.asarray(corners, np.float32), np.asarray(normals, np.float32)
        for part in _batches(np.ptp(corners[:, :, 0], axis=1) * np.ptp(corners[:, :, 1], axis=1) / 2 + 4):
            self._scan_triangles(corners[part], normals[part], tags[part])

    def _scan_triangles(self, corners: np.ndarray, normals: np.ndarray, tags: np.ndarray) -> None:
        order = np.argsort(corners[:, :, 0], axis=1, kind="stable")
        A, B, C = np.take_along_axis(corners, order[:, :, None], axis=1).transpose(1, 0, 2)
        nA, nB, nC = np.take_along_axis(normals, order[:, :, None], axis=1).transpose(1, 0, 2)
        shape, x = _ranges(A[:, 0], C[:, 0], self.width)

        def edge(P: np.ndarray, Q: np.ndarray) -> np.ndarray:
            run = (Q - P)[shape, 0]
            t = np.divide(x - P[shape, 0], run, out=np.zeros_like(run), where=run > 1e-9)
            return P[shape, 1] + t.clip(0, 1) * (Q - P)[shape, 1]

        long, short = edge(A, C), np.where(x < B[shape, 0], edge(A, B), edge(B, C))
        # The slack closes the seam where two triangles meet exactly on pixels and rounding excludes both.
        line, y = _ranges(np.minimum(long, short) - SEAM, np.maximum(long, short) + SEAM, self.height)
        shape, x = shape[line], x[line]
        area = _cross(B - A, C - A)
        keep = np.abs(area[shape]) > 1e-9
        shape, x, y = shape[keep], x[keep], y[keep]
        P = np.stack([x, y], axis=1) - A[shape, :2]
        b = _cross(P, (C - A)[shape]) / area[shape]
        c = _cross((B - A)[shape], P) / area[shape]
        z = A[shape, 2] + b * (B - A)[shape, 2] + c * (C - A)[shape, 2]
        pixel, near = self._nearer(x, y, z)
        shape, b, c = shape[near], b[near, None], c[near, None]
        normal = nA[shape] + b * (nB - nA)[shape] + c * (nC - nA)[shape]
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        self._put(pixel, normal, tags[shape])

    # --- pixels -------------------------------------------------------------------------------------------------

    def _nearer(self, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Take in the depths of fragments; return the pixels that they change and the fragments nearest there."""
        pixel = y.astype(np.int32) * self.width + x.astype(np.int32)
        front = np.flatnonzero(z > self.depth[pixel])
        pixel, z = pixel[front], z[front].astype(np.float32)
        np.maximum.at(self.depth, pixel, z)
        nearest = z == self.depth[pixel]
        return pixel[nearest], front[nearest]

    def _put(self, pixel: np.ndarray, normal: np.ndarray, tags: np.ndarray) -> None:
        self.normal[pixel] = normal
        self.tag[pixel] = tags


def _ranges(low: np.ndarray, high: np.ndarray, limit: int) -> tuple[np.ndarray, np.ndarray]:
    """All whole numbers in each interval [low, high], cut to 0 ... limit - 1, with the number of their interval."""
    first = np.ceil(low).clip(0, limit).astype(np.int32)
    last = np.floor(high).clip(-1, limit - 1).astype(np.int32)
    counts = np.maximum(last - first + 1, 0)
    owner = np.repeat(np.arange(len(counts), dtype=np.int32), counts)
    shift = (first - (np.cumsum(counts) - counts)).astype(np.int32)
    values = np.arange(len(owner), dtype=np.int32) + shift[owner]
    return owner, values.astype(np.float32)


def _batches(cost: np.ndarray) -> Iterator[slice]:
    """Cut shapes into runs of about `FRAGMENTS_AT_ONCE` pixels."""
    if not len(cost):
        return
    batch = (np.cumsum(cost) // FRAGMENTS_AT_ONCE).astype(np.int64)
    starts = np.flatnonzero(np.diff(batch, prepend=-1))
    for first, last in zip(starts, [*starts[1:], len(cost)], strict=True):
        yield slice(int(first), int(last))


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
