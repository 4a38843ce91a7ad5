"""A camera without perspective that sees any part from a little above, its long side across the picture."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from michell_cad.arrays import freeze

ELEVATION_DEG = 28.0
"""How far the camera looks down."""

AZIMUTH_DEG = 32.0
"""How far the camera stands beside the normal of the long side, so that three sides are seen."""


@dataclass(frozen=True, eq=False)
class Camera:
    """Maps mm to pixels: x to the right, y down, depth towards the viewer.

    Parameters
    ----------
    axes : (3, 3) float, rows: right, up and towards the viewer, orthonormal.
    scale : pixels per mm.
    centre : (3,) float, mm, the point seen at `middle`.
    middle : (2,) float, pixels.
    """

    axes: Float[np.ndarray, "3 3"]
    scale: float
    centre: Float[np.ndarray, " 3"]
    middle: Float[np.ndarray, " 2"]

    def __post_init__(self) -> None:
        freeze(self, axes=np.float64, centre=np.float64, middle=np.float64)

    def project(self, points: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Pixel coordinates and depth (in pixels) of points in mm."""
        seen = (points - self.centre) @ self.axes.T * self.scale
        return np.stack([self.middle[0] + seen[..., 0], self.middle[1] - seen[..., 1], seen[..., 2]], axis=-1)

    def turn(self, directions: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Directions (right, up, towards the viewer) of directions in space."""
        return directions @ self.axes.T


def place_camera(
    points: Float[np.ndarray, "n 3"],
    frame: tuple[float, float, float, float],
    up: int = 2,
    behind: bool = False,
) -> Camera:
    """Place a camera so that all points fill a frame (left, top, right, bottom; pixels).

    Parameters
    ----------
    points : mm.
    up : axis (0, 1, 2) that points up in the picture.
    behind : look from the opposite side and from below instead, at what the first view hides.
    """
    extents = np.ptp(points, axis=0)
    first, second = (up + 1) % 3, (up + 2) % 3
    # The longer horizontal axis runs across; (across, away, up) is right-handed.
    across, away = (first, second) if extents[first] >= extents[second] else (second, first)
    side = 1.0 if (across, away) == (first, second) else -1.0
    azimuth, elevation = np.deg2rad(AZIMUTH_DEG), np.deg2rad(ELEVATION_DEG)
    view = np.zeros(3)
    view[across] = np.sin(azimuth) * np.cos(elevation)
    view[away] = -side * np.cos(azimuth) * np.cos(elevation)
    view[up] = np.sin(elevation)
    if behind:
        view = -view
    vertical = np.eye(3)[up]
    right = np.cross(vertical, view)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(view, right), view])
    seen = points @ axes[:2].T
    low, high = seen.min(0), seen.max(0)
    left, top, end, bottom = frame
    scale = float(min((end - left) / max(high[0] - low[0], 1e-12), (bottom - top) / max(high[1] - low[1], 1e-12)))
    centre = axes.T @ np.array([*(low + high) / 2, 0.0])
    return Camera(axes, scale, centre, np.array([(left + end) / 2, (top + bottom) / 2]))
