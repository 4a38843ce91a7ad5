"""Build the cantilever of `cantilever.toml` with build123d and write `cantilever.step` beside this script.

The paper's bar (Arora et al. 2019, Figures 4 and 15), 200 x 100 x 100 mm, held at x = 0. Its far end is divided into three
strips, so that the load has a face to act on: the middle one, a tenth of the height.
"""

from datetime import UTC, datetime
from pathlib import Path

from build123d import Align, Box, BuildPart, Locations, Part, Plane, export_step, split

LENGTH, DEPTH, HEIGHT = 200.0, 100.0, 100.0
STRIP = 10.0
