"""FreeCAD runs this at every start, also without a window; nothing has to be done before a truss is made or opened."""
