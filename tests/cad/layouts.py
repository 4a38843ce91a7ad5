"""Trusses to build solids of: stars, warped grids, and the traced reference layouts where they are at hand."""

import os
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from michell_cad.curves import Curve, CurveKind, Curves, NodeKind
from michell_cad.isocurves import CurveNetwork
from michell_cad.truss import SizedTruss, Truss, build_truss, keep_curves

FAMILIES = ("tension", "compression", "third")


def star(directions, length=10.0, radius=1.0) -> SizedTruss:
    """Straight members from the origin; `radius` a number, one per member, or three per member."""
    d = np.array(directions, float)
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    n = len(d)
    nodes = np.concatenate([np.zeros((1, 3)), np.broadcast_to(length, (n,))[:, None] * d])
    members = np.stack([np.zeros(n, int), np.arange(1, n + 1)], axis=1)
    curves = tuple(
        Curve(CurveKind.INTERIOR, FAMILIES[i % 3], i % 3, (None, i, 0), 0, members[i], np.array([i]), False)
        for i in range(n)
    )
    truss = Truss(nodes, np.zeros(n + 1, int), members, curves, float(np.mean(length)))
    radius = np.asarray(radius, float)
    radius = radius if radius.ndim == 2 else np.broadcast_to(np.atleast_1d(radius)[:, None], (n, 3))
    return SizedTruss(truss, radius)


def curve_truss(points, radius=1.0, closed=False, entasis=0.0, kind=CurveKind.INTERIOR) -> SizedTruss:
    """One curve through points, of one radius, thicker by the entasis in the middle of every member."""
    X = np.array(points, float)
    n = len(X)
    steps = np.stack([np.arange(n), np.roll(np.arange(n), -1)], axis=1)[: n if closed else n - 1]
    curve = Curve(kind, "tension", 0, (None, 1, 1), 0, np.arange(n), np.arange(len(steps)), closed)
    return sized(Truss(X, np.zeros(n, int), np.sort(steps, axis=1), (curve,), 10.0), radius, entasis)


def turned(truss: SizedTruss, R: np.ndarray) -> SizedTruss:
    """The truss turned by a rotation matrix."""
    t = truss.truss
    moved = Truss(
        t.nodes @ R.T,
        t.node_kinds,
        t.members,
        t.curves,
        t.spacing,
        np.asarray(t.waypoints) @ R.T,
        t.waypoint_offsets,
        t.straight,
    )
    return SizedTruss(moved, truss.radii)


def grid_truss(shape=(4, 3, 3), warp=0.15, spacing=10.0, missing=0.0, stride=1, seed=0) -> Truss:
    """A warped grid of three families of curves; a fraction of its curves is missing."""
    rng = np.random.default_rng(seed)
    X = np.stack(np.meshgrid(*(np.arange(k) for k in shape), indexing="ij"), axis=-1).astype(float)
    phase = rng.uniform(0, 2 * np.pi, (3, 3))
    bent = X + warp * np.sin(2.1 * X[..., [1, 2, 0]] + phase[0]) + warp * np.cos(1.7 * X[..., [2, 0, 1]] + phase[1])
    number = np.arange(X[..., 0].size).reshape(shape)
    edge = np.stack([(X[..., a] == 0) | (X[..., a] == shape[a] - 1) for a in range(3)], axis=-1).sum(-1)
    members, curves = [], []
    for axis in range(3):
        others = [a for a in range(3) if a != axis]
        for i in range(0, shape[others[0]], stride):
            for j in range(0, shape[others[1]], stride):
                if rng.uniform() < missing:
                    continue
                row = np.moveaxis(number, axis, 0)[:, i, j]
                mine = len(members) + np.arange(len(row) - 1)
                members += list(pairwise(row))
                values: list[int | None] = [None, None, None]
                values[others[0]], values[others[1]] = i, j
                curves.append(Curve(CurveKind.INTERIOR, FAMILIES[axis], axis, tuple(values), 0, row, mine, False))
    used, compact = np.unique(np.array(members), return_inverse=True)
    renumber = np.full(number.size, -1)
    renumber[used] = np.arange(len(used))
    curves = tuple(
        Curve(c.kind, c.family, c.axis, c.isovalues, 0, renumber[c.nodes], c.members, c.closed) for c in curves
    )
    nodes = spacing * bent.reshape(-1, 3)[used]
    return Truss(nodes, np.minimum(edge.ravel()[used], 3), compact.reshape(-1, 2), curves, spacing)


