"""Build the cantilever of `cantilever.toml` with build123d and write `cantilever.step` beside this script.

The paper's bar (Arora et al. 2019, Section 5): twice as long as it is wide and high, 200 x 100 x 100 mm, from x = 0.
"""

from datetime import UTC, datetime
from pathlib import Path

from build123d import Align, Box, Solid, export_step

SIZE = (200.0, 100.0, 100.0)


def build_cantilever() -> Solid:
    """Return the bar: x from 0 to 200, y and z from -50 to 50 mm."""
    return Box(*SIZE, align=(Align.MIN, Align.CENTER, Align.CENTER)).solid()


if __name__ == "__main__":
    bar = build_cantilever()
    target = Path(__file__).with_suffix(".step")
    # A fixed date keeps the file the same from run to run.
    export_step(bar, str(target), timestamp=datetime(2026, 1, 1, tzinfo=UTC))
    print(f"{target.name}: {bar.volume:.0f} mm3")
