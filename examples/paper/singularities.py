"""The three singularities of a planar stress field and the curves that avoid them (Figure 9 of Arora et al. 2019).

    python examples/paper/singularities.py [FOLDER]

Writes lemon.png, monstar.png and star.png. A plate in plane stress has the tension 1 in all directions of its plane,
and on top of it a deviator that vanishes in the middle only:

    sigma = [[1 + Re, Im], [Im, 1 - Re]],  Re = a x + b y,  Im = c x + d y.

Once around the middle the principal directions turn by half a turn: forwards for lemon and monstar, backwards for the
star (Delmarcelle and Hesselink 1994, doi:10.1109/VISUAL.1994.346326). One chart for the whole plate cannot turn with
them: along two seams from the middle to the rim its families change places. Left: the direction of the larger stress.
Right: the traced curves in the colours of their families, shaded where shear acts on them.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import ndimage

from michell_cad.curves import FAMILIES, CurveKind
from michell_cad.elasticity import StressField
from michell_cad.frame_field import fit_frame_field
from michell_cad.isocurves import CurveNetwork, trace_isocurves
from michell_cad.metrics import name_families, shear_residual
from michell_cad.palette import COLOURS
from michell_cad.parametrization import Parametrization, ParametrizationOptions, parametrize
from michell_cad.picture.canvas import Canvas
from michell_cad.picture.shading import blend, shade_solid
from michell_cad.picture.sheet import INK, SUPERSAMPLING, open_sheet, save_sheet, shrink, to_bytes
from michell_cad.tet_mesh import TetMesh

SIDE, THICKNESS = 2.0, 0.16
"""Of the plate, mm; the middle of its middle plane is the origin."""
CELLS = (30, 30, 2)
RESOLUTION = 16.0

FIELDS = {
    "lemon": ((1.0, 0.0), (0.0, 1.0)),
    "monstar": ((0.4, 0.0), (0.0, 1.2)),
    "star": ((1.0, 0.0), (0.0, -1.0)),
}
"""((a, b), (c, d)) of each singularity, 1/mm; the stress is in MPa."""


@dataclass(frozen=True, eq=False)
class Layout:
    """What was computed for one singularity."""

    stress: np.ndarray
    parametrization: Parametrization
    network: CurveNetwork


def plate_mesh(cells: tuple[int, int, int] = CELLS) -> TetMesh:
    """The plate, of bricks that are cut into the six tets of Kuhn."""
    lengths = (SIDE, SIDE, THICKNESS)
    axes = [np.linspace(-h / 2, h / 2, n + 1) for h, n in zip(lengths, cells, strict=True)]
    number = np.arange(np.prod(np.array(cells) + 1)).reshape(np.array(cells) + 1)
    corner = np.indices(cells).reshape(3, -1)
    tets = []
    for order in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)):
        steps = np.cumsum(np.vstack([np.zeros((1, 3), int), np.eye(3, dtype=int)[list(order)]]), axis=0)
        tets.append(np.stack([number[tuple(corner + step[:, None])] for step in steps], axis=1))
    return TetMesh(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3), np.concatenate(tets))


def stress_at(name: str, points: np.ndarray) -> np.ndarray:
    """sigma (n, 3, 3) of a field at points (n, 3)."""
    re, im = np.array(FIELDS[name]) @ points[:, :2].T
    sigma = np.zeros((len(points), 3, 3))
    sigma[:, 0, 0], sigma[:, 1, 1] = 1 + re, 1 - re
    sigma[:, 0, 1] = sigma[:, 1, 0] = im
    return sigma


def follow_field(name: str, mesh: TetMesh, options: ParametrizationOptions | None = None) -> Layout:
    """Frames, parametrization and curves of a field, by the stages of the package."""
    stress = stress_at(name, mesh.centroids)
    field = StressField(stress, np.zeros((1, len(mesh.vertices), 3)), (0,), (0.0,), 0.0)
    parametrization = parametrize(mesh, field, fit_frame_field(mesh, field), options)
    levels, _ = parametrization.levels(RESOLUTION)
    families = name_families(mesh, stress, parametrization.tangents)
    return Layout(stress, parametrization, trace_isocurves(mesh, levels, families))


# --- the picture -----------------------------------------------------------------------------------------------------

PANEL, GAP, HEAD = 560, 40, 60
"""Sides of the two panels, the space around them, and that for the captions, pixels."""
SHADE = (0.55, 0.42, 0.62)


def draw(name: str, layout: Layout, path: Path) -> None:
    """Draw the field and the curves side by side."""
    at = ((np.arange(PANEL) + 0.5) / PANEL - 0.5) * SIDE
    x, y = np.meshgrid(at, -at)
    points = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    texture = 0.35 + 0.6 * line_integral_convolution(stress_at(name, points).reshape(PANEL, PANEL, 3, 3))
    opacity = np.clip(1.5 * crossing_shear(layout, points).reshape(PANEL, PANEL), 0, 0.9)
    texture, opacity = (
        np.kron(a, np.ones((SUPERSAMPLING, SUPERSAMPLING))).astype(np.float32) for a in (texture, opacity)
    )
    left = np.repeat(texture[:, :, None], 3, axis=2).astype(np.float32)
    right = draw_curves(blend(np.ones_like(left), np.array(SHADE), opacity), layout)
    height, width, pixels = PANEL + GAP + HEAD, 2 * PANEL + 3 * GAP, len(left)
    picture = np.ones((SUPERSAMPLING * height, SUPERSAMPLING * width, 3), np.float32)
    for number, panel in enumerate((left, right)):
        top, start = SUPERSAMPLING * HEAD, SUPERSAMPLING * (GAP + number * (PANEL + GAP))
        picture[top : top + pixels, start : start + pixels] = panel
    image, pen, font = open_sheet(shrink(picture))
    residual = shear_residual(layout.parametrization.mesh, layout.stress, layout.parametrization.tangents)
    captions = (f"{name}: direction of the larger stress", f"traced curves, shear residual {residual:.2f}")
    for number, text in enumerate(captions):
        pen.text((GAP + number * (PANEL + GAP), HEAD // 2), text, fill=to_bytes(INK), font=font, anchor="lm")
    save_sheet(image, path)


def line_integral_convolution(sigma: np.ndarray, reach: int = 16, step: float = 1.0) -> np.ndarray:
    """Noise smeared along the direction of the larger stress (Cabral and Leedom 1993), between 0 and 1."""
    size = len(sigma)
    angle = 0.5 * np.arctan2(2 * sigma[..., 0, 1], sigma[..., 0, 0] - sigma[..., 1, 1])
    noise = ndimage.gaussian_filter(np.random.default_rng(0).normal(size=(size, size)), 0.9)
    total = noise.copy()
    for sign in (1.0, -1.0):
        row, column = (a.astype(float) for a in np.indices((size, size)))
        along = sign * np.stack([-np.sin(angle), np.cos(angle)])  # rows grow downwards
        for _ in range(reach):
            row, column = row + step * along[0], column + step * along[1]
            i, j = (np.clip(np.rint(a), 0, size - 1).astype(int) for a in (row, column))
            new = np.stack([-np.sin(angle[i, j]), np.cos(angle[i, j])])
            along = new * np.where((new * along).sum(0) < 0, -1.0, 1.0)  # a direction has no sign: keep on
            total += noise[i, j]
    low, high = np.quantile(total, [0.02, 0.98])
    return np.clip((total - low) / (high - low), 0, 1)


def crossing_shear(layout: Layout, points: np.ndarray) -> np.ndarray:
    """Shear stress on the curves, |t_1' sigma t_2|, in the plane and at the given points (n, 3), MPa."""
    mesh = layout.parametrization.mesh
    T = layout.parametrization.tangents
    S = np.einsum("tij,tik,tkl->tjl", T, layout.stress, T)
    shear = np.abs(S[:, [0, 0, 1], [1, 2, 2]]).max(1)
    cells = np.array(CELLS[:2])
    column = np.floor((mesh.centroids[:, :2] / SIDE + 0.5) * cells).astype(int)
    total, count = np.zeros(cells), np.zeros(cells)
    np.add.at(total, tuple(column.T), shear)
    np.add.at(count, tuple(column.T), 1)
    place = (points[:, :2] / SIDE + 0.5) * cells - 0.5
    return ndimage.map_coordinates(total / count, place.T, order=1, mode="nearest")


