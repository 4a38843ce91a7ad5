"""Pictures without a graphics card: the truss inside the ghost of its part, the faces of a part, and stresses.

Our own z-buffer in NumPy (`canvas.py`), because off-screen rendering by OpenGL needs a driver that many machines lack.
Pictures are the same from run to run.
"""

from michell_cad.picture.part_picture import Arrow, face_colours, render_part
from michell_cad.picture.stress_picture import StressedBalls, render_member_stress, render_solid_stress
from michell_cad.picture.truss_picture import ShownMesh, render_truss

__all__ = [
    "Arrow",
    "ShownMesh",
    "StressedBalls",
    "face_colours",
    "render_member_stress",
    "render_part",
    "render_solid_stress",
    "render_truss",
]
