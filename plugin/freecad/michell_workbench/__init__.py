"""Michell trusses in FreeCAD: forms and a worker process; all mathematics is in michell_cad, in a Python of its own.

`job`, `knob_properties`, `client`, `interpreter` and `messages` know nothing of FreeCAD; `bodies`, `session` and
`trusses` need its documents; `views`, `panel` and `commands` its window.
"""
