"""The truss as an object of CAD programs whose scripts are Python: build123d and CadQuery.

`finished` is what both show, made from `picks` of a part or from a finished design; `build123d_objects` and
`cadquery_plugin` give it the habits of their program. Each imports its program when it is imported itself.
"""
