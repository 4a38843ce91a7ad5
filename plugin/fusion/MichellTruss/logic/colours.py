"""Colours of the families, the same as in michell_cad's STEP files; red, green and blue from 0 to 255."""

COLOURS = {"tension": (214, 94, 0), "compression": (0, 115, 179), "third": (0, 158, 115), "feature": (153, 153, 153)}
