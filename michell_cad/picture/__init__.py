"""Pictures without a graphics card: the truss inside the ghost of its part, and the faces of a part.

Our own z-buffer in NumPy (`canvas.py`), because off-screen rendering by OpenGL needs a driver that many machines lack.
Pictures are the same from run to run.
"""

from michell_cad.picture.part_picture import Arrow, face_colours, render_part
from michell_cad.picture.truss_picture import ShownMesh, render_truss

__all__ = ["Arrow", "ShownMesh", "face_colours", "render_part", "render_truss"]
