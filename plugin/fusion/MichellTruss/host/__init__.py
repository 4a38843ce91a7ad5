"""The side of the add-in that talks to Fusion; what it shows and draws is decided in `logic`."""
