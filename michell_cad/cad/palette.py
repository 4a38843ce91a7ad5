"""What the families are called and coloured in files."""

COLOURS = {
    "tension": (0.84, 0.37, 0.0),
    "compression": (0.0, 0.45, 0.70),
    "third": (0.0, 0.62, 0.45),
    "feature": (0.6, 0.6, 0.6),
    "node": (0.8, 0.8, 0.8),
}
"""sRGB colours of the families and of the nodes; from the palette of Okabe and Ito, made for colour-blind eyes."""

NODES = "nodes"
"""Name of the group of the nodes, beside the families."""

GROUPS = ("tension", "compression", "third", "feature", NODES)
"""The groups in the order in which files list them."""


def group_colour(group: str) -> tuple[float, float, float]:
    """Colour of a family, or of the nodes."""
    return COLOURS["node" if group == NODES else group]