def draw_curves(picture: np.ndarray, layout: Layout) -> np.ndarray:
    """Draw the curves that run along the plate, seen from above."""
    network, pixels = layout.network, len(picture)
    canvas = Canvas(pixels, pixels)
    for curve in network.curves:
        if curve.kind is CurveKind.BOUNDARY:
            continue
        for member in curve.members:
            a, b = network.members[member]
            path = network.path_points[network.path_offsets[member] : network.path_offsets[member + 1]]
            line = np.concatenate([network.nodes[[a]], path, network.nodes[[b]]])
            xy = np.stack([(line[:, 0] / SIDE + 0.5) * pixels, (0.5 - line[:, 1] / SIDE) * pixels, 0 * line[:, 0]], 1)
            radius = np.full(len(xy) - 1, 3.0)
            tags = np.full(len(xy) - 1, FAMILIES.index(curve.family))
            canvas.draw_tubes(xy[:-1], xy[1:], radius, radius, tags)
    palette = np.array([COLOURS[family] for family in FAMILIES])
    rgb, covered = shade_solid(canvas, palette, fog=0.0, unsharp=0.0, ambient=1.0, specular=0.0)
    return np.where(covered[:, :, None], rgb, picture)


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    mesh = plate_mesh()
    for name in FIELDS:
        layout = follow_field(name, mesh)
        draw(name, layout, folder / f"{name}.png")
        print(f"{name}: {len(layout.network.curves)} curves, {folder / f'{name}.png'}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
