"""What the families are called and how they are coloured, in files and pictures alike."""

from michell_cad.curves import FAMILIES

_BYTES = {
    "tension": (213, 94, 0),
    "compression": (0, 114, 178),
    "third": (0, 158, 115),
    "feature": (153, 153, 153),
    "added": (204, 121, 167),
    "brace": (86, 180, 233),
    "node": (204, 204, 204),
    "kept": (240, 228, 66),
}

COLOURS: dict[str, tuple[float, float, float]] = {
    name: (red / 255, green / 255, blue / 255) for name, (red, green, blue) in _BYTES.items()
}
"""sRGB colours of the families, kept solids (the palette of Okabe and Ito, made for colour-blind eyes) and nodes."""

NODES = "nodes"
"""Name of the group of the nodes, beside the families."""

KEPT = "kept"
"""Name of the group of the solids that were united with the truss."""

GROUPS = (*FAMILIES, NODES, KEPT)
"""The groups in the order in which files list them."""


def group_colour(group: str) -> tuple[float, float, float]:
    """Colour of a family, or of the nodes."""
    return COLOURS["node" if group == NODES else group]