def sized(truss: Truss, radius: float, entasis: float = 0.0) -> SizedTruss:
    """One radius, thicker by the entasis in the middle of every member."""
    return SizedTruss(truss, np.tile(radius * np.array([1, 1 + entasis, 1]), (len(truss.members), 1)))


def reference_folder() -> Path:
    """The folder of traced layouts; skips the test where there is none."""
    root = os.environ.get("MICHELL_CAD_DATA")
    folder = (Path(root) if root else Path(__file__).parents[3] / "shared" / "data") / "reference"
    if not folder.is_dir():
        pytest.skip(f"no reference layouts in {folder}; set MICHELL_CAD_DATA to the folder that holds `reference`")
    return folder


def reference_truss(name: str, spacing: float = 10.0) -> Truss:
    """A traced reference layout, scaled to a median member of `spacing` mm, cleaned like every truss."""
    return build_truss(reference_network(name, spacing), spacing)


def sparse_reference_truss(name: str, stride: int) -> Truss:
    """Every so many curves of a traced reference layout."""
    truss = reference_truss(name)
    return keep_curves(truss, np.arange(len(truss.curves)) % stride == 0)


def reference_network(name: str, spacing: float = 10.0) -> CurveNetwork:
    """A traced reference layout as it is, short members and all."""
    with np.load(reference_folder() / f"{name}.npz") as data:
        members = np.unique(np.sort(data["elements"], axis=1), axis=0)
        nodes, on_boundary = data["nodes"], data["NodeB"].astype(bool)
        points, offsets = data["curve_pts"], data["curve_off"]
        labels, boundary, feature, closed = (data[f"curve_{x}"] for x in ("uvw", "b", "f", "c"))
    lengths = np.linalg.norm(nodes[members[:, 0]] - nodes[members[:, 1]], axis=1)
    nodes = nodes * (spacing / np.median(lengths))
    number = {tuple(pair): m for m, pair in enumerate(members.tolist())}
    curves, seen = [], {}
    for c, (first, last) in enumerate(pairwise(offsets)):
        row = points[first:last].tolist()
        loop = bool(closed[c]) and len(row) > 2
        if loop and row[0] == row[-1]:
            row = row[:-1]
        pairs = list(zip(row, row[1:] + row[:1] if loop else row[1:], strict=False))
        mine = [number.get((min(p), max(p))) for p in pairs]
        if len(row) < 2 or None in mine:
            continue
        values = tuple(int(v) if v >= 0 else None for v in labels[c])
        kind = CurveKind.FEATURE if feature[c] else CurveKind.BOUNDARY if boundary[c] else CurveKind.INTERIOR
        axis = values.index(None) if kind is CurveKind.INTERIOR and None in values else 0
        family = "feature" if kind is CurveKind.FEATURE else FAMILIES[axis]
        component = seen[kind, values] = seen.get((kind, values), -1) + 1
        curves.append(Curve(kind, family, axis, values, component, np.array(row), np.array(mine), loop))
    covered = np.unique(np.concatenate([c.members for c in curves]))
    place = np.full(len(members), -1)
    place[covered] = np.arange(len(covered))
    curves = tuple(
        Curve(c.kind, c.family, c.axis, c.isovalues, c.component, c.nodes, place[c.members], c.closed) for c in curves
    )
    kinds = np.where(on_boundary, NodeKind.BOUNDARY, NodeKind.INTERIOR)
    n_m = len(covered)
    return CurveNetwork(
        nodes,
        kinds,
        np.zeros_like(nodes),
        members[covered],
        np.zeros((0, 3)),
        np.zeros(n_m + 1, int),
        Curves.of(curves),
    )
