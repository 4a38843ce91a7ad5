"""Show a finished design in the CadQuery editor, with its knobs as the constants below.

Also runs through `cadquery.cqgi`, where the constants become parameters.
"""

import michell_cad as mc

design_file = "bracket-truss/design.npz"
family = "all"  # all, tension, compression or third
radius = 0.0  # mm; 0: 0.08 of the cell edge
entasis = 0.3  # members thicker by this fraction in the middle of their curve
every = 1  # keep every n-th curve

design, _ = mc.load_design(design_file)
knobs = mc.Knobs(family=family, radius=radius or None, entasis=entasis, every=every)
result = mc.build_solid(mc.apply_knobs(design.truss, knobs), knobs).cadquery

show_object(result, name="truss")
